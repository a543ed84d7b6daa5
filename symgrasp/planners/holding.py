"""Any sequence of tasks for any arms: who holds the object when, and where.

An arm keeps its grasp (h, θ, roll) as long as it holds on, which is a *hold*: a run of consecutive
tasks. In every task the object may be turned about its axis, the same for all arms in it; that
turn is a whole number of columns, k. So task by task, all arms in it must be feasible on their own
maps at ``column + k``, and hold by hold, prints that are on the object together must not share a
cell. One grasp for a sequence and several hands in one task are the two special cases: one hold
over all tasks, and one task with a hold for every arm.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from numba import njit

from symgrasp.feasibility import Cell, FeasibilityMap
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.sequential import check_same_grid, surface_margin
from symgrasp.poses import Array

__all__ = ["HoldRun", "Holding", "HoldingSearch", "hold_runs"]


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
            the margins of the arms in it.
    """

    cells: tuple[Cell, ...]
    score: float


def hold_runs(tasks: Sequence[Sequence[str]]) -> list[HoldRun]:
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


class HoldingSearch:
    """Finds grasps for all holds of a sequence, completely and best first.

    Args:
        maps: (index of the task, name of the arm) → map, all over the same grid.
        holds: the holds.
        gaps: the gaps between the prints of the holds' arms, in the order of the holds.

    Raises:
        InputError: the grids differ.
    """

    def __init__(
        self, maps: Mapping[tuple[int, str], FeasibilityMap], holds: Sequence[HoldRun], gaps: PrintGaps
    ) -> None:
        check_same_grid(list(maps.values()))
        self.holds, self.gaps = holds, gaps
        self._margins = {key: np.where(m.feasible, surface_margin(m), -1.0) for key, m in maps.items()}
        self._shape = next(iter(self._margins.values())).shape

    def best_first(self) -> Iterator[Holding]:
        """Yield every choice of grasps whose prints are apart and that is feasible at some turn of each task.

        Best-first search, one hold after the other: what a partial choice reaches bounds all its
        completions, so the first is the best, and nothing yielded means that nothing exists.
        Turning all grasps and tasks of the sequence together changes nothing, so a hold that
        shares no task with an earlier one keeps one column.
        """
        tie = count()
        heap: list[tuple[float, int, int, int, tuple[Cell, ...], np.ndarray, Array]] = []

        def push(cells: tuple[Cell, ...], order: np.ndarray, scores: Array, position: int) -> None:
            if position < len(order):
                # Of equal scores the fuller choice comes first, so that the search goes deep.
                entry = (-scores[position], -len(cells), next(tie), position, cells, order, scores)
                heapq.heappush(heap, entry)

        push((), *self._rate((), np.inf), 0)
        while heap:
            negative, _, _, position, cells, order, scores = heapq.heappop(heap)
            push(cells, order, scores, position + 1)
            cell = Cell(*(int(k) for k in np.unravel_index(order[position], self._shape)))
            chosen = (*cells, cell)
            if len(chosen) == len(self.holds):
                yield Holding(chosen, float(-negative))
            else:
                push(chosen, *self._rate(chosen, -negative), 0)

    def turns(self, cells: Sequence[Cell], task: int) -> list[int]:
        """Return the turns k (columns) at which all arms of a task are feasible, best margin first."""
        rows = self._rows(cells, task)
        worst = np.min(rows, axis=0)
        valid = np.flatnonzero(worst >= 0)
        return valid[np.argsort(-worst[valid], kind="stable")].tolist()

    def _rows(self, cells: Sequence[Cell], task: int) -> list[Array]:
        """Return for each hold chosen so far that is in a task its margins (A,) by the turn k."""
        return [
            np.roll(self._margins[task, hold.arm][cell.roll, cell.row], -cell.column)
            for hold, cell in zip(self.holds, cells, strict=False)
            if task in hold.tasks
        ]

    def _rate(self, cells: tuple[Cell, ...], score: float) -> tuple[np.ndarray, Array]:
        """Rate every grasp of the next hold given those before it; returns flat indices and scores."""
        index = len(cells)
        hold = self.holds[index]
        rated = np.full(self._shape, score)
        for task in hold.tasks:
            own, others = self._margins[task, hold.arm], self._rows(cells, task)
            rated = np.minimum(rated, _best_turn(own, np.min(others, axis=0)) if others else _any_turn(own))
        partners = [k for k, other in enumerate(self.holds[:index]) if set(other.tasks) & set(hold.tasks)]
        for k in partners:
            gap = self.gaps.around(k, cells[k].roll, cells[k].row, index)
            rated = np.minimum(rated, np.roll(gap, cells[k].column, axis=2))
        if not partners:  # keep the column at which the first task needs no turn
            first = self._margins[hold.tasks[0], hold.arm].argmax(axis=2)
            rated = np.where(np.arange(self._shape[2]) == first[..., None], rated, -1.0)
        flat = rated.ravel()
        valid = np.flatnonzero(flat >= 0)
        order = valid[np.argsort(-flat[valid], kind="stable")]
        return order, flat[order]


def _any_turn(margins: Array) -> Array:
    """Return the best margin (R, H, A) over all turns, the same for every column."""
    return np.broadcast_to(margins.max(axis=2, keepdims=True), margins.shape)


@njit(cache=True)
def _best_turn(margins, others):
    """Return for every grasp (R, H, A) the worse of its and the others' margins, at the best turn.

    Turns are tried by falling margin of the others (A,), so most of them are never looked at.
    """
    rolls, heights, angles = margins.shape
    order = np.argsort(-others)
    best = np.full(margins.shape, -1.0)
    for r in range(rolls):
        for i in range(heights):
            for j in range(angles):
                for k in order:
                    if others[k] <= best[r, i, j]:
                        break
                    best[r, i, j] = max(best[r, i, j], min(margins[r, i, (j + k) % angles], others[k]))
    return best
