"""Plan a scene: compute the maps, run a planner, and write down what it decided.

Every exact planner lists all its solutions, best first and lazily; the best plan is the first.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from symgrasp.errors import SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.creation.pitch_maps import common_pitches
from symgrasp.feasibility.creation.torso_maps import merged
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import Plan, Planner
from symgrasp.plan.writing import write_plan
from symgrasp.planners.azimuths import bound_holds
from symgrasp.planners.bimanual import Climb, ClimbStep
from symgrasp.planners.holding import hold_runs, turn_groups
from symgrasp.planners.solving import TaskVisit, climb, first_grasp, holdings, with_regrasps
from symgrasp.progress import Progress, part_of
from symgrasp.robot.posture import ease
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, check_task, open_world

__all__ = [
    "MapsByKey",
    "Plans",
    "bimanual_plans",
    "handover_plans",
    "plan_bimanual",
    "plan_handover",
    "plan_sequential",
    "regrasp_plans",
    "sequential_maps",
    "sequential_plans",
    "tasks_of_plan",
]

BimanualMethod = Literal["exact", "hill_climb"]
SequentialMethod = Literal["best", "first", "regrasp"]

Plans = Generator[Plan]
"""Plans, made when asked for, best first; `close` it when no more are wanted."""

PITCHES_ALONE, PITCHES_TOGETHER = ((8, 6), (50, 12)), ((4, 4),)
"""How many pitches of an arm of five joints are tried all over the range, and how many each task suggests:
the first numbers and, where no pitch serves all tasks, the next. Where one arm holds the object at a time,
and where several do, whose prints are compared pitch by pitch."""

MapsByKey = Mapping[tuple[str, str], FeasibilityMap]
"""(name of the task, name of the arm) → map: the one key of maps."""


def plan_sequential(
    scene: Scene,
    arm: str | None = None,
    maps: MapsByKey | None = None,
    method: SequentialMethod = "best",
    progress: Progress | None = None,
) -> Plan:
    """Find one grasp for all tasks that an arm does alone.

    Args:
        scene: the scene.
        arm: the arm; the first task's if None.
        maps: (task, arm) → map; computed where missing.
        method: ``best`` is the grasp with the largest margin in its worst task, ``first`` is
            Algorithm 2 as printed, ``regrasp`` the fewest grasps that serve the whole sequence,
            with the object set down in between.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        ConflictError: no grasp serves all tasks; says which exclude each other.
        SceneError: no task is done by that arm alone, or the object is inside another body in one.
    """
    if method != "first":
        plans = sequential_plans if method == "best" else regrasp_plans
        return _best(plans(scene, arm, maps, progress), progress)
    name, tasks = _tasks_alone(scene, arm)
    with open_world(scene, progress) as world:
        visits = _visits(world, tasks, maps, progress)
        entries = first_grasp(world, visits, name)
        scene = _with_supports(world, tasks)
    return write_plan(scene, "sequential", Planner(algorithm="first"), entries)


def sequential_plans(
    scene: Scene,
    arm: str | None = None,
    maps: MapsByKey | None = None,
    progress: Progress | None = None,
) -> Plans:
    """List the plans with one grasp for all tasks that an arm does alone, best first.

    One for every height and roll that serves all tasks, each with its best turns: in the order of
    `common_grasps`. Of an arm of five joints, one for every pitch that was tried as well. Arguments and
    errors are those of `plan_sequential`.
    """
    _, tasks = _tasks_alone(scene, arm)
    with open_world(scene, progress) as world:
        visits = _visits(world, tasks, maps, part_of(progress, 0, 2))
        scene = _with_supports(world, tasks)
        for entries, _ in holdings(world, visits, part_of(progress, 1, 2)):
            yield write_plan(scene, "sequential", Planner(algorithm="best"), entries)


def regrasp_plans(
    scene: Scene,
    arm: str | None = None,
    maps: MapsByKey | None = None,
    progress: Progress | None = None,
) -> Plans:
    """List the plans with the fewest grasps for all tasks that an arm does alone, the best of each first.

    Arguments and errors are those of `plan_sequential`.
    """
    name, tasks = _tasks_alone(scene, arm)
    with open_world(scene, progress) as world:
        visits = _visits(world, tasks, maps, part_of(progress, 0, 2))
        scene = _with_supports(world, tasks)
        for entries in with_regrasps(world, visits, name, part_of(progress, 1, 2)):
            yield write_plan(scene, "sequential", Planner(algorithm="regrasp"), entries)


def sequential_maps(
    scene: Scene, arm: str | None = None, progress: Progress | None = None
) -> dict[tuple[str, str], FeasibilityMap]:
    """Return (task, arm) → map for all tasks that an arm does alone, in order.

    Arguments and errors are those of `plan_sequential`.
    """
    _, tasks = _tasks_alone(scene, arm)
    with open_world(scene, progress) as world:
        maker = MapMaker(world)
        return {
            (task.name, name): maker.map(name, task, progress=part_of(progress, k, len(tasks)))
            for k, task in enumerate(tasks)
            for name in task.arms
        }


def plan_bimanual(
    scene: Scene,
    task: str | None = None,
    maps: MapsByKey | None = None,
    method: BimanualMethod = "exact",
    seed: int = 0,
    limits: Climb | None = None,
    progress: Progress | None = None,
    trace: list[ClimbStep] | None = None,
) -> Plan:
    """Place all arms of a task on the object so that they do not meet.

    Args:
        scene: the scene.
        task: a task that several arms do together; the first such task if None.
        maps: (task, arm) → map; computed where missing.
        method: ``exact`` finds the placement with the largest gap and margins for which the whole
            robots are free, or proves that there is none on this grid; ``hill_climb`` is
            Algorithm 3.
        seed: of the random choices of the hill climbing.
        limits: how long to climb.
        progress: called with the finished share; may raise `Cancelled`.
        trace: receives every position of the hill climbing, whether it finds something or not.

    Raises:
        NoPlanError: no placement exists, or the hill climbing found none.
        SceneError: no task needs several arms, or the object is inside another body there.
    """
    if method == "exact":
        return _best(bimanual_plans(scene, task, maps, progress), progress)
    the_task = _task_together(scene, task)
    pitched = [name for name in the_task.arms if scene.arm(name).pitched]
    if pitched:
        expected = "arms of 6 or 7 joints for hill climbing, which knows no pitch"
        raise SceneError(scene.source, f"task {the_task.name}: arms", pitched, expected)
    with open_world(scene, progress) as world:
        (visit,) = _visits(world, [the_task], maps, part_of(progress, 0, 2))
        entry, planner = climb(world, visit, seed, limits or Climb(), part_of(progress, 1, 2), trace)
        scene = _with_supports(world, [the_task])
    return write_plan(scene, "bimanual", planner, [entry])


def bimanual_plans(
    scene: Scene,
    task: str | None = None,
    maps: MapsByKey | None = None,
    progress: Progress | None = None,
) -> Plans:
    """List the placements of all arms of a task, best first; neighbouring cells count as one.

    Arguments and errors are those of `plan_bimanual`.
    """
    the_task = _task_together(scene, task)
    with open_world(scene, progress) as world:
        visits = _visits(world, [the_task], maps, part_of(progress, 0, 2))
        scene = _with_supports(world, [the_task])
        for entries, planner in holdings(world, visits, part_of(progress, 1, 2)):
            yield write_plan(scene, "bimanual", planner, entries)


def plan_handover(
    scene: Scene,
    maps: MapsByKey | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find grasps for all tasks of a scene in order, whichever arms hold the object in each.

    An arm keeps its grasp as long as it holds on; where one arm takes over from another, both
    hold the object together in some task.

    Args:
        scene: the scene.
        maps: (task, arm) → map; computed where missing.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        NoPlanError: no grasps exist on this grid.
        SceneError: the object moves between two tasks that share no arm, or is inside another body in one;
            or there is one task or arm only.
    """
    return _best(handover_plans(scene, maps, progress), progress)


