"""What a survey knows of a point: its map in a few numbers, and the plan, in worlds that points share."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from symgrasp.errors import Cancelled, InputError, NoPlanError, SceneError, SymgraspError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.profile import Profile
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import (
    plan_bimanual,
    plan_handover,
    plan_sequential,
    tasks_of_plan,
)
from symgrasp.planners.sequential import clearance_steps, surface_margin
from symgrasp.poses import from_position_rpy
from symgrasp.progress import Progress, at_start
from symgrasp.reason import Reason
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.survey.format import BASE, LEAN, POSITION, NumberAxis, PlanKind, PositionAxis, TaskAxis
from symgrasp.survey.survey import Survey
from symgrasp.world import BulletWorld, check_homes, object_contact, open_world, stands_free, with_free_homes

__all__ = ["Evaluator", "PointResult", "State", "best_cell", "plan_margin", "planned"]


class State(IntEnum):
    """What became of a point; a store says 0 where it has not been computed."""

    MISSING = 0
    COMPUTED = 1
    OBJECT_BLOCKED = 2
    """the object is inside an obstacle, or a robot that does not hold it"""
    ROBOT_BLOCKED = 3
    """a robot collides whatever its arms do, or its base is moved into something"""
    KEPT_OUT = 4
    """the base stands where it may not"""
    UNUSABLE = 5
    """the values of its axes do not go together; `PointResult.problem` says why"""


@dataclass(frozen=True, eq=False)
class PointResult:
    """What a survey keeps of a point.

    Attributes:
        state: what became of it; all else is empty unless it is `State.COMPUTED`.
        share: share of the cells of the map that are feasible.
        best: roll, row and column of the cell with the largest margin, -1 where none is feasible.
        margin: that margin (m), see `symgrasp.planners.sequential.surface_margin`; 0 where none is feasible.
        cells: number of cells by `Reason`.
        plan: whether the plan exists.
        plan_margin: the smallest margin (m) of any hold of the best plan, 0 where there is none.
        feasible: (R, H, A) which cells are feasible.
        problem: why its values do not go together, in one line; empty unless it is `State.UNUSABLE`.
    """

    state: State
    share: float = np.nan
    best: tuple[int, int, int] = (-1, -1, -1)
    margin: float = np.nan
    cells: np.ndarray | None = None
    plan: bool = False
    plan_margin: float = np.nan
    feasible: np.ndarray | None = None
    problem: str = ""


class _Stage(NamedTuple):
    """A world that points share, and what computes maps in it; none where a robot is blocked."""

    key: tuple[int, ...]
    scene: Scene
    world: BulletWorld | None
    maker: MapMaker | None
    others: dict[tuple[str, str], FeasibilityMap]
    """maps of the tasks that a point does not move"""


class Evaluator:
    """Computes points of a survey; use it in a ``with`` block, or `close` it.

    What the last point needed besides its map is kept for the next one.

    Args:
        survey: the survey.
    """

    def __init__(self, survey: Survey) -> None:
        self.survey = survey
        self._stage: _Stage | None = None

    def __enter__(self) -> Evaluator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the world that is open."""
        if self._stage and self._stage.world:
            self._stage.world.close()
        self._stage = None

    def point(self, point: tuple[int, ...], progress: Progress | None = None) -> PointResult:
        """Compute a point.

        Args:
            point: indices along each axis.
            progress: called now and then with 0; may raise `Cancelled`.
        """
        if self._kept_out(point):
            return PointResult(State.KEPT_OUT)
        try:
            return self._computed(point, at_start(progress))
        except Cancelled:
            raise
        except SymgraspError as error:  # values that are fine on their own, and are not together
            text = error.without_source if isinstance(error, InputError) else str(error)
            return PointResult(State.UNUSABLE, problem=text)

    def _computed(self, point: tuple[int, ...], tell: Progress | None) -> PointResult:
        """Compute a point whose base stands where it may."""
        stage = self._stage_of(point, tell)
        if stage.world is None or stage.maker is None:
            return PointResult(State.ROBOT_BLOCKED)
        file, task = self.survey.file, self.task_at(point, stage.scene)
        arm = file.arm or task.arms[0]
        scene, tasks = stage.scene, [task]
        if file.plan:
            scene = scene.with_task(task)
            tasks += [t for t in tasks_of_plan(scene, file.plan, arm, task.name) if t.name != task.name]
        if any(object_contact(stage.world, own) for own in tasks):
            return PointResult(State.OBJECT_BLOCKED)
        m = stage.maker.map(arm, task, progress=tell)
        best, margin = best_cell(m)
        found = PointResult(
            State.COMPUTED,
            share=float(m.feasible.mean()),
            best=best,
            margin=margin,
            cells=np.bincount(m.reason.ravel(), minlength=len(Reason)),
            feasible=m.feasible,
        )
        if not file.plan:
            return found
        maps = {key: other for key, other in stage.others.items() if key[0] != task.name}
        maps[task.name, arm] = m
        plan = planned(stage.maker, scene, file.plan, arm, task.name, maps, tell)
        stage.others.update((key, other) for key, other in maps.items() if key[0] != task.name)
        return replace(
            found, plan=plan is not None, plan_margin=plan_margin(plan, scene.profile) if plan else 0.0
        )

    def task_at(self, point: tuple[int, ...], scene: Scene) -> Task:
        """Return the task of a point, with the object where the point has it.

        Args:
            point: indices along each axis.
            scene: the point's scene.
        """
        axes = [(a.file, a.values[k]) for a, k in zip(self.survey.axes, point, strict=True) if a.moves_object]
        name = next((v for axis, v in axes if isinstance(axis, TaskAxis)), self.survey.file.task)
        task = scene.task(name)
        T, lean = np.array(task.T_world_object), {}
        for axis, value in axes:
            if isinstance(axis, PositionAxis):
                T[:3, 3] = value
            elif axis.of in POSITION:
                T["xyz".index(axis.of[-1]), 3] = value
            elif axis.of in LEAN:
                lean[axis.of] = np.deg2rad(value)
        if lean:
            T = from_position_rpy(T[:3, 3], (0.0, lean["tilt_deg"], lean.get("direction_deg", 0.0)))
        return replace(task, T_world_object=T)

    def _stage_of(self, point: tuple[int, ...], tell: Progress | None) -> _Stage:
        key = self.survey.scene_key(point)
        if self._stage is None or self._stage.key != key:
            self.close()
            scene = self.survey.scene_at(point)
            if tell:
                tell(0.0)
            scene = with_free_homes(scene, tell)
            try:
                check_homes(scene, tell)
            except SceneError:
                self._stage = _Stage(key, scene, None, None, {})
            else:
                world = open_world(scene, tell)
                if all(stands_free(world, robot) for robot in self._moved_bases):
                    self._stage = _Stage(key, scene, world, MapMaker(world), {})
                else:
                    world.close()
                    self._stage = _Stage(key, scene, None, None, {})
        return self._stage

    @cached_property
    def _moved_bases(self) -> dict[str, list[tuple[int, str]]]:
        """Robot whose base is moved → the axes that move it, each with what it moves."""
        found: dict[str, list[tuple[int, str]]] = {}
        for k, axis in enumerate(self.survey.axes):
            if isinstance(axis.file, NumberAxis) and axis.file.of in BASE:
                robot = axis.file.robot or next(iter(self.survey.scene.robots))
                found.setdefault(robot, []).append((k, axis.file.of))
        return found

    def _kept_out(self, point: tuple[int, ...]) -> bool:
        """Whether a base that an axis moves stands where it may not."""
        for robot, axes in self._moved_bases.items():
            place = dict(zip(BASE, self.survey.scene.robots[robot].T_world_base[:2, 3], strict=False))
            place |= {of: self.survey.axes[k].values[point[k]] for k, of in axes}
            x, y = place["base.x"], place["base.y"]
            outs = self.survey.file.keep_out
            if any(out.x[0] <= x <= out.x[1] and out.y[0] <= y <= out.y[1] for out in outs):
                return True
        return False


