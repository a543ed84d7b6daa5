"""Grasps of an object whose pose is uncertain: how probable it is that they are feasible.

The pose is drawn many times, and a map computed for each: the probability of a cell is the share of the maps
in which it is feasible. All arms get the same draws (common random numbers), and all tasks where they are off
alike, so that what differs between two grasps is the grasps, not the draws. What is drawn is where the object
turns out to stand; the arm knows that when it moves, but the grasp on the object is chosen before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from symgrasp.errors import InputError, NoPlanError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import plan_sequential, tasks_of_plan
from symgrasp.poses import Array, from_rotation
from symgrasp.progress import Progress, part_of
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

MOST_CELLS = 1_000_000_000
"""Most cells of the maps of all draws together, each a byte."""

__all__ = ["PoseNoise", "ProbablePlan", "SuccessMap", "best_columns", "plan_for_success", "success_map"]


@dataclass(frozen=True)
class PoseNoise:
    """How the pose of an object is uncertain, in every direction alike.

    Attributes:
        position: standard deviation (m) of each coordinate, or the most that it is off if uniform.
        tilt: the same of the rotations (rad) about the world's x and y; about the object's own axis it is a
            shift.
        kind: the distribution.
        shared: whether all tasks are off alike, as by an error of calibration; else each on its own.
    """

    position: float
    tilt: float = 0.0
    kind: Literal["normal", "uniform"] = "normal"
    shared: bool = False

    def draws(self, count: int, seed: int) -> Array:
        """Return draws (count, 5): x, y, z (m) and rotations (rad) about the world's x and y."""
        rng = np.random.default_rng(seed)
        unit = rng.standard_normal if self.kind == "normal" else lambda size: rng.uniform(-1.0, 1.0, size)
        return unit((count, 5)) * ([self.position] * 3 + [self.tilt] * 2)


def moved(T_world_object: Array, draw: Array) -> Array:
    """Return the pose (4, 4) of an object that is off by a draw (5,)."""
    rotation = Rotation.from_rotvec([draw[3], draw[4], 0.0]).as_matrix() @ T_world_object[:3, :3]
    return from_rotation(rotation, T_world_object[:3, 3] + draw[:3])


@dataclass(frozen=True, eq=False)
class SuccessMap:
    """How probable it is that the cells of a map are feasible.

    Attributes:
        nominal: the map of the pose that is expected.
        feasible: (K, R, H, A) which cells are feasible at each draw.
    """

    nominal: FeasibilityMap
    feasible: np.ndarray

    @property
    def probability(self) -> Array:
        """(R, H, A) share of the draws at which each cell is feasible."""
        return self.feasible.mean(axis=0)

    @property
    def standard_error(self) -> Array:
        """(R, H, A) standard error of `probability`, from the number of draws."""
        p = self.probability
        return np.sqrt(p * (1.0 - p) / len(self.feasible))


def success_map(
    maker: MapMaker,
    arm: str,
    task: Task,
    noise: PoseNoise,
    count: int = 100,
    seed: int = 0,
    progress: Progress | None = None,
) -> SuccessMap:
    """Compute how probable it is that the grasps of a task are feasible.

    Args:
        maker: computes the maps.
        arm: name of the arm.
        task: the task.
        noise: how the object's pose is uncertain.
        count: number of draws.
        seed: of the draws; equal seeds give equal draws, whatever the task.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        InputError: the maps of so many draws are too large.
    """
    nominal = maker.map(arm, task)
    most = MOST_CELLS // nominal.feasible.size
    if count > most:
        raise InputError(
            "success", "draws", count, f"at most {most:,} for maps of {nominal.feasible.size:,} cells"
        )
    found = []
    for k, draw in enumerate(noise.draws(count, seed)):
        own = Task(task.name, task.arms, moved(task.T_world_object, draw), task.supported)
        found.append(maker.map(arm, own, progress=part_of(progress, k, count)).feasible)
    return SuccessMap(nominal, np.array(found))


@dataclass(frozen=True, eq=False)
class ProbablePlan:
    """A plan, and how probable it is that all its grasps are feasible.

    Attributes:
        plan: the plan, for the poses that are expected.
        probability: share of the draws at which every task is feasible with its grasp and turn.
        standard_error: of the probability.
    """

    plan: Plan
    probability: float
    standard_error: float


