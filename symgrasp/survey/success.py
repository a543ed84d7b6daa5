"""Grasps of an object whose pose is uncertain: how probable it is that they are feasible.

The pose is drawn many times, and a map computed for each: the probability of a cell is the share of the maps
in which it is feasible. All arms get the same draws (common random numbers), and all tasks where they are off
alike, so that what differs between two grasps is the grasps, not the draws. What is drawn is where the object
turns out to stand; the arm knows that when it moves, but the grasp on the object is chosen before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import betaincinv

from symgrasp.errors import InputError, NoPlanError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import plan_sequential, tasks_of_plan
from symgrasp.planners.sequential import surface_margin
from symgrasp.poses import Array, from_rotation
from symgrasp.progress import Progress, between, part_of
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

MOST_CELLS = 1_000_000_000
"""Most cells of the maps of all draws together, each a byte."""

__all__ = [
    "CONFIDENCE", "Line", "PoseNoise", "ProbablePlan", "SuccessMap", "best_columns", "interval",
    "plan_for_success", "success_map",
]  # fmt: skip

CONFIDENCE = 0.95
"""Of the intervals of probabilities."""


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
    known: list[np.ndarray] | None = None,
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
        known: (R, H, A) which cells are feasible at the first draws, from a call with the same arguments that
            was cancelled; those that are computed are added.

    Raises:
        InputError: the maps of so many draws are too large.
    """
    found = [] if known is None else known
    done = len(found) / max(1, count)
    nominal = maker.map(arm, task, progress=between(progress, done, done))
    most = MOST_CELLS // nominal.feasible.size
    if count > most:
        raise InputError(
            "success", "draws", count, f"at most {most:,} for maps of {nominal.feasible.size:,} cells"
        )
    for k, draw in enumerate(noise.draws(count, seed)):
        if k < len(found):
            continue
        own = Task(task.name, task.arms, moved(task.T_world_object, draw), task.supported)
        found.append(maker.map(arm, own, progress=part_of(progress, k, count)).feasible)
    return SuccessMap(nominal, np.array(found))


@dataclass(frozen=True, eq=False)
class ProbablePlan:
    """A plan, and how probable it is that all its grasps are feasible.

    Attributes:
        plan: the plan, for the poses that are expected.
        probability: share of the draws at which every task is feasible with its grasp and turn; of draws of
            their own, the product of the tasks' shares.
        interval: of the probability, which covers it at a confidence of at least `CONFIDENCE`; as for a grasp
            that was not chosen by these draws.
    """

    plan: Plan
    probability: float
    interval: tuple[float, float]


def plan_for_success(
    scene: Scene,
    noise: PoseNoise,
    arm: str | None = None,
    count: int = 100,
    seed: int = 0,
    progress: Progress | None = None,
) -> ProbablePlan:
    """Find the grasp for all tasks of an arm, and the turns, that are feasible with the largest probability.

    Of all grasps and turns that are feasible at the expected poses, none is more probable, given the draws;
    and of those that are as probable, none has a larger margin.

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
        InputError: the maps of so many draws are too large.
    """
    name = scene.arm(arm or scene.task().arms[0]).name
    tasks = tasks_of_plan(scene, "sequential", name)
    with open_world(scene, progress) as world:
        maker = MapMaker(world)
        maps = [
            success_map(maker, name, task, noise, count, seed + (0 if noise.shared else k),
                        part_of(progress, k, len(tasks)))
            for k, task in enumerate(tasks)
        ]  # fmt: skip
    margins = [surface_margin(m.nominal) for m in maps]
    best: tuple[Columns, int, int] | None = None
    rolls, heights, _ = maps[0].nominal.feasible.shape
    for roll in range(rolls):
        for row in range(heights):
            lines = [
                Line(m.nominal.feasible[roll, row], m.feasible[:, roll, row], margin[roll, row])
                for m, margin in zip(maps, margins, strict=True)
            ]
            found = best_columns(lines, shared=noise.shared)
            if found and (best is None or found.rank > best[0].rank):
                best = found, roll, row
    if best is None:
        raise NoPlanError(f"no grasp of {name} serves all tasks")
    chosen, roll, row = best
    masked = {}
    for m, task, column in zip(maps, tasks, chosen.columns, strict=True):
        keep = np.zeros(m.nominal.feasible.shape, dtype=bool)
        keep[roll, row, column] = True
        masked[task.name, name] = m.nominal.masked(keep)
    plan = _with_margins(plan_sequential(scene, name, masked), [m.nominal for m in maps], roll, row, chosen)
    return ProbablePlan(plan, chosen.probability, interval(chosen.counts, count))


