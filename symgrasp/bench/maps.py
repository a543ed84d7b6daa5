"""Times of the exact engine's maps: against Algorithm 1 and brute force, and growing with the problem."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import trimesh
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
from symgrasp.scene.shipped import extra_of, shipped_scenes
from symgrasp.world import BulletWorld, open_world

__all__ = ["against_others", "boxes", "growth", "process", "run", "turning"]

GRID = {"heights": 48, "angles": 96, "redundancy": 32}
"""The resolution that the figures are for; with two rolls, 9216 cells."""

ROUNDS = 5
"""Number of rounds; each times everything that a ratio compares, one right after the other."""

SECONDS = {"reference": 0.9, "Pinocchio and Coal": 0.5}
"""About how long (s) each of the slow methods is timed in a round."""

CALIBRATION = 60
"""Number of cells that are timed to find out how many take that long."""

FINE = 12288
"""Number of triangles of a fine mesh: those of a box, each cut into four, five times over."""

CUTS = 10
"""Number of parts that a box is cut into along each of two sides, to make a hundred of one."""

MEASURE_PROCESS = """
import resource, subprocess, sys, time
start = time.perf_counter()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(time.perf_counter() - start, peak / (1e6 if sys.platform == "darwin" else 1e3))
"""
"""Program that runs a command and prints its time (s) and its peak memory (MB).

It runs as a small process of its own, because the peak of a child includes the memory of its parent that
it has between fork and exec.
"""

WITHOUT_COAL = "maps against Pinocchio and Coal: not measured, needs pip install 'symgrasp[bench]'"


def run() -> Iterator[Figure]:
    """Run the benchmarks of maps and yield their figures as they are measured."""
    plain = [name for name, path in shipped_scenes().items() if extra_of(path) is None]
    yield from against_others(plain, ROUNDS)
    yield from growth(ROUNDS)
    yield from boxes(ROUNDS)
    yield from turning(20 * ROUNDS)
    yield from process(3)


class _SceneTimes(NamedTuple):
    """Times of one scene.

    Attributes:
        build: to build the engine (s), one value a run.
        map: to compute a map (s), one value a run.
        others: slow method → its times as multiples of that of a map, one value a round.
    """

    build: list[float]
    map: list[float]
    others: dict[str, list[float]]


Decide = Callable[[Array, float], Any]
"""Decides whether a cell is feasible, given its tool pose (4, 4) in the base and the hand's opening (m)."""


def against_others(scenes: Sequence[str], rounds: int) -> Iterator[Figure]:
    """Time the map of the first task of each scene by the engine and by the slow methods.

    The slow methods decide a random sample of the cells that fit the hand; their time is scaled to all of
    these.
    """
    times: list[_SceneTimes] = []
    for name in scenes:
        times.append(_time_scene(Scene.load(name).with_settings(**GRID), rounds))
        yield Figure(f"map of {name}", "ms", _ms(times[-1].map))
        yield Figure("  built once for its arm and obstacles", "ms", _ms(times[-1].build))
        for other, ratios in times[-1].others.items():
            yield Figure(f"  {other}, from a random sample of its cells", "×", tuple(ratios))
    for other in SECONDS:
        medians = [float(np.median(scene.others[other])) for scene in times if other in scene.others]
        if medians:
            yield Figure(f"maps of all shipped scenes: {other} takes", "×", tuple(medians))
        else:
            yield Figure(WITHOUT_COAL, "", ())


def _time_scene(scene: Scene, rounds: int) -> _SceneTimes:
    task = scene.task()
    arm = scene.arm(task.arms[0])
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(arm.name, task)  # compiles what is not compiled yet
        build = [_time(lambda: ExactEngine(world, arm, scene.manifold)) for _ in range(3)]
        tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, task.T_world_object)
        world.margin = scene.settings.margin
        methods = dict(_slow_methods(world, scene))
        cells = [Cell(*cell) for cell in np.argwhere(m.reason >= Reason.UNREACHABLE)]
        rng = np.random.default_rng(0)

        def sample(decide: Decide, count: int) -> float:
            """Return the time (s) for all cells, estimated from a sample."""
            picks = [cells[k] for k in rng.choice(len(cells), min(count, len(cells)), replace=False)]
            world.set_arms(())
            world.set_object(task.T_world_object)
            time = _time(lambda: [decide(tools[cell], float(m.opening[cell.row])) for cell in picks])
            return time / len(picks) * len(cells)

        counts = {
            name: max(1, round(SECONDS[name] * len(cells) / sample(decide, CALIBRATION)))
            for name, decide in methods.items()
        }
        times, others = [], {name: [] for name in methods}
        for _ in range(rounds):
            for name, decide in methods.items():
                slow = sample(decide, counts[name])
                quick = [_time(lambda: maker.map(arm.name, task)) for _ in range(3)]
                times += quick
                others[name].append(slow / float(np.median(quick)))
    return _SceneTimes(build, times, others)


