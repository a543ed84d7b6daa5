"""Times of the exact engine's maps: against Algorithm 1 and brute force, and growing with the problem."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import trimesh
import yaml

from symgrasp.bench.figures import Figure
from symgrasp.bench.timing import Time, ratios, time_of, times
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.creation.algorithm1 import furthest
from symgrasp.feasibility.exact.engine import ExactEngine
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.files import SCENES_DIR
from symgrasp.ik import solver_for
from symgrasp.poses import Array, inverse
from symgrasp.reason import Reason
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import extra_of, missing_extra, shipped_scenes
from symgrasp.world import BulletWorld, open_world

__all__ = ["against_others", "approach", "boxes", "every_arm", "growth", "run", "turning"]

GRID = {"heights": 48, "angles": 96, "redundancy": 32}
"""The resolution that the figures are for; with two rolls, 9216 cells."""

ROUNDS = 3
"""Number of rounds; each times everything that a ratio compares, one right after the other."""

SECONDS = {"reference": 0.5, "Pinocchio and Coal": 0.3}
"""About how long (s) each of the slow methods is timed in a round."""

CALIBRATION = 30
"""Number of cells that are timed to find out how many take that long."""

FINE = 12288
"""Number of triangles of a fine mesh: those of a box, each cut into four, five times over."""

CUTS = 10
"""Number of parts that a box is cut into along each of two sides, to make a hundred of one."""

WITHOUT_COAL = "maps against Pinocchio and Coal: not measured, needs pip install 'symgrasp[bench]'"


def run() -> Iterator[Figure]:
    """Run the benchmarks of maps and yield their figures as they are measured."""
    shipped = shipped_scenes()
    yield from against_others([name for name, path in shipped.items() if extra_of(path) is None], ROUNDS)
    here = [name for name, path in shipped.items() if missing_extra(path) is None]
    yield from every_arm(here, ROUNDS)
    for name in sorted(set(shipped) - set(here)):
        yield Figure(f"arms of {name}: not measured, needs pip install 'symgrasp[robots]'", "", ())
    yield from approach(ROUNDS)
    yield from growth(ROUNDS)
    yield from boxes(ROUNDS)
    yield from turning(20 * ROUNDS)


class _SceneTimes(NamedTuple):
    """Times of one scene.

    Attributes:
        build: to build the engine, one time a run.
        map: to compute a map, one time a run.
        others: slow method → its time and that of a map, once a round.
    """

    build: list[Time]
    map: list[Time]
    others: dict[str, list[tuple[Time, Time]]]


Decide = Callable[[Array, float], Any]
"""Decides whether a cell is feasible, given its tool pose (4, 4) in the base and the hand's opening (m)."""


def against_others(scenes: Sequence[str], rounds: int) -> Iterator[Figure]:
    """Time the map of the first task of each scene by the engine and by the slow methods.

    The slow methods decide a random sample of the cells that fit the hand; their time is scaled to all of
    these.
    """
    medians: dict[str, list[float]] = {other: [] for other in SECONDS}
    for name in scenes:
        scene = _time_scene(Scene.load(name).with_settings(**GRID), rounds)
        yield times(f"map of {name}", "ms", scene.map)
        yield times("  built once for its arm and obstacles", "ms", scene.build)
        for other, pairs in scene.others.items():
            figure = ratios(f"  {other}, from a random sample of its cells", pairs)
            medians[other].append(float(np.median(figure.values)))
            yield figure
    for other, values in medians.items():
        if values:
            yield Figure(f"maps of all shipped scenes: {other} takes", "×", tuple(values))
        else:
            yield Figure(WITHOUT_COAL, "", ())