def _with_margins(plan: Plan, maps: Sequence[FeasibilityMap], roll: int, row: int, chosen: Columns) -> Plan:
    """Return a plan with the margins of whole maps, not of those of which one cell was kept."""
    tasks = []
    for task, m, column in zip(plan.tasks, maps, chosen.columns, strict=True):
        (hold,) = task.holds
        along, around = m.margins[roll, row, column].tolist()
        own = hold.model_copy(update={"margin_along": along, "margin_around": around})
        tasks.append(task.model_copy(update={"holds": (own,)}))
    return plan.model_copy(update={"tasks": tuple(tasks)})


class Line(NamedTuple):
    """The cells of a task at a height and roll.

    Attributes:
        nominal: (A,) which columns are feasible at the expected pose.
        draws: (K, A) which are feasible at each draw.
        margin: (A,) margin (m) of each at the expected pose.
    """

    nominal: np.ndarray
    draws: np.ndarray
    margin: Array


class Columns(NamedTuple):
    """A column for each task.

    Attributes:
        probability: that all are feasible.
        margin: the smallest margin (m) of any of them, see `surface_margin`.
        columns: the columns.
        counts: at how many draws all tasks are feasible; of draws of their own, a number for each task.
    """

    probability: float
    margin: float
    columns: tuple[int, ...]
    counts: tuple[int, ...]

    @property
    def rank(self) -> tuple[float, float]:
        """What is larger of better columns."""
        return self.probability, self.margin


def interval(counts: Sequence[int], draws: int) -> tuple[float, float]:
    """Return an interval of a probability that is the product of those that successes were counted of.

    Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
    Biometrika 26, 1934: exact, however few the draws are, and wide rather than wrong. Of several factors each
    gets its part of what may be missed (Bonferroni).

    Args:
        counts: number of successes of each factor.
        draws: of how many.
    """
    missed = (1 - CONFIDENCE) / len(counts) / 2
    low = [betaincinv(k, draws - k + 1, missed) if k else 0.0 for k in counts]
    high = [betaincinv(k + 1, draws - k, 1 - missed) if k < draws else 1.0 for k in counts]
    return float(np.prod(low)), float(np.prod(high))


def best_columns(lines: Sequence[Line], *, shared: bool) -> Columns | None:
    """Return the most probable columns at a height and roll; of equal ones, those of most margin.

    With draws of their own the tasks do not depend on each other, and each takes its best column. With shared
    draws it is searched, and what cannot be better is passed by.

    Args:
        lines: of every task.
        shared: whether the draws of all tasks are the same.

    Returns:
        None where some task has no feasible column.
    """
    if not all(line.nominal.any() for line in lines):
        return None
    draws = len(lines[0].draws)
    if not shared:
        columns, counts = [], []
        for line in lines:
            counted = line.draws.sum(axis=0)
            at = np.flatnonzero(line.nominal).tolist()
            columns.append(max(at, key=lambda c: (counted[c], line.margin[c])))
            counts.append(int(counted[columns[-1]]))
        margin = min(float(line.margin[c]) for line, c in zip(lines, columns, strict=True))
        return Columns(float(np.prod([k / draws for k in counts])), margin, tuple(columns), tuple(counts))
    options = [_undominated(line) for line in lines]
    rest = [(np.ones(draws, dtype=bool), np.inf)]
    for own in reversed(options):  # what the tasks from there on can reach at most
        reached, margin = rest[0]
        some = reached & np.any([option.draws for option in own], axis=0)
        rest.insert(0, (some, min(margin, max(option.margin for option in own))))
    best: tuple[tuple[int, float], tuple[int, ...]] = ((-1, 0.0), ())

    def search(k: int, reached: np.ndarray, margin: float, columns: tuple[int, ...]) -> None:
        nonlocal best
        most = int((reached & rest[k][0]).sum()), min(margin, rest[k][1])
        if most <= best[0]:
            return
        if k == len(options):
            best = most, columns
            return
        for own in sorted(options[k], key=lambda o: (-int((reached & o.draws).sum()), -o.margin)):
            search(k + 1, reached & own.draws, min(margin, own.margin), (*columns, own.column))

    search(0, np.ones(draws, dtype=bool), np.inf, ())
    (count, margin), columns = best
    return Columns(count / draws, margin, columns, (count,))


class _Option(NamedTuple):
    """A column, at which draws (K,) it is feasible, and its margin (m)."""

    column: int
    draws: np.ndarray
    margin: float


def _undominated(line: Line) -> list[_Option]:
    """Return the columns of which no other serves wherever they serve, with as much margin."""
    own = [_Option(c, line.draws[:, c], float(line.margin[c])) for c in np.flatnonzero(line.nominal).tolist()]
    kept: list[_Option] = []
    for option in sorted(own, key=lambda o: (-int(o.draws.sum()), -o.margin)):
        if not any((k.draws >= option.draws).all() and k.margin >= option.margin for k in kept):
            kept.append(option)
    return kept
