"""Plans: what a planner decided, with everything needed to check it, as versioned JSON."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from symgrasp.errors import NoPlanError, PlanError, SceneError
from symgrasp.feasibility import Cell, FeasibilityMap, Progress, create_map
from symgrasp.files import write_atomically
from symgrasp.manifold import ROLLS, grasp_to_tool
from symgrasp.planners.bimanual import Climb, hill_climb
from symgrasp.planners.conflicts import explain_conflict, fewest_regrasps
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.placement import best_placements
from symgrasp.planners.postures import Posture, Postures, witnesses
from symgrasp.planners.sequential import SequentialGrasp, best_common_grasp, first_common_grasp
from symgrasp.poses import Array, quat_wxyz, rotation_z
from symgrasp.scene import Scene, Task, describe
from symgrasp.world import BulletWorld

__all__ = ["Plan", "plan_bimanual", "plan_schema", "plan_sequential"]

CLEARANCE_LIMIT = 0.1
"""Clearances are measured up to this distance (m)."""

BimanualMethod = Literal["exact", "hill_climb"]
SequentialMethod = Literal["first", "best", "regrasp"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Row = tuple[Finite, Finite, Finite, Finite]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Pose(_Part):
    """A pose, written twice: as a matrix and as position (m) and wxyz quaternion."""

    matrix: tuple[Row, Row, Row, Row]
    position: tuple[Finite, Finite, Finite]
    quat_wxyz: Row

    @staticmethod
    def of(pose: ArrayLike) -> Pose:
        """Write a pose (4, 4)."""
        pose = np.asarray(pose, dtype=float)
        return Pose(matrix=pose.tolist(), position=pose[:3, 3].tolist(), quat_wxyz=quat_wxyz(pose).tolist())

    def array(self) -> Array:
        """Return the matrix (4, 4)."""
        return np.array(self.matrix)


class Grasp(_Part):
    """A grasp on the object's surface."""

    h: Finite = Field(description="height along the axis (m)")
    theta: Finite = Field(description="angle about the axis (rad), in the object's frame")
    roll: Finite = Field(description="turn about the approach (rad): 0 or π")


class Hold(_Part):
    """How one arm holds the object in one task."""

    arm: str
    robot: str
    grasp: Grasp
    tool_pose: Pose = Field(description="T_world_tool")
    joints: dict[str, Finite] = Field(description="joint name → value (rad), base to tool")
    hand_joints: dict[str, Finite] = Field(description="hand joint name → value (m or rad)")
    opening: Finite = Field(description="distance between the finger pads (m)")
    clearance: Finite = Field(
        description=f"smallest distance (m) of bodies that may not touch; {CLEARANCE_LIMIT} stands for more"
    )
    margin_along: Finite = Field(description="distance along the axis to an infeasible cell (m)")
    margin_around: Finite = Field(description="angle about the axis to an infeasible cell (rad)")


class PlanTask(_Part):
    """The object pose of a task, the turn about its axis, and the hands on it."""

    name: str
    object_pose: Pose = Field(description="T_world_object as the scene gives it")
    delta: Finite = Field(description="turn of the object about its own axis (rad)")
    object_pose_turned: Pose = Field(description="object_pose · Rz(delta)")
    holds: tuple[Hold, ...]


class Planner(_Part):
    """What made the plan."""

    algorithm: str
    seed: int | None = None
    settings: dict[str, int] = {}
    statistics: dict[str, int] = {}


class SceneRecord(_Part):
    """The scene the plan is for."""

    name: str
    sha256: str
    content: dict[str, Any]


