"""Run the planners on the maps of a scene's tasks, and write down task by task what they decide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import count, product
from typing import NamedTuple

import numpy as np

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import wrap
from symgrasp.plan.plan import Planner, PlanTask
from symgrasp.plan.writing import Held, write_task
from symgrasp.planners.azimuths import offsets
from symgrasp.planners.bimanual import Climb, ClimbStep, hill_climb
from symgrasp.planners.configurations import ConfigurationFinder, witnesses
from symgrasp.planners.conflicts import ConflictError, fewest_regrasps, find_conflict
from symgrasp.planners.free import FreePlacements
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs, turn_groups
from symgrasp.planners.sequential import first_common_grasp
from symgrasp.planners.stations import SharedTorso
from symgrasp.progress import Progress, part_of, rising
from symgrasp.scene.parts import Task
from symgrasp.world import BulletWorld

__all__ = ["TaskVisit", "climb", "first_grasp", "holdings", "with_regrasps"]


class TaskVisit(NamedTuple):
    """One time that the object is in the pose of a task; a regrasp visits a task twice.

    Attributes:
        task: the task.
        maps: arm → its map of that task, for every arm of the task in its order.
        torsos: for every torso that several arms of the task share, arm → its maps at the samples.
    """

    task: Task
    maps: Mapping[str, FeasibilityMap]
    torsos: Sequence[Mapping[str, Sequence[FeasibilityMap]]] = ()


def first_grasp(world: BulletWorld, visits: Sequence[TaskVisit], arm: str) -> list[PlanTask]:
    """Find the grasp of Algorithm 2 for a sequence of one arm.

    Args:
        world: a world of the scene.
        visits: every task once, in order.
        arm: the arm.

    Returns:
        The tasks as a plan states them.

    Raises:
        ConflictError: there is none.
    """
    maps = [visit.maps[arm] for visit in visits]
    found = first_common_grasp(maps, _resting(world, visits))
    held = [
        Held(witnesses([world.scene.arm(arm)], [m], [cell])[0], m, cell, found.grasp)
        for m, cell in zip(maps, found.cells, strict=True)
    ]
    sets = [[arm] for _ in visits]
    azimuths = {(k, arm): _azimuth(own) for k, own in enumerate(held)}
    more, (offset,) = offsets(hold_runs(sets), turn_groups(sets), azimuths, 0.0)
    return [
        write_task(world, visit.task, float(wrap(delta + extra)), [own._replace(offset=offset)])
        for visit, delta, extra, own in zip(visits, found.deltas, more, held, strict=True)
    ]


def _azimuth(held: Held) -> float:
    """Return the angle (rad) by which an arm holds beside the middle of its cell."""
    roll, _ = held.map.roll_and_pitch(held.cell.roll)
    return held.configuration.arm.pitch_and_azimuth(held.configuration.q, roll)[1]


def with_regrasps(
    world: BulletWorld, visits: Sequence[TaskVisit], arm: str, progress: Progress | None = None
) -> Iterator[list[PlanTask]]:
    """Yield the fewest grasps for a sequence of one arm, first each the best for its tasks.

    A regrasp visits the task where the object is set down twice: at the end with the old grasp,
    and at the beginning with the new one. The others follow in the order of the sum of their places in
    the lists of grasps for their tasks, so that none of several grasps is kept for long.

    Args:
        world: a world of the scene.
        visits: every task once, in order.
        arm: the arm.
        progress: called with a share that rises with what was tried; may raise `Cancelled`.

    Yields:
        The tasks as a plan states them, visits for a regrasp included.

    Raises:
        ConflictError: no number of regrasps helps.
    """
    maps = [visit.maps[arm] for visit in visits]
    resting = _resting(world, visits)
    segments = fewest_regrasps(maps, resting)
    if segments is None:
        raise ConflictError(find_conflict(maps, resting))
    parts: list[list[TaskVisit]] = []
    entry: list[TaskVisit] = []
    for segment in segments:
        down = segment.set_down
        own = visits[segment.first : segment.last + 1]
        part = [*(v for v in entry if v is not own[0]), *own]
        entry = [] if down is None else [visits[down]]
        part += (v for v in entry if v is not own[-1])
        parts.append(part)
    chains = _Chains(world, parts, progress and rising(progress))
    for total in count():
        alive = False
        for places in product(range(total + 1), repeat=len(parts)):
            if sum(places) == total:
                # Grasps of the first parts from which nothing goes on do not end the list.
                firsts = (places[:n] for n in range(1, len(parts) + 1) if sum(places[:n]) == total)
                alive = alive or any(chains.at(first) is not None for first in firsts)
                entries = chains.at(places)
                if entries is not None:
                    yield entries
        if not alive:
            return


class _Chains:
    """The grasps of parts of a sequence one after the other, found when asked for.

    Args:
        world: a world of the scene.
        parts: the visits of each part; the object is where the one before has left it.
        progress: called with the share of the part that is searched; may raise `Cancelled`.
    """

    def __init__(
        self, world: BulletWorld, parts: Sequence[Sequence[TaskVisit]], progress: Progress | None
    ) -> None:
        self._world, self._parts, self._progress = world, parts, progress
        self._further: dict[tuple[int, ...], Iterator[tuple[list[PlanTask], Planner]]] = {}
        self._known: dict[tuple[int, ...], list[PlanTask] | None] = {(): []}

    def at(self, places: tuple[int, ...]) -> list[PlanTask] | None:
        """Return the tasks of the first few parts, None where there are not as many grasps.

        Args:
            places: of the grasp of each of these parts in the list of those that go on from the ones before.
        """
        if places not in self._known:
            *_, last = places
            before = self.at(places[:-1])
            if before is None or (last and self.at((*places[:-1], last - 1)) is None):
                self._known[places] = None
                return None
            if places[:-1] not in self._further:
                turned = before[-1].delta if before else 0.0  # the object stays as it was set down
                part = self._parts[len(places) - 1]
                self._further[places[:-1]] = holdings(self._world, part, self._progress, turned)
            found = next(self._further[places[:-1]], None)
            self._known[places] = None if found is None else [*before, *found[0]]
        return self._known[places]


def _resting(world: BulletWorld, visits: Sequence[TaskVisit]) -> list[int]:
    """Return the visits, as indices, in which the object stands on something."""
    return [k for k, visit in enumerate(visits) if world.object_rests(visit.task.T_world_object)]


def holdings(
    world: BulletWorld, visits: Sequence[TaskVisit], progress: Progress | None, turned: float = 0.0
) -> Iterator[tuple[list[PlanTask], Planner]]:
    """Yield grasps for a sequence, best first, with configurations in which nothing collides.

    Turning the object and all grasps on it by the same angle changes nothing, so the object can
    stand in the first task as it is ``turned`` already.

    Args:
        world: a world of the scene.
        visits: the tasks in order, with the maps of all their arms.
        progress: called with the finished share; may raise `Cancelled`.
        turned: turn (rad) of the object in the first task.

    Yields:
        The tasks as a plan states them, and what found them.

    Raises:
        NoPlanError: there are none; says why.
    """
    progress = progress and rising(progress)
    scene, maps = world.scene, [visit.maps for visit in visits]
    grid = next(iter(maps[0].values())).manifold
    runs = hold_runs(maps)
    pitches = [maps[run.tasks[0]][run.arm].pitches for run in runs]
    gaps = PrintGaps([scene.arm(run.arm) for run in runs], grid, pitches, progress)
    torsos = [SharedTorso(k, shared) for k, visit in enumerate(visits) for shared in visit.torsos]
    search = HoldingSearch(maps, gaps, torsos)
    finders = [_finder(world, visit) for visit in visits]
    placements = FreePlacements(search, finders, progress)
    found = False
    for placement in placements:
        found = True
        columns = round(turned / grid.dtheta)
        common = columns - placement.steps[0].turn
        holds = [
            [
                Held(q, m, cell, cell.turned(-step.turn - common, grid.angles))
                for q, m, cell in zip(step.configurations, step.maps, step.cells, strict=True)
            ]
            for step in placement.steps
        ]
        azimuths = {
            (k, own.configuration.arm.name): _azimuth(own) for k, held in enumerate(holds) for own in held
        }
        more, grasps = offsets(search.holds, search.groups, azimuths, turned - columns * grid.dtheta)
        entries = []
        for k, (visit, step, held) in enumerate(zip(visits, placement.steps, holds, strict=True)):
            runs = zip(search.holds, grasps, strict=True)
            offset = {run.arm: own for run, own in runs if k in run.tasks}
            held = [own._replace(offset=offset[own.configuration.arm.name]) for own in held]
            delta = float(wrap((step.turn + common) * grid.dtheta + more[k]))
            if progress:
                progress(0.0)  # writing measures distances
            entries.append(write_task(world, visit.task, delta, held))
        yield (
            entries,
            Planner(
                algorithm="exact",
                statistics={
                    "placements": placements.tried,
                    "body_checks": sum(finder.body_checks for finder in finders),
                },
            ),
        )
    if not found:
        raise _why_not(world, visits, placements.tried)


def _finder(world: BulletWorld, visit: TaskVisit) -> ConfigurationFinder:
    by_torso = {arm: maps for shared in visit.torsos for arm, maps in shared.items()}
    arms = [world.scene.arm(name) for name in visit.maps]
    return ConfigurationFinder(world, arms, list(visit.maps.values()), by_torso)


def _why_not(world: BulletWorld, visits: Sequence[TaskVisit], tried: int) -> NoPlanError:
    """Return the error that says why a sequence has no grasps.

    Args:
        world: a world of the scene.
        visits: the tasks in order, with the maps of all their arms.
        tried: how many placements of the hands were tried with the whole robots.
    """
    runs = hold_runs([visit.maps for visit in visits])
    if len(runs) == 1 and not tried:
        maps = [visit.maps[runs[0].arm] for visit in visits]
        return ConflictError(find_conflict(maps, _resting(world, visits)))
    for visit in visits:
        for arm, m in visit.maps.items():
            if not m.feasible.any():
                return NoPlanError(f"no grasp of {arm} is feasible in task {visit.task.name}")
    if tried:
        return NoPlanError(
            f"no placement exists on this grid: the hands are apart in {tried}, "
            "but the arms meet in every configuration of each"
        )
    for run in runs:
        alone = [visits[k].maps[run.arm] for k in run.tasks]
        if not np.logical_and.reduce([m.feasible.any(axis=2) for m in alone]).any():
            return ConflictError(find_conflict(alone))  # another arm may hold the object: no regrasps
    return NoPlanError("no placement exists on this grid: wherever all arms can hold, their hands meet")


def climb(
    world: BulletWorld,
    visit: TaskVisit,
    seed: int,
    limits: Climb,
    progress: Progress | None,
    trace: list[ClimbStep] | None,
) -> tuple[PlanTask, Planner]:
    """Place the hands of one task by Algorithm 3.

    Args:
        world: a world of the scene.
        visit: the task, with the maps of all its arms.
        seed: of the random choices.
        limits: how long to search.
        progress: called with the share of restarts used; may raise `Cancelled`.
        trace: receives every step of the search.

    Returns:
        The task as a plan states it, and what found it.

    Raises:
        NoPlanError: it finds nothing.
    """
    # Algorithm 3 knows no torso: it places the hands at one value of each after the other.
    reason = NoPlanError(f"no value of a torso serves all arms of task {visit.task.name}")
    choices = list(product(*(range(len(next(iter(shared.values())))) for shared in visit.torsos)))
    for k, samples in enumerate(choices):
        at = zip(visit.torsos, samples, strict=True)
        fixed = {arm: maps[t] for shared, t in at for arm, maps in shared.items()}
        try:
            part = part_of(progress, k, len(choices))
            return _climb(world, visit, {**visit.maps, **fixed}, seed, limits, part, trace)
        except NoPlanError as error:
            reason = error
    raise reason


def _climb(
    world: BulletWorld,
    visit: TaskVisit,
    maps_of: Mapping[str, FeasibilityMap],
    seed: int,
    limits: Climb,
    progress: Progress | None,
    trace: list[ClimbStep] | None,
) -> tuple[PlanTask, Planner]:
    """Place the hands of one task on one map an arm; see `climb`."""
    arms = [world.scene.arm(name) for name in maps_of]
    maps = list(maps_of.values())
    configurations = ConfigurationFinder(world, arms, maps)

    def bodies_free(cells: Sequence[Cell]) -> bool:
        return configurations.find(cells, every=False) is not None

    found = hill_climb(maps, arms, bodies_free, seed, limits, progress, trace=trace)
    if progress:
        progress(1.0)
    held = [
        Held(configuration, m, cell, cell)
        for configuration, m, cell in zip(witnesses(arms, maps, found.cells), maps, found.cells, strict=True)
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
    return write_task(world, visit.task, 0.0, held), planner
