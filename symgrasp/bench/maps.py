"""Maps by the engine measured against the reference and brute force, and how their cost grows."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import yaml

from symgrasp.bench.figures import Figure
from symgrasp.feasibility.algorithm1 import furthest
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.exact import ExactEngine
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.files import SCENES_DIR
from symgrasp.ik import solver_for
from symgrasp.poses import Array, inverse
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import shipped_scenes
from symgrasp.world import BulletWorld, open_world

__all__ = ["against_others", "boxes", "growth", "process", "run", "turning"]

GRID = {"heights": 48, "angles": 96, "redundancy": 32}
"""The grid that the figures are for: times two rolls, 9216 cells."""

ROUNDS = 5
"""Each round times everything that a ratio compares, one right after the other."""

SECONDS = {"reference": 0.9, "Pinocchio and Coal": 0.5}
"""About how long (s) each of the slow ways is timed in a round."""

CALIBRATION = 60
"""Cells that tell how many make up those seconds."""

CUTS = 10
"""Along two sides each, to make a hundred boxes of one."""

SCALES = """
import resource, subprocess, sys, time
start = time.perf_counter()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(time.perf_counter() - start, peak / (1e6 if sys.platform == "darwin" else 1e3))
"""
"""Runs a command and prints its time (s) and the most memory (MB) it took.

A small process of its own: what a child weighs counts from before it has let go of its parent's memory.
"""

WITHOUT_COAL = "maps against Pinocchio and Coal: not measured, needs pip install 'symgrasp[bench]'"


def run() -> Iterator[Figure]:
    """Measure the maps, a figure at a time."""
    yield from against_others(list(shipped_scenes()), ROUNDS)
    yield from growth(ROUNDS)
    yield from boxes(ROUNDS)
    yield from turning(20 * ROUNDS)
    yield from process(3)


class _Race(NamedTuple):
    """A scene's times: to build and for a map (s), and of the slow ways as multiples of a map."""

    build: list[float]
    map: list[float]
    others: dict[str, list[float]]


Decide = Callable[[Array, float], Any]
"""Decides one cell by its tool pose (4, 4) in the base and the opening (m) of the hand."""


def against_others(scenes: Sequence[str], rounds: int) -> Iterator[Figure]:
    """Time the first task's map of each scene, by the engine and by the slow ways.

    The slow ways decide cells drawn at random among those that a hand can hold; their time is scaled
    to all of these.
    """
    races: list[_Race] = []
    for name in scenes:
        races.append(_race(Scene.load(name).with_settings(**GRID), rounds))
        yield Figure(f"map of {name}", "ms", _ms(races[-1].map))
        yield Figure("  built once for its arm and obstacles", "ms", _ms(races[-1].build))
        for other, ratios in races[-1].others.items():
            yield Figure(f"  {other}, from a random sample of its cells", "×", tuple(ratios))
    for other in SECONDS:
        medians = [float(np.median(race.others[other])) for race in races if other in race.others]
        if medians:
            yield Figure(f"maps of all shipped scenes: {other} takes", "×", tuple(medians))
        else:
            yield Figure(WITHOUT_COAL, "", ())


def _race(scene: Scene, rounds: int) -> _Race:
    task = scene.task()
    arm = scene.arm(task.arms[0])
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(arm.name, task)  # compiles what is not compiled yet
        build = [_time(lambda: ExactEngine(world, arm, scene.manifold)) for _ in range(3)]
        tools = inverse(arm.robot.T_world_base) @ m.manifold.tool_poses(
            task.T_world_object, arm.hand.finger_depth
        )
        world.margin = scene.settings.margin
        ways = dict(_ways(world, scene))
        cells = [Cell(*cell) for cell in np.argwhere(m.reason >= Reason.UNREACHABLE)]
        rng = np.random.default_rng(0)

        def sample(decide: Decide, count: int) -> float:
            """Return the time (s) of all cells, from some."""
            picks = [cells[k] for k in rng.choice(len(cells), min(count, len(cells)), replace=False)]
            world.set_arms(())
            world.set_object(task.T_world_object)
            time = _time(lambda: [decide(tools[cell], float(m.opening[cell.row])) for cell in picks])
            return time / len(picks) * len(cells)

        counts = {
            name: max(1, round(SECONDS[name] * len(cells) / sample(decide, CALIBRATION)))
            for name, decide in ways.items()
        }
        times, others = [], {name: [] for name in ways}
        for _ in range(rounds):
            for name, decide in ways.items():
                slow = sample(decide, counts[name])
                quick = [_time(lambda: maker.map(arm.name, task)) for _ in range(3)]
                times += quick
                others[name].append(slow / float(np.median(quick)))
    return _Race(build, times, others)


def _ways(world: BulletWorld, scene: Scene) -> Iterator[tuple[str, Decide]]:
    """Yield the slow ways to decide a cell of the first task."""
    task = scene.task()
    arm = scene.arm(task.arms[0])
    ik = solver_for(arm, scene.settings.redundancy)
    checker = CandidateChecker(world, arm, ik, scene.settings.approach)
    yield "reference", lambda T, opening: furthest(checker.candidates(T, opening))
    if has_coal() and scene.settings.approach == scene.settings.margin == 0:
        from symgrasp.bench.brute import BruteForce

        yield "Pinocchio and Coal", BruteForce(world, arm, ik, task.T_world_object).feasible