def _time_scene(scene: Scene, rounds: int) -> _SceneTimes:
    task = scene.task()
    arm = scene.arm(task.arms[0])
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(arm.name, task)  # compiles what is not compiled yet
        build = [time_of(lambda: ExactEngine(world, arm, scene.manifold)) for _ in range(3)]
        tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, task.T_world_object)
        world.margin = scene.settings.margin
        methods = dict(_slow_methods(world, scene))
        cells = [Cell(*cell) for cell in np.argwhere(m.reason >= Reason.UNREACHABLE)]
        rng = np.random.default_rng(0)

        def sample(decide: Decide, count: int) -> Time:
            """Return the time for all cells, estimated from a sample."""
            picks = [cells[k] for k in rng.choice(len(cells), min(count, len(cells)), replace=False)]
            world.set_arms(())
            world.set_object(task.T_world_object)
            time = time_of(lambda: [decide(tools[cell], float(m.opening[cell.row])) for cell in picks])
            share = len(picks) / len(cells)
            return Time(time.wall / share, time.cpu / share)

        counts = {
            name: max(1, round(SECONDS[name] * len(cells) / sample(decide, CALIBRATION).cpu))
            for name, decide in methods.items()
        }
        quick, others = [], {name: [] for name in methods}
        for _ in range(rounds):
            for name, decide in methods.items():
                slow = sample(decide, counts[name])
                quick += [time_of(lambda: maker.map(arm.name, task)) for _ in range(3)]
                others[name].append((slow, Time(*np.median(quick[-3:], axis=0).tolist())))
    return _SceneTimes(build, quick, others)


def _slow_methods(world: BulletWorld, scene: Scene) -> Iterator[tuple[str, Decide]]:
    """Yield (name, function) of the slow methods to decide a cell of the first task."""
    task = scene.task()
    arm = scene.arm(task.arms[0])
    ik = solver_for(arm, scene.settings.samples)
    checker = CandidateChecker(world, arm, ik, scene.settings.approach)
    yield "reference", lambda T, opening: furthest(checker.candidates(T, opening))
    if has_coal() and scene.settings.approach == scene.settings.margin == 0:
        from symgrasp.bench.maps.brute import BruteForce

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
            share = most(small) / most(large)
            found = ratios("", [(many.time(), few.time()) for _ in range(rounds)]).values
        yield Figure(f"time for {what}", "×", tuple(share * ratio for ratio in found))


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

        def against(name: str, obstacles: list[dict[str, Any]]) -> Figure:
            with _MapTimer(scene=among(obstacles)) as slow:
                assert np.array_equal(quick.map().feasible, slow.map().feasible)
                return ratios(name, [(slow.time(), quick.time()) for _ in range(rounds)])

        yield against("the same boxes, 4 cut into 400", [part for box in few for part in _cut(box)])
        fine = [_fine_mesh(box, Path(folder)) for box in few]
        yield against(f"the same boxes as meshes of {4 * FINE:,} triangles", fine)


def every_arm(scenes: Sequence[str], rounds: int) -> Iterator[Figure]:
    """Time a map of every arm of each scene, and in scenes with several, of each against the quickest."""
    for name in scenes:
        scene = Scene.load(name).with_settings(**GRID)
        tasks: dict[str, Task] = {}
        for task in scene.tasks.values():
            for arm in task.arms:
                tasks.setdefault(arm, task)
        medians: list[float] = []
        with open_world(scene) as world:
            maker = MapMaker(world)
            for arm, task in tasks.items():
                compute = partial(maker.map, arm, task)
                compute()  # builds its engine, and compiles what is not compiled yet
                figure = times(f"every arm: {name}, {arm}", "ms", [time_of(compute) for _ in range(rounds)])
                medians.append(float(np.median(figure.cpu)))
                yield figure
        if len(medians) > 1:
            against = tuple(value / min(medians) for value in medians)
            yield Figure(f"arms of {name}, against the quickest", "×", against)


def approach(rounds: int) -> Iterator[Figure]:
    """Time maps whose grasps are approached along a straight line, against the same without."""
    with _MapTimer(GRID) as quick:
        for length in (0.05, 0.1):
            scene = Scene.load("bottle_on_table").with_settings(**GRID, approach=length)
            with _MapTimer(scene=scene) as slow:
                found = [(slow.time(), quick.time()) for _ in range(rounds)]
            yield ratios(f"the same map with an approach of {length:g} m", found)


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
        found = [time_of(lambda angle=angle: m.shift(angle)) for angle in angles]
    yield times("turning the object about its axis", "µs", found)


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

    def time(self) -> Time:
        """Return the median time of three maps."""
        return time_of(self.map, runs=3)