def _slow_methods(world: BulletWorld, scene: Scene) -> Iterator[tuple[str, Decide]]:
    """Yield (name, function) of the slow methods to decide a cell of the first task."""
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
    """Time maps with more cells and more redundancy samples; the time for each should stay constant."""
    cells = {scale: {**GRID, "heights": 24 * scale, "angles": 48 * scale} for scale in (1, 2, 4)}
    samples = {count: {**GRID, "redundancy": count} for count in (16, 32, 64, 128)}
    for what, settings, most in (
        ("a cell, 16 times as many cells", cells, lambda s: s["heights"] * s["angles"]),
        ("a redundancy sample, 8 times as many samples", samples, lambda s: s["redundancy"]),
    ):
        small, large = settings[min(settings)], settings[max(settings)]
        with _MapTimer(small) as few, _MapTimer(large) as many:
            ratios = [many.time() / most(large) / (few.time() / most(small)) for _ in range(rounds)]
        yield Figure(f"time for {what}", "×", tuple(ratios))


def boxes(rounds: int) -> Iterator[Figure]:
    """Time a map among four boxes, and among the same in pieces and as fine meshes; the maps are equal."""
    content = yaml.safe_load((SCENES_DIR / "bottle_on_table.yaml").read_text())
    few = [
        {"name": "table", "box": [1.2, 1.2, 0.04], "pose": {"position": [0.4, 0, -0.02]}},
        {"name": "wall", "box": [0.04, 1.2, 0.8], "pose": {"position": [0.85, 0, 0.4]}},
        {"name": "side", "box": [0.6, 0.04, 0.5], "pose": {"position": [0.5, 0.3, 0.25]}},
        {"name": "shelf", "box": [0.3, 0.5, 0.04], "pose": {"position": [0.7, 0, 0.55]}},
    ]

    def among(obstacles: list[dict[str, Any]]) -> Scene:
        return Scene.from_content({**content, "obstacles": obstacles}).with_settings(**GRID)

    with TemporaryDirectory() as folder, _MapTimer(scene=among(few)) as quick:

        def against(obstacles: list[dict[str, Any]]) -> tuple[float, ...]:
            with _MapTimer(scene=among(obstacles)) as slow:
                assert np.array_equal(quick.map().feasible, slow.map().feasible)
                return tuple(slow.time() / quick.time() for _ in range(rounds))

        cut = [part for box in few for part in _cut(box)]
        yield Figure("the same boxes, 4 cut into 400", "×", against(cut))
        fine = [_fine_mesh(box, Path(folder)) for box in few]
        yield Figure(f"the same boxes as meshes of {4 * FINE:,} triangles", "×", against(fine))


def _fine_mesh(box: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a box as an obstacle that is a mesh of `FINE` triangles, and write its file."""
    mesh = trimesh.creation.box(box["box"])
    while len(mesh.faces) < FINE:
        mesh = mesh.subdivide()
    file = folder / f"{box['name']}.stl"
    mesh.export(file)
    return {"name": box["name"], "mesh": str(file), "pose": box["pose"]}


def _cut(box: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the parts of a box cut across its two longest sides."""
    size, middle = np.array(box["box"], dtype=float), np.array(box["pose"]["position"], dtype=float)
    first, second = np.sort(np.argsort(-size)[:2])
    part = size.copy()
    part[[first, second]] /= CUTS
    for i, j in np.ndindex(CUTS, CUTS):
        at = middle.copy()
        at[first] += (i + 0.5) * part[first] - 0.5 * size[first]
        at[second] += (j + 0.5) * part[second] - 0.5 * size[second]
        yield {"name": f"{box['name']}{i}_{j}", "box": part.tolist(), "pose": {"position": at.tolist()}}


def turning(rounds: int) -> Iterator[Figure]:
    """Time the shift of a map when the object is turned about its axis."""
    with _MapTimer(GRID) as quick:
        m = quick.map()
        angles = np.random.default_rng(0).uniform(-np.pi, np.pi, rounds)
        times = [1e6 * _time(lambda angle=angle: m.shift(angle)) for angle in angles]
    yield Figure("turning the object about its axis", "µs", tuple(times))


def process(runs: int) -> Iterator[Figure]:
    """Time ``symgrasp map`` as a process, and its memory, with the compiled code cached."""
    command = [sys.executable, "-m", "symgrasp", "map", "bottle_on_table"]
    subprocess.run(command, check=True, capture_output=True)
    outputs = [
        subprocess.run(
            [sys.executable, "-c", MEASURE_PROCESS, *command], check=True, capture_output=True, text=True
        ).stdout
        for _ in range(runs)
    ]
    times, peaks = zip(*(map(float, line.split()) for line in outputs), strict=True)
    yield Figure("symgrasp map bottle_on_table, whole process", "s", times)
    yield Figure("  memory at most", "MB", peaks)


class _MapTimer:
    """Computes and times maps of a scene's first task by the engine; used in a ``with`` block."""

    def __init__(self, settings: dict[str, int] | None = None, scene: Scene | None = None) -> None:
        self._scene = scene or Scene.load("bottle_on_table").with_settings(**(settings or GRID))

    def __enter__(self) -> _MapTimer:
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