def best_cell(m: FeasibilityMap) -> tuple[tuple[int, int, int], float]:
    """Return the cell with the largest margin (m) and that margin; the larger clearance breaks ties.

    Clearances count by `clearance_steps`, and of equal cells the first is returned.
    """
    if not m.feasible.any():
        return (-1, -1, -1), 0.0
    margin = np.where(m.feasible, surface_margin(m), -1.0)
    clearance = np.where(m.feasible & (margin == margin.max()), clearance_steps(m.clearance), -1)
    roll, row, column = np.unravel_index(int(clearance.argmax()), margin.shape)
    return (int(roll), int(row), int(column)), float(margin.max())


def planned(
    maker: MapMaker,
    scene: Scene,
    kind: PlanKind,
    arm: str,
    task: str,
    known: dict[tuple[str, str], FeasibilityMap] | None = None,
    progress: Progress | None = None,
) -> Plan | None:
    """Return the best plan of a scene, None if none exists.

    Args:
        maker: computes the maps that are not known; of the same robots, object and obstacles.
        scene: the scene.
        kind: which planner.
        arm: of the sequential planner, the arm.
        task: of the bimanual planner, the task.
        known: maps that are known; those that are computed are added.
        progress: called with the finished share of each map, and of the search; may raise `Cancelled`.
    """
    maps = {} if known is None else known
    for own in tasks_of_plan(scene, kind, arm, task):
        for name in own.arms:
            if (own.name, name) not in maps:
                maps[own.name, name] = maker.map(name, own, progress=progress)
            if not maps[own.name, name].feasible.any():
                return None
    with suppress(NoPlanError):
        if kind == "sequential":
            return plan_sequential(scene, arm, maps, progress=progress)
        if kind == "bimanual":
            return plan_bimanual(scene, task, maps, progress=progress)
        return plan_handover(scene, maps, progress=progress)
    return None


def plan_margin(plan: Plan, profile: Profile) -> float:
    """Return the smallest margin (m) on the surface of any hold of a plan, on an object of a profile."""
    return min(
        min(hold.margin_along, hold.margin_around * float(profile.radius(hold.grasp.h)))
        for task in plan.tasks
        for hold in task.holds
    )