class Plan(_Part):
    """A plan, format version 1."""

    schema_version: Literal[1] = 1
    kind: Literal["sequential", "bimanual"]
    scene: SceneRecord
    versions: dict[str, str]
    planner: Planner
    units: dict[str, str] = {"length": "m", "angle": "rad", "quaternion": "wxyz"}
    frames: dict[str, str] = {
        "world": "the scene's frame, z up",
        "object": "origin on the axis at the bottom, z along the axis of symmetry",
        "tool": "between the finger tips, z = approach, y = closing direction",
    }
    robots: dict[str, tuple[str, ...]] = Field(description="robot → names of all its joints")
    tasks: tuple[PlanTask, ...]

    def to_json(self) -> str:
        """Return the plan as JSON text; floats read back exactly."""
        return json.dumps(self.model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Write the plan, in one piece."""
        with write_atomically(Path(path)) as file:
            file.write(self.to_json().encode())

    @staticmethod
    def load(path: str | Path) -> Plan:
        """Read a plan.

        Raises:
            PlanError: the file is missing or is not such a plan.
        """
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise PlanError(path, "file", str(error), "a readable JSON file") from error
        try:
            return Plan.model_validate(content)
        except ValidationError as error:
            raise PlanError(path, *describe(error, content)) from None


def plan_schema() -> dict[str, Any]:
    """Return the JSON Schema of plan files."""
    return Plan.model_json_schema()


def plan_sequential(
    scene: Scene,
    arm: str | None = None,
    maps: Mapping[str, FeasibilityMap] | None = None,
    method: SequentialMethod = "best",
    progress: Progress | None = None,
) -> Plan:
    """Find one grasp for all tasks that an arm does alone.

    Args:
        scene: the scene.
        arm: the arm; the first task's if None.
        maps: task → map of that arm; computed where missing.
        method: ``first`` is Algorithm 2 as printed, ``best`` the grasp with the largest margin in
            its worst task, ``regrasp`` the fewest grasps that serve the whole sequence, with the
            object set down in between.
        progress: told the finished share; may raise `Cancelled`.

    Raises:
        NoPlanError: no grasp serves all tasks; says which exclude each other.
        SceneError: no task is done by that arm alone.
    """
    the_arm = scene.arm(arm or scene.task().arms[0])
    tasks = [task for task in scene.tasks.values() if task.arms == (the_arm.name,)]
    if not tasks:
        names = [task.name for task in scene.tasks.values()]
        expected = f"a task that {the_arm.name} does alone; several arms are for the bimanual planner"
        raise SceneError(scene.source, "tasks", names, expected)
    with BulletWorld(scene) as world:
        known = dict(maps or {})
        for k, task in enumerate(tasks):
            if task.name not in known:
                step = _part(progress, k, len(tasks))
                known[task.name] = create_map(scene, the_arm.name, task.name, world=world, progress=step)
        chosen = [known[task.name] for task in tasks]
        resting = [k for k, task in enumerate(tasks) if world.rests(task.T_world_object)]
        entries = []
        for visits, found in _sequence(chosen, method, resting):
            for k, cell, delta in zip(visits, found.cells, found.deltas, strict=True):
                (posture,) = witnesses([the_arm], [chosen[k]], [cell])
                hold = (posture, chosen[k], cell, found.grasp.column)
                entries.append(_task_entry(world, tasks[k], delta, [hold]))
    return _plan(scene, "sequential", Planner(algorithm=method), entries)


def _sequence(
    maps: Sequence[FeasibilityMap], method: SequentialMethod, resting: Sequence[int]
) -> list[tuple[list[int], SequentialGrasp]]:
    """Return one or several grasps, each with the tasks that it visits in order.

    A regrasp visits the task where the object is set down twice: at the end with the old grasp,
    and at the beginning with the new one.
    """
    everything = list(range(len(maps)))
    if method == "first":
        return [(everything, first_common_grasp(maps))]
    if method == "best":
        return [(everything, best_common_grasp(maps))]
    segments = fewest_regrasps(maps, resting)
    if segments is None:
        raise NoPlanError(explain_conflict(maps) + "; no regrasp helps")
    grasps, entry = [], None
    for segment in segments:
        ends = [[k] if k is not None else [] for k in (entry, segment.set_down)]
        visits = [*ends[0], *range(segment.first, segment.last + 1), *ends[1]]
        grasps.append((visits, best_common_grasp([maps[k] for k in visits])))
        entry = segment.set_down
    return grasps


def plan_bimanual(
    scene: Scene,
    task: str | None = None,
    maps: Mapping[str, FeasibilityMap] | None = None,
    method: BimanualMethod = "exact",
    seed: int = 0,
    limits: Climb | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Place all arms of a task on the object so that they do not meet.

    Args:
        scene: the scene.
        task: a task that several arms do together; the first such task if None.
        maps: arm → map of that task; computed where missing.
        method: ``exact`` finds the placement with the largest gap and margins for which the whole
            robots are free, or proves that there is none on this grid; ``hill_climb`` is
            Algorithm 3.
        seed: of the random choices of the hill climbing.
        limits: how long to climb.
        progress: told the finished share; may raise `Cancelled`.

    Raises:
        NoPlanError: no placement exists, or the hill climbing found none.
        SceneError: no task needs several arms.
    """
    together = [t for t in scene.tasks.values() if len(t.arms) > 1]
    the_task = scene.task(task) if task or not together else together[0]
    if len(the_task.arms) < 2:
        expected = "two or more arms; one arm alone is for the sequential planner"
        raise SceneError(scene.source, f"task {the_task.name}: arms", list(the_task.arms), expected)
    arms = [scene.arm(name) for name in the_task.arms]
    with BulletWorld(scene) as world:
        known = dict(maps or {})
        for k, arm in enumerate(arms):
            if arm.name not in known:
                step = _part(progress, k, len(arms) + 1)
                known[arm.name] = create_map(scene, arm.name, the_task.name, world=world, progress=step)
        chosen = [known[arm.name] for arm in arms]
        postures = Postures(world, arms, chosen)
        last = _part(progress, len(arms), len(arms) + 1)
        if method == "exact":
            cells, found, planner = _place(chosen, postures, last)
        else:
            cells, found, planner = _climb(chosen, postures, seed, limits or Climb(), last)
        holds = [(p, m, c, c.column) for p, m, c in zip(found, chosen, cells, strict=True)]
        entry = _task_entry(world, the_task, 0.0, holds)
    return _plan(scene, "bimanual", planner, [entry])


def _place(
    maps: Sequence[FeasibilityMap], postures: Postures, progress: Progress | None
) -> tuple[tuple[Cell, ...], list[Posture], Planner]:
    gaps = PrintGaps(postures.arms, maps[0].manifold)
    placements = 0
    for placement in best_placements(maps, gaps):
        placements += 1
        if progress:
            progress(0.0)  # how many there are is not known beforehand
        found = postures.find(placement.cells)
        if found:
            if progress:
                progress(1.0)
            statistics = {"placements": placements, "body_checks": postures.body_checks}
            return placement.cells, found, Planner(algorithm="exact", statistics=statistics)
    empty = [m.arm for m in maps if not m.feasible.any()]
    if empty:
        raise NoPlanError(f"{' and '.join(empty)} has no feasible cell in task {maps[0].task}")
    if not placements:
        raise NoPlanError(
            "no placement exists on this grid: the handprints share a cell wherever the arms can hold"
        )
    raise NoPlanError(
        f"no placement exists on this grid: the handprints are apart in {placements}, "
        "but the arms meet in every configuration of each"
    )


def _climb(
    maps: Sequence[FeasibilityMap], postures: Postures, seed: int, limits: Climb, progress: Progress | None
) -> tuple[tuple[Cell, ...], list[Posture], Planner]:
    def bodies_free(cells: Sequence[Cell]) -> bool:
        return postures.find(cells, every=False) is not None

    found = hill_climb(maps, postures.arms, bodies_free, seed, limits, progress)
    planner = Planner(
        algorithm="hill_climb",
        seed=seed,
        settings={"restarts": limits.restarts, "iterations": limits.iterations},
        statistics={
            "restarts": found.restarts,
            "iterations": found.iterations,
            "print_checks": found.print_checks,
            "body_checks": found.body_checks,
        },
    )
    return found.cells, postures.witnesses(found.cells), planner


def _part(progress: Progress | None, k: int, n: int) -> Progress | None:
    """Return a progress callback for part k of n."""
    return (lambda share: progress((k + share) / n)) if progress else None


def _task_entry(
    world: BulletWorld, task: Task, delta: float, holds: Sequence[tuple[Posture, FeasibilityMap, Cell, int]]
) -> PlanTask:
    """Write one task; each hold is a posture, the arm's map, the cell on it, and the grasp's own column."""
    turned = task.T_world_object @ rotation_z(delta)
    world.set_object(turned)
    world.set_arms(posture for posture, *_ in holds)
    entries = []
    for (arm, q, opening), m, cell, column in holds:
        margin = m.margin(cell)
        h, theta, roll = float(m.manifold.h[cell.row]), float(m.manifold.theta[column]), ROLLS[cell.roll]
        standoff = arm.hand.standoff(float(m.manifold.profile.radius(h)))
        entries.append(
            Hold(
                arm=arm.name,
                robot=arm.robot.name,
                grasp=Grasp(h=h, theta=theta, roll=roll),
                tool_pose=Pose.of(grasp_to_tool(turned, h, theta, roll, standoff)),
                joints=dict(zip(arm.joint_names, q.tolist(), strict=True)),
                hand_joints=arm.hand.joint_values(opening),
                opening=opening,
                clearance=world.clearance(arm, CLEARANCE_LIMIT),
                margin_along=margin.along,
                margin_around=margin.around,
            )
        )
    return PlanTask(
        name=task.name,
        object_pose=Pose.of(task.T_world_object),
        delta=delta,
        object_pose_turned=Pose.of(turned),
        holds=tuple(entries),
    )


def _plan(
    scene: Scene, kind: Literal["sequential", "bimanual"], planner: Planner, entries: list[PlanTask]
) -> Plan:
    packages = ("symgrasp", "numpy", "pybullet", "eaik")
    return Plan(
        kind=kind,
        scene=SceneRecord(name=scene.name, sha256=scene.sha256, content=scene.content),
        versions={"python": platform.python_version(), **{name: version(name) for name in packages}},
        planner=planner,
        robots={robot.name: robot.model.joint_names for robot in scene.robots.values()},
        tasks=tuple(entries),
    )
