"""From a scene to a plan: maps, a planner, and what it decided written down."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from itertools import pairwise
from typing import Literal

import numpy as np

from symgrasp.errors import NoPlanError, SceneError
from symgrasp.feasibility import Cell, FeasibilityMap, Progress
from symgrasp.manifold import ROLLS, grasp_to_tool, wrap
from symgrasp.maps import MapMaker
from symgrasp.plan import CLEARANCE_LIMIT, Grasp, Hold, Plan, Planner, PlanTask, Pose, SceneRecord
from symgrasp.planners.bimanual import Climb, hill_climb
from symgrasp.planners.conflicts import explain_conflict, fewest_regrasps
from symgrasp.planners.free import best_free
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs
from symgrasp.planners.postures import Posture, Postures
from symgrasp.planners.sequential import first_common_grasp
from symgrasp.poses import rotation_z
from symgrasp.scene import Scene
from symgrasp.scene_build import Task
from symgrasp.world import BulletWorld

__all__ = ["plan_bimanual", "plan_handover", "plan_sequential"]

BimanualMethod = Literal["exact", "hill_climb"]
SequentialMethod = Literal["best", "first", "regrasp"]

Maps = dict[tuple[int, str], FeasibilityMap]
"""(index of the task, name of the arm) → map."""


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
        method: ``best`` is the grasp with the largest margin in its worst task, ``first`` is
            Algorithm 2 as printed, ``regrasp`` the fewest grasps that serve the whole sequence,
            with the object set down in between.
        progress: told the finished share; may raise `Cancelled`.

    Raises:
        NoPlanError: no grasp serves all tasks; says which exclude each other.
        SceneError: no task is done by that arm alone.
    """
    name = scene.arm(arm or scene.task().arms[0]).name
    tasks = [task for task in scene.tasks.values() if task.arms == (name,)]
    if not tasks:
        names = [task.name for task in scene.tasks.values()]
        expected = f"a task that {name} does alone; several arms are for the other planners"
        raise SceneError(scene.source, "tasks", names, expected)
    known = {(k, name): (maps or {})[task.name] for k, task in enumerate(tasks) if task.name in (maps or {})}
    with BulletWorld(scene) as world:
        all_maps = _all_maps(world, tasks, known, progress)
        chosen = [all_maps[k, name] for k in range(len(tasks))]
        entries: list[PlanTask] = []
        for visits in _visits(world, tasks, chosen, method):
            part = [tasks[k] for k in visits]
            part_maps = {(i, name): chosen[k] for i, k in enumerate(visits)}
            if method == "first":
                entries += _first(world, part, part_maps, name)
            else:  # where it is set down, the object stays as it was turned
                turned = entries[-1].delta if entries else 0.0
                entries += _hold_best(world, part, part_maps, None, turned)[0]
    return _plan(scene, "sequential", Planner(algorithm=method), entries)


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
    known = {(0, arm): m for arm, m in (maps or {}).items()}
    with BulletWorld(scene) as world:
        all_maps = _all_maps(world, [the_task], known, progress)
        if method == "exact":
            entries, planner = _hold_best(world, [the_task], all_maps, progress)
        else:
            entries, planner = _climb(world, the_task, all_maps, seed, limits or Climb(), progress)
    return _plan(scene, "bimanual", planner, entries)


