"""Several hands on one object, completely: the best placements first, and proof where there is none."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility import Cell, FeasibilityMap
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.sequential import check_same_grid, surface_margin
from symgrasp.poses import Array

__all__ = ["ScoredPlacement", "best_placements"]


class ScoredPlacement(NamedTuple):
    """A feasible cell for every arm, with prints that share no cell.

    Attributes:
        cells: one cell an arm, in the order of the maps.
        score: the smallest (m) of the gaps between prints and of the margins of the cells.
    """

    cells: tuple[Cell, ...]
    score: float


class _Choice(NamedTuple):
    """Cells for the first arms, and the next arm's cells in the order of the score they leave."""

    cells: tuple[Cell, ...]
    order: np.ndarray
    scores: Array


def best_placements(maps: Sequence[FeasibilityMap], gaps: PrintGaps) -> Iterator[ScoredPlacement]:
    """Yield every placement of the hands whose prints share no cell, best score first.

    Best-first search, one arm after the other. The score of a partial placement bounds that of
    all its completions, so whatever is yielded first is the best, and when nothing is yielded
    nothing exists on this grid.

    Args:
        maps: one map an arm, all over the same grid.
        gaps: the gaps between the arms' prints.

    Raises:
        InputError: the grids differ.
    """
    check_same_grid(maps)
    margins = [np.where(m.feasible, surface_margin(m), -1.0) for m in maps]
    shape = margins[0].shape
    tie = count()
    heap: list[tuple[float, int, int, int, _Choice]] = []

    def push(choice: _Choice, position: int) -> None:
        if position < len(choice.order):
            # Of equal scores the fuller placement comes first, so that the search goes deep.
            entry = (-choice.scores[position], -len(choice.cells), next(tie), position, choice)
            heapq.heappush(heap, entry)

    push(_children((), np.inf, margins, gaps), 0)
    while heap:
        negative, _, _, position, choice = heapq.heappop(heap)
        push(choice, position + 1)
        cell = Cell(*(int(k) for k in np.unravel_index(choice.order[position], shape)))
        cells = (*choice.cells, cell)
        if len(cells) == len(maps):
            yield ScoredPlacement(cells, -negative)
        else:
            push(_children(cells, -negative, margins, gaps), 0)


def _children(cells: tuple[Cell, ...], score: float, margins: Sequence[Array], gaps: PrintGaps) -> _Choice:
    """Rate every cell of the next arm given the cells of the arms before it."""
    arm = len(cells)
    rated = np.minimum(margins[arm], score)
    for other, cell in enumerate(cells):
        gap = gaps.around(other, cell.roll, cell.row, arm)
        rated = np.minimum(rated, np.roll(gap, cell.column, axis=2))
    flat = rated.ravel()
    valid = np.flatnonzero(flat >= 0)
    order = valid[np.argsort(-flat[valid], kind="stable")]
    return _Choice(cells, order, flat[order])