def handover_plans(
    scene: Scene,
    maps: MapsByKey | None = None,
    progress: Progress | None = None,
) -> Plans:
    """List the plans for all tasks of a scene in order, best first; neighbouring cells count as one.

    Arguments and errors are those of `plan_handover`.
    """
    tasks = _tasks_handed_over(scene)
    with open_world(scene, progress) as world:
        for before, after in pairwise(tasks):
            if not set(before.arms) & set(after.arms) and not world.object_rests(before.T_world_object):
                expected = f"an arm of task {before.name!r}: the object does not stand on anything there"
                raise SceneError(scene.source, f"task {after.name}: arms", list(after.arms), expected)
        visits = _visits(world, tasks, maps, part_of(progress, 0, 2))
        scene = _with_supports(world, tasks)
        for entries, planner in holdings(world, visits, part_of(progress, 1, 2)):
            yield write_plan(scene, "handover", planner, entries)


def _with_supports(world: BulletWorld, tasks: Sequence[Task]) -> Scene:
    """Return the scene, which says that the object is not supported where tasks begin or end without support.

    Raises:
        SceneError: nothing holds the object up in a task that says it is supported.
    """
    scene = world.scene
    for task in (tasks[0], tasks[-1]):
        if task.supported is False or world.object_rests(task.T_world_object):
            continue
        if task.supported:
            expected = "false: nothing holds the object up there"
            raise SceneError(scene.source, f"task {task.name}: supported", True, expected)
        scene = scene.with_supported(task.name, supported=False)
    return scene


