"""Where a robot should stand: bases from which a scene's tasks can be done, the one with most margin first.

Bases over a region are surveyed, the best of them are refined in steps that halve, and what is proposed in
the end has a plan that was made and verified on its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from symgrasp.errors import InputError, NoPlanError, SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.poses import Array, rotation_z
from symgrasp.scene.format import MapSettings
from symgrasp.scene.replacing import with_base
from symgrasp.scene.scene import Scene
from symgrasp.survey.evaluation import plan_margin, planned
from symgrasp.survey.format import MOST_VALUES, KeepOut, NumberAxis, PlanKind, SurveyFile
from symgrasp.survey.regions import length_of_arm
from symgrasp.survey.survey import Survey
from symgrasp.world import open_world

__all__ = ["Base", "Placement", "Proposal", "Region", "Surveyed", "kind_of_plan", "place_base", "reach_of"]

SEEDS, ROUNDS = 3, 2
"""How many of the best bases are refined, and how often the step is halved."""

MOST_BASES = 1_000_000
"""Most bases that are surveyed at first."""

TURN = 90.0
"""Step (°) of the turn about the vertical at first."""

FULL_TURN = (-180.0, 180.0)

Surveyed: TypeAlias = "Callable[[Survey], Array]"
"""Runs a survey; returns the margin (m) of the best plan at each of its points, NaN where none exists."""


class Base(NamedTuple):
    """Where a base stands: position (m) and turn about the vertical (°)."""

    x: float
    y: float
    z: float
    yaw_deg: float

    @staticmethod
    def of(T: Array) -> Base:
        """Return that of a pose (4, 4)."""
        return Base(*T[:3, 3].tolist(), yaw_deg=math.degrees(math.atan2(T[1, 0], T[0, 0])))

    def moved(self, T: Array) -> Array:
        """Return a pose (4, 4) with this position and turn in place of its own."""
        pose = rotation_z(math.radians(self.yaw_deg - Base.of(T).yaw_deg)) @ T
        pose[:3, 3] = self[:3]
        return pose

    def is_near(self, other: Base, step: float) -> bool:
        """Whether another base is closer than a step (m), whatever their turns."""
        return math.dist(self[:3], other[:3]) < step - 1e-9


@dataclass(frozen=True)
class Region:
    """Where a base may stand: intervals (m, °) of its coordinates, and the step (m) of the survey at first.

    Attributes:
        x: interval of x (m).
        y: interval of y (m).
        z: interval of the height (m).
        yaw_deg: interval of the turn about the vertical (°).
        step: distance (m) of the bases that are surveyed first, at most.
        keep_out: rectangles in which no base stands.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]
    yaw_deg: tuple[float, float] = FULL_TURN
    step: float = 0.2
    keep_out: tuple[KeepOut, ...] = ()


@dataclass(frozen=True, eq=False)
class Proposal:
    """A base that was checked.

    Attributes:
        base: where it is.
        margin: the smallest margin (m) of any hold of its plan.
        plan: the plan, which holds.
        scene: the scene with the robot there.
    """

    base: Base
    margin: float
    plan: Plan
    scene: Scene


@dataclass(frozen=True, eq=False)
class Placement:
    """What was found.

    Attributes:
        proposals: the best bases, none near another, by falling margin.
        margins: all bases that were looked at → the margin (m) of the best plan, NaN where none exists.
        keep_out: rectangles in which no base stands.
        refused: bases that would be among the best by the survey → why their plan does not hold.
    """

    proposals: tuple[Proposal, ...]
    margins: dict[Base, float]
    keep_out: tuple[KeepOut, ...]
    refused: dict[Base, str] = field(default_factory=dict)


def kind_of_plan(scene: Scene) -> PlanKind:
    """Return the kind of the plan that does all tasks of a scene."""
    sets = {task.arms for task in scene.tasks.values()}
    if sets == {next(iter(sets))} and len(next(iter(sets))) == 1:
        return "sequential"
    return "bimanual" if len(scene.tasks) == 1 else "handover"


def reach_of(scene: Scene, robot: str, step: float = 0.2) -> Region:
    """Return the region from which the first arm of a robot might reach the middle of all tasks.

    The square around it that the length of the arm gives, at the height where the robot stands.
    """
    arm = next(arm for arm in scene.arms.values() if arm.robot.name == robot)
    length = length_of_arm(scene, arm.name)
    middle = np.mean([task.T_world_object[:3, 3] for task in scene.tasks.values()], axis=0)
    side = step * math.floor(length / step)
    low, high = np.round(middle - side, 3).tolist(), np.round(middle + side, 3).tolist()
    z = float(scene.robots[robot].T_world_base[2, 3])
    return Region((low[0], high[0]), (low[1], high[1]), (z, z), step=step)