def plan_handover(
    scene: Scene,
    maps: Mapping[tuple[str, str], FeasibilityMap] | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find grasps for all tasks of a scene in order, whichever arms hold the object in each.

    An arm keeps its grasp as long as it holds on; where one arm takes over from another, both
    hold the object together in some task.

    Args:
        scene: the scene.
        maps: (task, arm) → map; computed where missing.
        progress: told the finished share; may raise `Cancelled`.

    Raises:
        NoPlanError: no grasps exist on this grid.
        SceneError: the object moves between two tasks that share no arm.
    """
    tasks = list(scene.tasks.values())
    for before, after in pairwise(tasks):
        still = np.array_equal(before.T_world_object, after.T_world_object)
        if not still and not set(before.arms) & set(after.arms):
            expected = f"an arm that carries the object there from task {before.name!r}"
            raise SceneError(scene.source, f"task {after.name}: arms", list(after.arms), expected)
    index = {task.name: k for k, task in enumerate(tasks)}
    known = {(index[task], arm): m for (task, arm), m in (maps or {}).items()}
    with BulletWorld(scene) as world:
        for before, after in pairwise(tasks):
            if not set(before.arms) & set(after.arms) and not world.rests(before.T_world_object):
                expected = f"an arm of task {before.name!r}: the object does not stand on anything there"
                raise SceneError(scene.source, f"task {after.name}: arms", list(after.arms), expected)
        all_maps = _all_maps(world, tasks, known, progress)
        entries, planner = _hold_best(world, tasks, all_maps, progress)
    return _plan(scene, "handover", planner, entries)


def _all_maps(world: BulletWorld, tasks: Sequence[Task], known: Maps, progress: Progress | None) -> Maps:
    """Return the maps of all arms in all tasks, computing those that are not known."""
    keys = [(k, arm) for k, task in enumerate(tasks) for arm in task.arms]
    maker = MapMaker(world, world.scene)
    maps: Maps = {}
    for done, (k, arm) in enumerate(keys):
        step = (lambda share, done=done: progress((done + share) / len(keys))) if progress else None
        maps[k, arm] = known.get((k, arm)) or maker.map(arm, tasks[k], progress=step)
    return maps


def _visits(
    world: BulletWorld, tasks: Sequence[Task], maps: Sequence[FeasibilityMap], method: SequentialMethod
) -> list[list[int]]:
    """Return for each grasp the tasks that it visits, in order.

    A regrasp visits the task where the object is set down twice: at the end with the old grasp,
    and at the beginning with the new one.
    """
    if method != "regrasp":
        return [list(range(len(tasks)))]
    resting = [k for k, task in enumerate(tasks) if world.rests(task.T_world_object)]
    segments = fewest_regrasps(maps, resting)
    if segments is None:
        raise NoPlanError(explain_conflict(maps) + "; no regrasp helps")
    visits, entry = [], []
    for segment in segments:
        leave = [] if segment.set_down is None else [segment.set_down]
        visits.append([*entry, *range(segment.first, segment.last + 1), *leave])
        entry = leave
    return visits


def _first(world: BulletWorld, tasks: Sequence[Task], maps: Maps, arm: str) -> list[PlanTask]:
    found = first_common_grasp([maps[k, arm] for k in range(len(tasks))])
    entries = []
    for k, (cell, delta) in enumerate(zip(found.cells, found.deltas, strict=True)):
        postures = Postures(world, [world.scene.arm(arm)], [maps[k, arm]]).witnesses([cell])
        holds = [(postures[0], maps[k, arm], cell, found.grasp)]
        entries.append(_task_entry(world, tasks[k], delta, holds))
    return entries


def _hold_best(
    world: BulletWorld,
    tasks: Sequence[Task],
    maps: Maps,
    progress: Progress | None,
    turned: float = 0.0,
) -> tuple[list[PlanTask], Planner]:
    """Find the best grasps for a sequence, with configurations in which nothing collides.

    Turning the object and all grasps on it by the same angle changes nothing, so the object can
    stand in the first task as it is ``turned`` (rad, whole cells) already.
    """
    grid = next(iter(maps.values())).manifold
    names = [task.arms for task in tasks]
    holders = [world.scene.arm(run.arm) for run in hold_runs(names)]
    search = HoldingSearch(maps, names, PrintGaps(holders, grid))
    desks = [
        Postures(world, [world.scene.arm(a) for a in task.arms], [maps[k, a] for a in task.arms])
        for k, task in enumerate(tasks)
    ]
    tried, steps = best_free(search, desks, progress)
    if steps is None:
        raise NoPlanError(_why_not(tasks, maps, tried))
    common = round(turned / grid.dtheta) - steps[0].turn
    entries = []
    for task, desk, step in zip(tasks, desks, steps, strict=True):
        held = zip(step.postures, desk.maps, step.cells, strict=True)
        holds = [(p, m, cell, cell.turned(-step.turn - common, grid.angles)) for p, m, cell in held]
        delta = float(wrap((step.turn + common) * grid.dtheta))
        entries.append(_task_entry(world, task, delta, holds))
    statistics = {"placements": tried, "body_checks": sum(desk.body_checks for desk in desks)}
    return entries, Planner(algorithm="exact", statistics=statistics)


def _why_not(tasks: Sequence[Task], maps: Maps, tried: int) -> str:
    for (k, arm), m in maps.items():
        if not m.feasible.any():
            return f"no grasp of {arm} is feasible in task {tasks[k].name}"
    if tried:
        return (
            f"no placement exists on this grid: the hands are apart in {tried}, "
            "but the arms meet in every configuration of each"
        )
    for run in hold_runs([task.arms for task in tasks]):
        alone = [maps[k, run.arm] for k in run.tasks]
        if not np.logical_and.reduce([m.feasible.any(axis=2) for m in alone]).any():
            return explain_conflict(alone)
    return "no placement exists on this grid: wherever all arms can hold, their hands meet"


def _climb(
    world: BulletWorld, task: Task, maps: Maps, seed: int, limits: Climb, progress: Progress | None
) -> tuple[list[PlanTask], Planner]:
    arms = [world.scene.arm(name) for name in task.arms]
    chosen = [maps[0, name] for name in task.arms]
    postures = Postures(world, arms, chosen)

    def bodies_free(cells: Sequence[Cell]) -> bool:
        return postures.find(cells, every=False) is not None

    found = hill_climb(chosen, arms, bodies_free, seed, limits, progress)
    held = zip(postures.witnesses(found.cells), chosen, found.cells, found.cells, strict=True)
    planner = Planner(
        algorithm="hill_climb",
        seed=seed,
        settings={"restarts": limits.restarts, "iterations": limits.iterations},
        statistics={
            "restarts": found.restarts,
            "iterations": found.iterations,
            "counted": found.counted,
            "body_checks": found.body_checks,
        },
    )
    return [_task_entry(world, task, 0.0, list(held))], planner


def _task_entry(
    world: BulletWorld, task: Task, delta: float, holds: Sequence[tuple[Posture, FeasibilityMap, Cell, Cell]]
) -> PlanTask:
    """Write one task; each hold is a posture, the arm's map, the cell on it, and the grasp itself."""
    turned = task.T_world_object @ rotation_z(delta)
    world.set_object(turned)
    world.set_arms(posture for posture, *_ in holds)
    entries = []
    for (arm, q, opening), m, cell, grasp in holds:
        margin = m.margin(cell)
        h, theta = float(m.manifold.h[grasp.row]), float(m.manifold.theta[grasp.column])
        roll = ROLLS[grasp.roll]
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
    scene: Scene,
    kind: Literal["sequential", "bimanual", "handover"],
    planner: Planner,
    entries: list[PlanTask],
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