def _best(plans: Plans, progress: Progress | None) -> Plan:
    with closing(plans):
        plan = next(plans)
    if progress:
        progress(1.0)
    return plan


def tasks_of_plan(scene: Scene, kind: str, arm: str | None = None, task: str | None = None) -> list[Task]:
    """Return the tasks that a plan is for.

    Args:
        scene: the scene.
        kind: sequential, bimanual or handover.
        arm: of a sequential plan, the arm; the first task's if None.
        task: of a bimanual plan, the task; the first with several arms if None.

    Raises:
        SceneError: the scene has no tasks for such a plan.
    """
    if kind == "sequential":
        return _tasks_alone(scene, arm)[1]
    return [_task_together(scene, task)] if kind == "bimanual" else _tasks_handed_over(scene)


def _tasks_handed_over(scene: Scene) -> list[Task]:
    """Return all tasks; raise SceneError if one arm could do them, or the object moves between two alone."""
    tasks = list(scene.tasks.values())
    arms = dict.fromkeys(arm for task in tasks for arm in task.arms)
    if len(tasks) < 2 or len(arms) < 2:
        names = [task.name for task in tasks]
        raise SceneError(scene.source, "tasks", names, "several tasks, done by several arms")
    for before, after in pairwise(tasks):
        still = np.array_equal(before.T_world_object, after.T_world_object)
        if not still and not set(before.arms) & set(after.arms):
            expected = f"an arm that carries the object there from task {before.name!r}"
            raise SceneError(scene.source, f"task {after.name}: arms", list(after.arms), expected)
    return tasks


def _tasks_alone(scene: Scene, arm: str | None) -> tuple[str, list[Task]]:
    """Return an arm and the tasks that it does alone."""
    name = scene.arm(arm or scene.task().arms[0]).name
    tasks = [task for task in scene.tasks.values() if task.arms == (name,)]
    if not tasks:
        names = [task.name for task in scene.tasks.values()]
        expected = f"a task that {name} does alone; several arms are for the other planners"
        raise SceneError(scene.source, "tasks", names, expected)
    return name, tasks


def _task_together(scene: Scene, task: str | None) -> Task:
    """Return a task that several arms do together."""
    together = [t for t in scene.tasks.values() if len(t.arms) > 1]
    found = scene.task(task) if task or not together else together[0]
    if len(found.arms) < 2:
        expected = "two or more arms; one arm alone is for the sequential planner"
        raise SceneError(scene.source, f"task {found.name}: arms", list(found.arms), expected)
    return found


