"""The planners on the maps of a scene's tasks: what they decide, written task by task."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import wrap
from symgrasp.plan.plan import Planner, PlanTask
from symgrasp.plan.writing import Held, write_task
from symgrasp.planners.bimanual import Climb, ClimbStep, hill_climb
from symgrasp.planners.configurations import ConfigurationFinder
from symgrasp.planners.conflicts import ConflictError, fewest_regrasps, find_conflict
from symgrasp.planners.free import FreePlacements
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs
from symgrasp.planners.sequential import first_common_grasp
from symgrasp.progress import Progress
from symgrasp.scene.parts import Task
from symgrasp.world import BulletWorld

__all__ = ["Maps", "climb", "first_grasp", "holdings", "with_regrasps"]

Maps = Mapping[tuple[int, str], FeasibilityMap]
"""(index of the task, name of the arm) → map."""


def first_grasp(world: BulletWorld, tasks: Sequence[Task], maps: Maps, arm: str) -> list[PlanTask]:
    """Write the grasp that Algorithm 2 finds for a sequence of one arm.

    Raises:
        ConflictError: there is none.
    """
    chosen = [maps[k, arm] for k in range(len(tasks))]
    found = first_common_grasp(chosen, _resting(world, tasks))
    entries = []
    for task, m, cell, delta in zip(tasks, chosen, found.cells, found.deltas, strict=True):
        (configuration,) = ConfigurationFinder(world, [world.scene.arm(arm)], [m]).witnesses([cell])
        entries.append(write_task(world, task, delta, [Held(configuration, m, cell, found.grasp)]))
    return entries


def with_regrasps(world: BulletWorld, tasks: Sequence[Task], maps: Maps, arm: str) -> list[PlanTask]:
    """Write the fewest grasps for a sequence, each the best for its tasks.

    A regrasp visits the task where the object is set down twice: at the end with the old grasp,
    and at the beginning with the new one.

    Raises:
        ConflictError: no number of regrasps helps.
    """
    chosen = [maps[k, arm] for k in range(len(tasks))]
    resting = _resting(world, tasks)
    segments = fewest_regrasps(chosen, resting)
    if segments is None:
        raise ConflictError(find_conflict(chosen, resting))
    entries: list[PlanTask] = []
    entry: list[int] = []
    for segment in segments:
        leave = [] if segment.set_down is None else [segment.set_down]
        visits = [*entry, *range(segment.first, segment.last + 1), *leave]
        entry = leave
        part = {(i, arm): chosen[k] for i, k in enumerate(visits)}
        turned = entries[-1].delta if entries else 0.0  # the object stays as it was set down
        entries += next(holdings(world, [tasks[k] for k in visits], part, None, turned))[0]
    return entries


def _resting(world: BulletWorld, tasks: Sequence[Task]) -> list[int]:
    """Return the tasks, as indices, in which the object stands on something."""
    return [k for k, task in enumerate(tasks) if world.object_rests(task.T_world_object)]


def holdings(
    world: BulletWorld,
    tasks: Sequence[Task],
    maps: Maps,
    progress: Progress | None,
    turned: float = 0.0,
) -> Iterator[tuple[list[PlanTask], Planner]]:
    """List grasps for a sequence, best first, with configurations in which nothing collides.

    Turning the object and all grasps on it by the same angle changes nothing, so the object can
    stand in the first task as it is ``turned`` (rad, whole cells) already.

    Raises:
        NoPlanError: there are none; says why.
    """
    grid = next(iter(maps.values())).manifold
    names = [task.arms for task in tasks]
    holders = [world.scene.arm(run.arm) for run in hold_runs(names)]
    search = HoldingSearch(maps, names, PrintGaps(holders, grid))
    finders = [
        ConfigurationFinder(world, [world.scene.arm(a) for a in task.arms], [maps[k, a] for a in task.arms])
        for k, task in enumerate(tasks)
    ]
    placements = FreePlacements(search, finders, progress)
    found = False
    for placement in placements:
        found = True
        common = round(turned / grid.dtheta) - placement.steps[0].turn
        entries = []
        for task, finder, step in zip(tasks, finders, placement.steps, strict=True):
            held = [
                Held(configuration, m, cell, cell.turned(-step.turn - common, grid.angles))
                for configuration, m, cell in zip(step.configurations, finder.maps, step.cells, strict=True)
            ]
            delta = float(wrap((step.turn + common) * grid.dtheta))
            entries.append(write_task(world, task, delta, held))
        statistics = {
            "placements": placements.tried,
            "body_checks": sum(finder.body_checks for finder in finders),
        }
        yield entries, Planner(algorithm="exact", statistics=statistics)
    if not found:
        raise _why_not(world, tasks, maps, placements.tried)


def _why_not(world: BulletWorld, tasks: Sequence[Task], maps: Maps, tried: int) -> NoPlanError:
    """Return the error that says why a sequence has no grasps."""
    runs = hold_runs([task.arms for task in tasks])
    if len(runs) == 1 and not tried:
        chosen = [maps[k, runs[0].arm] for k in runs[0].tasks]
        return ConflictError(find_conflict(chosen, _resting(world, tasks)))
    for (k, arm), m in maps.items():
        if not m.feasible.any():
            return NoPlanError(f"no grasp of {arm} is feasible in task {tasks[k].name}")
    if tried:
        return NoPlanError(
            f"no placement exists on this grid: the hands are apart in {tried}, "
            "but the arms meet in every configuration of each"
        )
    for run in runs:
        alone = [maps[k, run.arm] for k in run.tasks]
        if not np.logical_and.reduce([m.feasible.any(axis=2) for m in alone]).any():
            return ConflictError(find_conflict(alone))  # somebody else may hold it: no regrasps
    return NoPlanError("no placement exists on this grid: wherever all arms can hold, their hands meet")


def climb(
    world: BulletWorld,
    task: Task,
    maps: Maps,
    seed: int,
    limits: Climb,
    progress: Progress | None,
    trace: list[ClimbStep] | None,
) -> tuple[PlanTask, Planner]:
    """Write what Algorithm 3 finds for one task.

    Raises:
        NoPlanError: it finds nothing.
    """
    arms = [world.scene.arm(name) for name in task.arms]
    chosen = [maps[0, name] for name in task.arms]
    configurations = ConfigurationFinder(world, arms, chosen)

    def bodies_free(cells: Sequence[Cell]) -> bool:
        return configurations.find(cells, every=False) is not None

    found = hill_climb(chosen, arms, bodies_free, seed, limits, progress, trace=trace)
    held = [
        Held(configuration, m, cell, cell)
        for configuration, m, cell in zip(
            configurations.witnesses(found.cells), chosen, found.cells, strict=True
        )
    ]
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
    return write_task(world, task, 0.0, held), planner