def has_coal() -> bool:
    """Whether Pinocchio and Coal are installed."""
    return all(importlib.util.find_spec(name) for name in ("pinocchio", "coal"))


def growth(rounds: int) -> Iterator[Figure]:
    """Time maps with more cells and more redundancy samples: the time for each should stay."""
    cells = {scale: {**GRID, "heights": 24 * scale, "angles": 48 * scale} for scale in (1, 2, 4)}
    samples = {count: {**GRID, "redundancy": count} for count in (16, 32, 64, 128)}
    for what, settings, most in (
        ("a cell, 16 times as many cells", cells, lambda s: s["heights"] * s["angles"]),
        ("a redundancy sample, 8 times as many samples", samples, lambda s: s["redundancy"]),
    ):
        small, large = settings[min(settings)], settings[max(settings)]
        with _Quick(small) as few, _Quick(large) as many:
            ratios = [many.time() / most(large) / (few.time() / most(small)) for _ in range(rounds)]
        yield Figure(f"time for {what}", "×", tuple(ratios))


def boxes(rounds: int) -> Iterator[Figure]:
    """Time a map among four boxes, and with each cut into a hundred: the answer is the same."""
    content = yaml.safe_load((SCENES_DIR / "bottle_on_table.yaml").read_text())
    few = [
        {"name": "table", "box": [1.2, 1.2, 0.04], "pose": {"position": [0.4, 0, -0.02]}},
        {"name": "wall", "box": [0.04, 1.2, 0.8], "pose": {"position": [0.85, 0, 0.4]}},
        {"name": "side", "box": [0.6, 0.04, 0.5], "pose": {"position": [0.5, 0.3, 0.25]}},
        {"name": "shelf", "box": [0.3, 0.5, 0.04], "pose": {"position": [0.7, 0, 0.55]}},
    ]
    many = [piece for box in few for piece in _cut(box)]
    made = {}
    for count, obstacles in ((4, few), (400, many)):
        content["obstacles"] = obstacles
        made[count] = Scene.from_content(content).with_settings(**GRID)
        assert len(made[count].obstacles) == count
    with _Quick(scene=made[4]) as quick, _Quick(scene=made[400]) as slow:
        assert np.array_equal(quick.map().feasible, slow.map().feasible)
        ratios = tuple(slow.time() / quick.time() for _ in range(rounds))
    yield Figure("the same boxes, 4 cut into 400", "×", ratios)


def _cut(box: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Cut a box across its two longer sides."""
    size, middle = np.array(box["box"], dtype=float), np.array(box["pose"]["position"], dtype=float)
    first, second = np.sort(np.argsort(-size)[:2])
    piece = size.copy()
    piece[[first, second]] /= CUTS
    for i, j in np.ndindex(CUTS, CUTS):
        at = middle.copy()
        at[first] += (i + 0.5) * piece[first] - 0.5 * size[first]
        at[second] += (j + 0.5) * piece[second] - 0.5 * size[second]
        yield {"name": f"{box['name']}{i}_{j}", "box": piece.tolist(), "pose": {"position": at.tolist()}}


def turning(rounds: int) -> Iterator[Figure]:
    """Time what turning the object about its axis costs."""
    with _Quick(GRID) as quick:
        m = quick.map()
        angles = np.random.default_rng(0).uniform(-np.pi, np.pi, rounds)
        times = [1e6 * _time(lambda angle=angle: m.shift(angle)) for angle in angles]
    yield Figure("turning the object about its axis", "µs", tuple(times))


def process(runs: int) -> Iterator[Figure]:
    """Run the command line as a process: what a first look takes on a machine that has compiled before."""
    command = [sys.executable, "-m", "symgrasp", "map", "bottle_on_table"]
    subprocess.run(command, check=True, capture_output=True)
    weighed = [
        subprocess.run(
            [sys.executable, "-c", SCALES, *command], check=True, capture_output=True, text=True
        ).stdout
        for _ in range(runs)
    ]
    times, peaks = zip(*(map(float, line.split()) for line in weighed), strict=True)
    yield Figure("symgrasp map bottle_on_table, whole process", "s", times)
    yield Figure("  memory at most", "MB", peaks)


class _Quick:
    """Maps of a scene's first task by the engine, in a ``with`` block."""

    def __init__(self, settings: dict[str, int] | None = None, scene: Scene | None = None) -> None:
        self._scene = scene or Scene.load("bottle_on_table").with_settings(**(settings or GRID))

    def __enter__(self) -> _Quick:
        self._world = open_world(self._scene)
        self._maker = MapMaker(self._world)
        self.map()
        return self

    def __exit__(self, *_: object) -> None:
        self._world.close()

    def map(self) -> FeasibilityMap:
        return self._maker.map()

    def time(self) -> float:
        """Return the median time (s) of three maps."""
        return float(np.median([_time(self.map) for _ in range(3)]))


def _time(work: Callable[[], Any]) -> float:
    start = perf_counter()
    work()
    return perf_counter() - start


def _ms(seconds: Sequence[float]) -> tuple[float, ...]:
    return tuple(1e3 * s for s in seconds)