def _visits(
    world: BulletWorld, tasks: Sequence[Task], known: MapsByKey | None, progress: Progress | None
) -> list[TaskVisit]:
    """Visit every task once, with the maps of all its arms; those that are not known are computed."""
    _check_azimuths(world.scene, tasks)
    for task in tasks:
        check_task(world, task)
    total = sum(len(task.arms) for task in tasks)
    pitched = {name for task in tasks for name in task.arms if world.scene.arm(name).pitched}
    total += sum(name in pitched for task in tasks for name in task.arms)
    maker = MapMaker(world)
    visits: list[TaskVisit] = []
    done = 0
    for task in tasks:
        bodies = [world.scene.arm(name).robot for name in task.arms]
        shared = {r.name: r for r in bodies if r.torso is not None and bodies.count(r) > 1}
        maps: dict[str, FeasibilityMap] = {}
        torsos: dict[str, dict[str, list[FeasibilityMap]]] = {name: {} for name in shared}
        for arm, body in zip(task.arms, bodies, strict=True):
            step = part_of(progress, done, total)
            if step:
                step(0.0)  # also where maps are given
            given = (known or {}).get((task.name, arm))
            if body.name in shared:
                by_torso = [_rated(world, m) for m in _by_torso(maker, arm, task, given, step)]
                torsos[body.name][arm] = by_torso
                maps[arm] = _rated(world, given or merged(by_torso))
            else:
                maps[arm] = _rated(world, given or maker.map(arm, task, progress=step))
            done += 1
        visits.append(TaskVisit(task, maps, tuple(torsos.values())))
    several = any(len(task.arms) > 1 for task in tasks)
    for arm in sorted(pitched):
        own = [k for k, visit in enumerate(visits) if arm in visit.maps]
        maps_of_arm = [visits[k].maps[arm] for k in own]
        for count in PITCHES_TOGETHER if several else PITCHES_ALONE:
            pitches = common_pitches(world.scene.arm(arm), maps_of_arm, *count)
            for k, free in zip(own, maps_of_arm, strict=True):
                step = part_of(progress, done + own.index(k), total)
                found = _rated(world, _at_pitches(maker, arm, visits[k].task, free, pitches, step))
                visits[k] = visits[k]._replace(maps={**visits[k].maps, arm: found})
            if np.logical_and.reduce([visits[k].maps[arm].feasible.any(axis=2) for k in own]).any():
                break
        done += len(own)
    return visits


def _rated(world: BulletWorld, m: FeasibilityMap) -> FeasibilityMap:
    """Return a map that knows how easily the arm stands at its witnesses."""
    return replace(m, ease=ease(world.scene.arm(m.arm), m.q))


def _check_azimuths(scene: Scene, tasks: Sequence[Task]) -> None:
    """Refuse tasks in which an arm of five joints would have to follow other hands.

    It holds the object at an azimuth that follows from its pitch, so a turn of the object is left that brings
    its grasp there: one for each task. Where other hands bind that turn to the turns of other tasks, there is
    none left.
    """
    sets = [task.arms for task in tasks]
    bound = bound_holds(hold_runs(sets), turn_groups(sets))
    for run in bound:
        if scene.arm(run.arm).pitched:
            task = tasks[run.tasks[-1]]
            expected = f"6 or 7 joints for {run.arm}, which holds the object together with others in several"
            raise SceneError(scene.source, f"task {task.name}: arms", list(task.arms), expected)


def _at_pitches(
    maker: MapMaker,
    arm: str,
    task: Task,
    free: FeasibilityMap,
    pitches: Sequence[float],
    progress: Progress | None,
) -> FeasibilityMap:
    """Return the map of an arm with its hand at some pitches (rad), feasible only where it is if free."""
    posed = replace(task, T_world_object=free.T_world_object)
    found = maker.maps_at_pitches(arm, posed, pitches, manifold=free.manifold, progress=progress)
    return found.masked(np.tile(free.feasible, (len(pitches), 1, 1)))


def _by_torso(
    maker: MapMaker, arm: str, task: Task, given: FeasibilityMap | None, progress: Progress | None
) -> list[FeasibilityMap]:
    """Return the maps of an arm at the samples of its torso, feasible only where a given map is."""
    if given is None:
        return maker.maps_by_torso(arm, task, progress=progress)
    posed = replace(task, T_world_object=given.T_world_object)
    found = maker.maps_by_torso(arm, posed, manifold=given.manifold, progress=progress)
    return [m.masked(given.feasible) for m in found]