def plan_for_success(
    scene: Scene,
    noise: PoseNoise,
    arm: str | None = None,
    count: int = 100,
    seed: int = 0,
    progress: Progress | None = None,
) -> ProbablePlan:
    """Find the grasp for all tasks of an arm, and the turns, that are feasible with the largest probability.

    Of all grasps and turns that are feasible at the expected poses, none is more probable, given the draws.

    Args:
        scene: the scene.
        noise: how the object's pose is uncertain.
        arm: the arm; the first task's if None.
        count: number of draws.
        seed: of the draws.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        NoPlanError: no grasp serves all tasks.
        SceneError: no task is done by that arm alone.
    """
    name = scene.arm(arm or scene.task().arms[0]).name
    tasks = tasks_of_plan(scene, "sequential", name)
    with open_world(scene) as world:
        maker = MapMaker(world)
        maps = [
            success_map(maker, name, task, noise, count, seed + (0 if noise.shared else k),
                        part_of(progress, k, len(tasks)))
            for k, task in enumerate(tasks)
        ]  # fmt: skip
    best: tuple[float, int, int, list[int]] = (0.0, 0, 0, [])
    rolls, heights, _ = maps[0].nominal.feasible.shape
    for roll in range(rolls):
        for row in range(heights):
            lines = [(m.nominal.feasible[roll, row], m.feasible[:, roll, row]) for m in maps]
            found = best_columns(lines, shared=noise.shared)
            if found and found[0] > best[0]:
                best = (found[0], roll, row, found[1])
    probability, roll, row, columns = best
    if not columns:
        raise NoPlanError(f"no grasp of {name} serves all tasks")
    masked = {}
    for m, task, column in zip(maps, tasks, columns, strict=True):
        keep = np.zeros(m.nominal.feasible.shape, dtype=bool)
        keep[roll, row, column] = True
        masked[task.name, name] = m.nominal.masked(keep)
    plan = plan_sequential(scene, name, masked)
    return ProbablePlan(plan, probability, float(np.sqrt(probability * (1 - probability) / count)))


def best_columns(
    lines: list[tuple[np.ndarray, np.ndarray]], *, shared: bool
) -> tuple[float, list[int]] | None:
    """Return the largest probability that all tasks are feasible at a height and roll, and the columns.

    With draws of their own the tasks do not depend on each other, and each takes its best column. With shared
    draws it is searched, and what cannot be better is passed by.

    Args:
        lines: for every task which columns (A,) are feasible at the expected pose, and at each draw (K, A).
        shared: whether the draws of all tasks are the same.

    Returns:
        None where some task has no feasible column.
    """
    if not all(nominal.any() for nominal, _ in lines):
        return None
    if not shared:
        shares = [np.where(nominal, draws.mean(axis=0), -1.0) for nominal, draws in lines]
        return float(np.prod([share.max() for share in shares])), [int(s.argmax()) for s in shares]
    options = [_undominated(nominal, draws) for nominal, draws in lines]
    rest = [np.ones(len(lines[0][1]), dtype=bool)]
    for own in reversed(options):  # what the tasks from there on can reach at most
        rest.insert(0, rest[0] & np.any([draws for _, draws in own], axis=0))
    best: tuple[int, list[int]] = (-1, [])

    def search(k: int, reached: np.ndarray, columns: list[int]) -> None:
        nonlocal best
        if int((reached & rest[k]).sum()) <= best[0]:
            return
        if k == len(options):
            best = (int(reached.sum()), columns)
            return
        for column, draws in sorted(options[k], key=lambda o: -int((reached & o[1]).sum())):
            search(k + 1, reached & draws, [*columns, column])

    search(0, np.ones(len(lines[0][1]), dtype=bool), [])
    return best[0] / len(lines[0][1]), best[1]


def _undominated(nominal: np.ndarray, draws: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Return the columns, with their draws (K,), that no other serves wherever they serve."""
    kept: list[tuple[int, np.ndarray]] = []
    for column in sorted(np.flatnonzero(nominal).tolist(), key=lambda c: -int(draws[:, c].sum())):
        own = draws[:, column]
        if not any((other >= own).all() for _, other in kept):
            kept.append((column, own))
    return kept