def place_base(
    scene: Scene,
    robot: str,
    region: Region,
    surveyed: Surveyed,
    *,
    most: int = 5,
    settings: MapSettings | None = None,
) -> Placement:
    """Find the bases of a robot from which all tasks of a scene can be done.

    Args:
        scene: the scene.
        robot: name of the robot that is moved.
        region: where it may stand.
        surveyed: runs the surveys, such as `symgrasp.survey.running.plan_margins_on` on a cluster.
        most: largest number of proposals.
        settings: of the maps of the surveys, the scene's if None; what is proposed is planned with the
            scene's.

    Raises:
        NoPlanError: none of the bases that were surveyed serves all tasks.
        InputError: the region has too many bases.
    """
    _check_size(robot, region)
    kind, margins = kind_of_plan(scene), dict[Base, float]()

    def survey(name: str, axes: Sequence[NumberAxis]) -> None:
        file = SurveyFile(
            schema_version=1,
            name=name,
            scene=scene.name,
            plan=kind,
            map=settings,
            keep_out=region.keep_out,
            axes=tuple(axes),
        )
        values = [axis.numbers() for axis in axes]
        found = surveyed(Survey.of(file, scene, scene.source))
        for where in np.ndindex(found.shape):
            margins[Base(*(own[k] for own, k in zip(values, where, strict=True)))] = float(found[where])

    survey("all", list(_axes(robot, region)))
    step, turn = region.step, TURN
    for number in range(ROUNDS):
        step, turn = step / 2, turn / 2
        for k, base in enumerate(_best(margins, SEEDS, region.step)):
            survey(f"refined_{number + 1}_{k + 1}", list(_around(robot, region, base, step, turn)))
    found, refused = list[Proposal](), dict[Base, str]()
    for base in _best(margins, len(margins), region.step):
        try:
            found.append(_checked(scene, robot, base, kind))
        except NoPlanError as error:
            refused[base] = str(error)
        if len(found) == most:
            break
    if not found:
        why = f"; the best by the survey: {next(iter(refused.values()))}" if refused else ""
        raise NoPlanError(f"none of {len(margins)} bases of {robot} serves all tasks{why}")
    return Placement(tuple(sorted(found, key=lambda p: -p.margin)), margins, region.keep_out, refused)


def _check_size(robot: str, region: Region) -> None:
    """Raise InputError where a region has too many bases; the numbers of each axis are not made for that."""
    counts = [
        1 + math.ceil((high - low) / region.step - 1e-9) for low, high in (region.x, region.y, region.z)
    ]
    count = math.prod(counts) * (1 + math.ceil((region.yaw_deg[1] - region.yaw_deg[0]) / TURN))
    if max(counts) > MOST_VALUES or count > MOST_BASES:
        expected = f"at most {MOST_BASES:,}, {MOST_VALUES:,} along a side: a longer step or a smaller region"
        raise InputError("region", f"bases of {robot}", count, expected)


def _axes(robot: str, region: Region) -> Iterator[NumberAxis]:
    """Yield the axes of the survey of a whole region."""
    for name, (low, high) in (("x", region.x), ("y", region.y), ("z", region.z)):
        yield _axis(name, robot, np.linspace(low, high, 1 + math.ceil((high - low) / region.step - 1e-9)))
    low, high = region.yaw_deg
    turns = np.linspace(low, high, 1 + math.ceil((high - low) / TURN - 1e-9))
    yield _axis("yaw_deg", robot, turns[:-1] if high - low >= 360 else turns)


def _around(robot: str, region: Region, base: Base, step: float, turn: float) -> Iterator[NumberAxis]:
    """Yield the axes of a survey around a base, within the region."""
    for name, size in (("x", step), ("y", step), ("z", step), ("yaw_deg", turn)):
        low, high = getattr(region, name)
        values = np.array([-size, 0.0, size]) + getattr(base, name)
        if name == "yaw_deg" and high - low >= 360:
            values = (values - low) % 360 + low
        yield _axis(name, robot, values[(values >= low - 1e-9) & (values <= high + 1e-9)])


def _axis(name: str, robot: str, values: Array) -> NumberAxis:
    numbers = tuple(dict.fromkeys(np.round(values, 6).tolist()))
    return NumberAxis(name=name, of=f"base.{name}", robot=robot, values=numbers)


def _best(margins: dict[Base, float], most: int, step: float) -> list[Base]:
    """Return the bases with the largest margins, none near another."""
    chosen: list[Base] = []
    for base in sorted(margins, key=lambda b: (-np.nan_to_num(margins[b], nan=-1.0), b)):
        if math.isnan(margins[base]) or len(chosen) == most:
            break
        if not any(base.is_near(other, step) for other in chosen):
            chosen.append(base)
    return chosen


def _checked(scene: Scene, robot: str, base: Base, kind: PlanKind) -> Proposal:
    """Plan a scene with a robot at a base.

    Raises:
        NoPlanError: there is no plan that holds; says why.
    """
    moved = with_base(scene, robot, base.moved(scene.robots[robot].T_world_base))
    first = next(iter(moved.tasks.values()))
    try:
        with open_world(moved) as world:
            plan = planned(MapMaker(world), moved, kind, first.arms[0], first.name)
    except SceneError as error:
        raise NoPlanError(str(error)) from None
    if plan is None:
        raise NoPlanError("no plan serves all tasks")
    report = verify(plan)
    if not report:
        raise NoPlanError(f"its plan does not hold: {report.failures[0]}")
    return Proposal(base, plan_margin(plan, moved.profile), plan, moved)
