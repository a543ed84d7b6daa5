"""How many feasible cells maps miss: with redundancy samples, and where all of the redundancy is searched.

The truth is a map at 2,048 uniform samples, or half or a quarter where a map may not have so many candidates.
Pinocchio and Coal tell of some of the cells that are called infeasible whether one of those samples is free,
in the scene without its margin and retreat, which are not theirs to know.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from scipy.spatial.transform import Rotation

from symgrasp.bench.maps.random_scenes import KINDS, random_scene, scene_of_kind
from symgrasp.engine.checks import HIT_BAND
from symgrasp.errors import SceneError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.scene.format import AUTO_SAMPLES, MOST_SAMPLES
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import missing_extra, shipped_scenes
from symgrasp.world import open_world

__all__ = ["Guarantee", "run", "summary"]

RANDOM_GRID = {"heights": 8, "angles": 16}
"""Grid of random scenes."""

SHIFT, TURN = 0.1, 0.4
"""Standard deviation of those places (m), and of the turn of the object about each axis (rad), every other
time."""

REFUTED = 3
"""Cells of each map that Pinocchio and Coal try to refute."""


@dataclass(frozen=True)
class Guarantee:
    """What maps of one arm and task miss.

    Attributes:
        scene: name of the scene.
        task: name of the task.
        arm: name of the arm.
        samples: number of uniform samples of the truth.
        feasible: number of cells that some of those shows feasible.
        missed_sampled: number of those that a map at 32 samples calls infeasible.
        missed: number of those that the map calls infeasible for which all of the redundancy was searched.
        found: number of cells that it shows feasible, and those samples do not.
        infeasible: number of cells that it calls infeasible.
        proven: number of those that are proven to be.
        resolution: see `FeasibilityMap`.
        missed_proven: number of cells that it says to be proven infeasible, and some of those samples shows
            feasible: each is a fault.
        refuted: number of cells that it calls infeasible, but not proven, and Pinocchio and Coal find free
            at a sample.
        tried: number of cells for which those were asked; 0 where they are not installed, of arms on a torso
            and of robots that may fall.
        refuted_proven: the same of cells that it says to be proven infeasible: each is a fault.
        tried_proven: number of those for which those were asked.
        ratio: processor time of the map, divided by that of one at 32 samples.
        random: whether the scene is drawn at random, or the object at a random place of a shipped scene.
    """

    scene: str
    task: str
    arm: str
    samples: int
    feasible: int
    missed_sampled: int
    missed: int
    found: int
    infeasible: int
    proven: int
    resolution: float
    missed_proven: int
    refuted: int
    tried: int
    refuted_proven: int
    tried_proven: int
    ratio: float
    random: bool = False

    def line(self) -> str:
        """Return the figures as one line of text."""
        share = 100 * self.proven / max(1, self.infeasible)
        return (
            f"{self.scene}, {self.task} with {self.arm}: of {self.feasible} cells "
            f"feasible at {self.samples} samples "
            f"{self.missed_sampled} missed by {AUTO_SAMPLES} samples, {self.missed} by auto, which finds "
            f"{self.found} more; {share:.0f} % of {self.infeasible} proven, others to "
            f"{self.resolution:.0e} rad; refuted {self.refuted} of {self.tried} of these, and of the proven "
            f"{self.refuted_proven} of {self.tried_proven}, {self.missed_proven} by samples; "
            f"time × {self.ratio:.2f}"
        )


def run(random: int) -> Iterator[Guarantee]:
    """Measure the shipped scenes at their own grids, then random scenes.

    Args:
        random: number of random scenes, of which one arm is measured: objects at random places of shipped
            scenes in turns with scenes of each kind of `symgrasp.bench.maps.random_scenes`.
    """
    scenes = [Scene.load(name) for name, path in shipped_scenes().items() if missing_extra(path) is None]
    arms = [(scene, task, name) for scene in scenes for task, name in _arms(scene)]
    for scene, task, name in arms:
        yield _measured(scene, task, name)
    with TemporaryDirectory() as folder:
        for scene, task, name in _random(random, arms, Path(folder)):
            found = _measured(scene.with_settings(**RANDOM_GRID), task, name)
            yield replace(found, random=True)


def summary(rows: Sequence[Guarantee]) -> Iterator[str]:
    """Yield what all rows say together, as a line of text for shipped scenes and one for random ones."""
    for random, where in ((False, "shipped scenes"), (True, "random scenes")):
        own = [row for row in rows if row.random == random]
        if not own:
            continue
        feasible, infeasible = sum(r.feasible for r in own), sum(r.infeasible for r in own)
        missed = 100 * sum(r.missed_sampled for r in own) / max(1, feasible)
        most = 100 * max(r.missed_sampled / max(1, r.feasible) for r in own)
        proven = 100 * sum(r.proven for r in own) / max(1, infeasible)
        yield (
            f"{where}, {len(own)} maps with {feasible} feasible cells: {AUTO_SAMPLES} samples miss "
            f"{missed:.1f} % of them, of one map up to {most:.1f} %; auto misses "
            f"{sum(r.missed for r in own)}; {proven:.1f} % of {infeasible} infeasible ones proven; refuted "
            f"{sum(r.refuted for r in own)} of {sum(r.tried for r in own)} others, and of the proven "
            f"{sum(r.refuted_proven for r in own)} of {sum(r.tried_proven for r in own)}, "
            f"{sum(r.missed_proven for r in own)} by samples; "
            f"median time × {median(r.ratio for r in own):.2f}"
        )


def _random(
    count: int, arms: Sequence[tuple[Scene, Task, str]], folder: Path
) -> Iterator[tuple[Scene, Task, str]]:
    """Yield random scenes, each with a task and an arm; objects are moved in tasks of the given arms."""
    rng, kinds = np.random.default_rng(0), ["", "", *KINDS]
    for k in range(count):
        number, turn = divmod(k, len(kinds))
        if turn == 0:
            scene, task, name = arms[number % len(arms)]
            T = task.T_world_object.copy()
            T[:3, 3] += rng.normal(0.0, SHIFT, 3)
            if number % 2:
                T[:3, :3] = T[:3, :3] @ _turn(rng.normal(0.0, TURN, 3))
            yield scene, Task(f"random {k}", task.arms, T), name
        else:
            kind = kinds[turn]
            scene = Scene.from_content(scene_of_kind(kind, k, folder) if kind else random_scene(k))
            own = list(_arms(scene))
            yield scene, *own[k % len(own)]


def _arms(scene: Scene) -> Iterator[tuple[Task, str]]:
    """Yield every arm of seven joints with the first task that it has."""
    known: set[str] = set()
    for task in scene.tasks.values():
        for name in task.arms:
            arm = scene.arm(name)
            alone = arm if arm.robot.torso is None else arm.at(0)
            if name not in known and not arm.pitched and len(alone.joint_names) == 7:
                known.add(name)
                yield task, name


def _measured(scene: Scene, task: Task, name: str) -> Guarantee:
    """Measure the maps of a task with an arm."""
    sampled, before = _timed(scene.with_settings(redundancy=AUTO_SAMPLES), task, name)
    searched, after = _timed(scene.with_settings(redundancy="auto"), task, name)
    truth, samples = _truth(scene, task, name)
    missed = truth & ~searched.feasible
    plain = scene.with_settings(redundancy="auto", margin=0.0, approach=0.0)
    without = searched
    if scene.settings.margin or scene.settings.approach:
        with open_world(plain) as world:
            without = MapMaker(world).map(name, task)
    refuted = _refuted(plain, task, name, without)
    return Guarantee(
        scene.name, task.name, name, samples, int(truth.sum()), int((truth & ~sampled.feasible).sum()),
        int(missed.sum()), int((searched.feasible & ~truth).sum()), int((~searched.feasible).sum()),
        int(searched.proven.sum()), searched.resolution, int((truth & searched.proven).sum()), *refuted,
        after / before,
    )  # fmt: skip


def _timed(scene: Scene, task: Task, name: str) -> tuple[FeasibilityMap, float]:
    """Return a map, and the processor time (s) of the second time that it is computed in its world."""
    with open_world(scene) as world:
        maker = MapMaker(world)
        maker.map(name, task)
        start = process_time()
        return maker.map(name, task), process_time() - start


def _truth(scene: Scene, task: Task, name: str) -> tuple[np.ndarray, int]:
    """Return which cells some of many samples shows feasible, and how many samples a map may have."""
    samples = MOST_SAMPLES
    while True:
        try:
            dense = scene.with_settings(redundancy=samples)
        except SceneError:  # so many candidates are more than a map may have
            samples //= 2
            continue
        with open_world(dense) as world:
            return MapMaker(world).map(name, task).feasible, samples


def _refuted(scene: Scene, task: Task, name: str, m: FeasibilityMap) -> tuple[int, int, int, int]:
    """Return how many infeasible cells Pinocchio and Coal find free at a sample, and how many they tried.

    Args:
        scene: without margin and retreat.
        task: the task.
        name: the arm.
        m: its map.

    Returns:
        Both for cells that are not proven infeasible, then for those that are, where the hand fits.
    """
    try:
        from symgrasp.bench.maps.brute import BruteForce
    except ImportError:
        return 0, 0, 0, 0
    arm = scene.arm(name)
    if arm.robot.torso is not None or arm.robot.support is not None:
        return 0, 0, 0, 0
    rng = np.random.default_rng(0)
    fits = ~m.feasible & (m.reason != Reason.HAND_TOO_SMALL) & (m.reason != Reason.SURFACE_TOO_STEEP)
    tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, task.T_world_object)
    counts: list[int] = []
    with open_world(scene) as world:
        brute = BruteForce(world, arm, solver_for(arm, MOST_SAMPLES), task.T_world_object)
        brute.keep(HIT_BAND)  # PyBullet, which decides what all but touches, is off by that
        for which in (fits & (m.reason > Reason.UNREACHABLE) & ~m.proven, fits & m.proven):
            cells = [Cell(*index) for index in rng.permutation(np.argwhere(which))[:REFUTED].tolist()]
            counts.append(sum(brute.feasible(tools[c], float(m.opening[c.row])) for c in cells))
            counts.append(len(cells))
    return counts[0], counts[1], counts[2], counts[3]


def _turn(vector: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) about a vector (3,) by its length (rad)."""
    return Rotation.from_rotvec(vector).as_matrix()
