"""Any sequence of tasks for any arms: who holds the object when, and where.

An arm keeps its grasp (h, θ, roll) as long as it holds on, which is a *hold*: a run of consecutive
tasks. In every task the object may be turned about its axis, the same for all arms in it; that
turn is a whole number of columns, k. So task by task, all arms in it must be feasible on their own
maps at ``column + k``, and hold by hold, hands that are on the object together must be apart: best
where their prints share no cell, and failing that where the hands themselves do not meet. Where
nobody holds on from one task to the next, the object stands still, and both tasks have one turn.
One grasp for a sequence and several hands in one task are the two special cases: one hold over all
tasks, and one task with a hold for every arm.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.planners.column_sets import doubled
from symgrasp.planners.gaps import GapTable, PrintGaps
from symgrasp.planners.placements import Problem, best_placement, placements_of
from symgrasp.planners.ruled_out import Grasp, RuledOut
from symgrasp.planners.sequential import check_same_grid, clearance_steps
from symgrasp.planners.stations import SharedTorso, Station, Turn, best_turns
from symgrasp.poses import Array

__all__ = ["HoldRun", "Holding", "HoldingSearch", "hold_runs", "turn_groups"]

LOWEST = -0.5
"""Below the score of every placement, above that of none: `PASSING` counts, `OVERLAP` does not."""


INFEASIBLE = -1.0
"""A margin below that of everything feasible."""


class HoldRun(NamedTuple):
    """An arm that keeps one grasp over consecutive tasks.

    Attributes:
        arm: name of the arm.
        tasks: indices of the tasks.
    """

    arm: str
    tasks: range


class Holding(NamedTuple):
    """A grasp for every hold.

    Attributes:
        cells: the grasp (roll, row, column) of every hold, in the order of the holds.
        score: the smallest (m) of the gaps between prints and, task by task at its best turn, of
            the margins of the arms in it; `PASSING` where prints overlap.
    """

    cells: tuple[Cell, ...]
    score: float


def hold_runs(tasks: Sequence[Collection[str]]) -> list[HoldRun]:
    """Return the holds of a sequence, in the order in which they begin.

    Args:
        tasks: for every task the names of the arms in it.
    """
    holds = []
    for k, arms in enumerate(tasks):
        for arm in arms:
            if k and arm in tasks[k - 1]:
                continue
            end = next((j for j in range(k, len(tasks)) if arm not in tasks[j]), len(tasks))
            holds.append(HoldRun(arm, range(k, end)))
    return holds


def turn_groups(tasks: Sequence[Collection[str]]) -> list[list[int]]:
    """Return the tasks, as indices, in groups that have one turn: nobody holds on within a group.

    Args:
        tasks: for every task the names of the arms in it.
    """
    groups: list[list[int]] = []
    for k, arms in enumerate(tasks):
        if k and not set(arms) & set(tasks[k - 1]):
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


class HoldingSearch:
    """Finds grasps for all holds of a sequence, completely and best first.

    Args:
        visits: for every visit of a task, in order, arm → its map there; all over the same grid. A task
            is visited twice where the object is grasped anew in it.
        gaps: the gaps between the prints of the holds' arms, in the order of the holds.
        torsos: the torsos that several arms share in a visit.

    Raises:
        InputError: the grids differ.

    Attributes:
        holds: the holds, in the order in which they begin.
        groups: the tasks, as indices, in groups that have one turn.
        torsos: the torsos that several arms share in a visit.
    """

    def __init__(
        self,
        visits: Sequence[Mapping[str, FeasibilityMap]],
        gaps: PrintGaps,
        torsos: Sequence[SharedTorso] = (),
    ) -> None:
        maps = [m for visit in visits for m in visit.values()]
        check_same_grid(maps)
        self.holds, self.groups, self.gaps = hold_runs(visits), turn_groups(visits), gaps
        self.torsos = torsos
        self._shape = maps[0].feasible.shape
        self._stations = [
            station for g in range(len(self.groups)) for station in self._stations_of(g, visits)
        ]

    def _stations_of(self, g: int, visits: Sequence[Mapping[str, FeasibilityMap]]) -> Iterator[Station]:
        """Yield the stations of a group of tasks: one for each shared torso, one for all other arms."""
        alone: dict[int, list[list[FeasibilityMap]]] = {}
        for k in self.groups[g]:
            own = [t for t, torso in enumerate(self.torsos) if torso.visit == k]
            for t in own:
                shared = self.torsos[t].maps
                yield Station(g, t, {self._hold(k, arm): [shared[arm]] for arm in shared})
            for arm, m in visits[k].items():
                if not any(arm in self.torsos[t].maps for t in own):
                    alone.setdefault(self._hold(k, arm), []).append([m])
        if alone:
            yield Station(g, None, alone)

    def _hold(self, task: int, arm: str) -> int:
        """Return the hold of an arm in a task."""
        return next(h for h, hold in enumerate(self.holds) if hold.arm == arm and task in hold.tasks)

    def best_first(self) -> Iterator[Holding]:
        """Yield every choice of grasps that is feasible at some turn of each task, the hands apart.

        In falling order of the score, so the first is the best, and nothing yielded means that
        nothing exists. Last come those whose prints overlap and whose hands may still pass each
        other. Turning all grasps and tasks of the sequence together changes nothing, so the first
        hold keeps column 0. Of equal scores of a single hold, the larger clearance comes first, by
        `clearance_steps`.
        """
        if len(self.holds) == 1:
            yield from self._lines()
            return
        yield from self._below(np.inf, self._problem(self.gaps.table))
        if self._meetings:
            yield from self._below(0.0, self._problem(self.gaps.passing))

    def turns(self, cells: Sequence[Cell], group: int, enough: float = np.inf) -> list[Turn]:
        """Return the turns at which all arms of a group of tasks are feasible; see `best_turns`."""
        stations = [station for station in self._stations if station.group == group]
        return best_turns(stations, cells, self._shape[1], enough)

    def rule_out(self, task: int, a: tuple[str, Cell], b: tuple[str, Cell]) -> None:
        """Leave out placements for which two arms would have to hold these cells in a task.

        Args:
            task: its index.
            a: name and cell of an arm, with the object turned.
            b: those of another one.
        """
        group = next(g for g, (own, _) in enumerate(self._turned_together) if task in own)
        grasps = [
            Grasp(self._hold(task, arm), cell.roll * self._shape[1] + cell.row, cell.column)
            for arm, cell in (a, b)
        ]
        self._ruled_out.add(group, *grasps)

    @cached_property
    def _ruled_out(self) -> RuledOut:
        holds, lines = self._alone.shape
        return RuledOut(len(self._turned_together), holds, lines, self._shape[2])

    @cached_property
    def _turned_together(self) -> list[tuple[list[int], list[Station]]]:
        """The groups of tasks in which there is more than one hold, and their stations."""
        stations = [[s for s in self._stations if s.group == g] for g in range(len(self.groups))]
        return [
            (tasks, own)
            for tasks, own in zip(self.groups, stations, strict=True)
            if sum(len(s.margins) for s in own) > 1
        ]

    @cached_property
    def _alone(self) -> Array:
        """(n, L) what each line of each hold reaches at most; those of arms with fewer are filled up."""
        reached = [
            np.min([s.margins[h].max(axis=(0, 2)) for s in self._stations if h in s.margins], axis=0)
            for h in range(len(self.holds))
        ]
        return _filled(reached, INFEASIBLE)

    def _lines(self) -> Iterator[Holding]:
        """Yield every line of a single hold, in the order of `common_grasps`."""
        (alone,) = self._alone
        lines = np.flatnonzero(alone >= 0)
        clearance = [
            min(
                np.max(s.clearances[0][0, line], where=s.margins[0][0, line] >= alone[line], initial=0.0)
                for s in self._stations
            )
            for line in lines
        ]
        for k in np.lexsort((-clearance_steps(clearance), -alone[lines])):
            yield self._holding(np.array([[lines[k], 0]]), float(alone[lines[k]]))

    def _below(self, ceiling: float, problem: Problem) -> Iterator[Holding]:
        """Yield all placements whose score is below a ceiling, best first."""
        while best := best_placement(problem, self._ruled_out, LOWEST, ceiling):
            first, ceiling = best
            yield self._holding(first, ceiling)
            for place in placements_of(problem, self._ruled_out, ceiling):
                if not np.array_equal(place, first):
                    yield self._holding(place, ceiling)

    def _holding(self, place: np.ndarray, score: float) -> Holding:
        heights = self._shape[1]
        cells = (Cell(int(line) // heights, int(line) % heights, int(column)) for line, column in place)
        return Holding(tuple(cells), float(score))

    @cached_property
    def _meetings(self) -> list[tuple[int, int]]:
        """The pairs of holds that are on the object together."""
        pairs = combinations(range(len(self.holds)), 2)
        return [(a, b) for a, b in pairs if set(self.holds[a].tasks) & set(self.holds[b].tasks)]

    def _problem(self, gaps_of: Callable[[int, int], GapTable]) -> Problem:
        n, (_, _, angles) = len(self.holds), self._shape
        lines = self._alone.shape[1]
        several = [own for _, own in self._turned_together]
        stations = [s for own in several for s in own]
        groups = np.array([k for k, own in enumerate(several) for _ in own], dtype=np.int64)
        feasible = np.ones((len(several), n, lines, angles), dtype=bool)
        part = np.full((n, len(stations)), -1)
        margins = []
        for column, station in enumerate(stations):
            for h, margin in station.margins.items():
                part[h, column] = len(margins)
                margins.append(margin)
        values = max(map(len, margins), default=1)
        filled = _filled([*margins, np.empty((values, lines, angles))], INFEASIBLE)[:-1]
        for column, station in enumerate(stations):
            for h in station.margins:
                feasible[groups[column], h] = (filled[part[h, column]] >= 0).any(axis=0)
        table, rows, gaps, first = np.full((n, n), -1), [], [], 0
        for pair in self._meetings:
            found = gaps_of(*pair)
            table[pair] = len(rows)
            rows.append(found.row + first)
            gaps.append(found.gaps)
            first += len(found.gaps)
        return Problem(
            order=np.argsort(-self._alone, axis=1, kind="stable"),
            alone=self._alone,
            feasible=doubled(feasible),
            group=groups,
            part=part,
            margins=filled,
            table=table,
            row=_filled([*rows, np.empty((lines, lines), dtype=np.int64)], 0)[:-1],
            gaps=np.concatenate([np.empty((0, angles)), *gaps]),
        )


def _filled(arrays: Sequence[np.ndarray], value: float) -> np.ndarray:
    """Return arrays of different shapes as one, filled up with a value to the largest."""
    shape = np.max([array.shape for array in arrays], axis=0)
    filled = np.full((len(arrays), *shape), value, dtype=arrays[0].dtype)
    for own, array in zip(filled, arrays, strict=True):
        own[tuple(map(slice, array.shape))] = array
    return filled
