"""How far apart two handprints are, for every pair of grasps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numba import njit

from symgrasp.manifold import ROLLS, Manifold
from symgrasp.poses import Array
from symgrasp.robot import Arm

__all__ = ["PrintGaps"]

OVERLAP = -1.0
"""The gap of prints that share a cell."""


class PrintGaps:
    """The gaps between the handprints of arms on one object.

    The gap of two prints is how far (m) one may slide along the axis, and by as much of an arc at
    the object's largest radius around it, before they can share a cell: zero for prints that
    touch, `OVERLAP` for prints that share a cell already. It depends on the two heights and rolls
    and on the difference of the angles alone, so it belongs to the hands and the object, not to a
    map; it is computed where asked for and kept.

    Args:
        arms: the arms, in the order of the maps.
        grid: the grid of the maps.
    """

    def __init__(self, arms: Sequence[Arm], grid: Manifold) -> None:
        prints = [
            [[a.handprint(grid, i, r) for i in range(grid.heights)] for r in range(len(ROLLS))] for a in arms
        ]
        every = [p for arm in prints for roll in arm for p in roll]
        first = min((p.first_row for p in every), default=0)
        last = max((p.first_row + len(p.cells) for p in every), default=0)
        shape = (len(ROLLS), grid.heights, last - first, grid.angles)
        self._prints = [np.zeros(shape, dtype=np.bool_) for _ in arms]
        for k, arm in enumerate(prints):
            for r, i in np.ndindex(len(ROLLS), grid.heights):
                start = arm[r][i].first_row - first
                self._prints[k][r, i, start : start + len(arm[r][i].cells)] = arm[r][i].cells
        self.heights = grid.heights
        self._steps = (grid.dh, grid.dtheta * grid.profile.r_max)
        self._from = cache(self._compute)

    def around(self, a: int, roll: int, row: int, b: int) -> Array:
        """Return the gaps (R, H, A) from arm a's print at a roll, row and column 0 to all prints of arm b."""
        return self._from(a, roll, row, b)

    def _compute(self, a: int, roll: int, row: int, b: int) -> Array:
        field = _distance_field(self._prints[a][roll, row], *self._steps)
        return _smallest(field, self._prints[b])


@njit(cache=True)
def _distance_field(cells, dh, width):
    """Distance (m) of every cell of the grid to the nearest covered one; OVERLAP where covered."""
    rows, columns = cells.shape
    nearest = np.full((rows, columns), columns)  # columns to the nearest covered cell of the row
    for i in range(rows):
        for j in range(columns):
            for k in range(columns // 2 + 1):
                if cells[i, (j + k) % columns] or cells[i, (j - k) % columns]:
                    nearest[i, j] = k
                    break
    field = np.full((rows, columns), np.inf)
    for i in range(rows):
        for j in range(columns):
            for other in range(rows):
                if nearest[other, j] == columns:
                    continue
                if other == i and nearest[i, j] == 0:
                    field[i, j] = OVERLAP
                    break
                gap = max(max(abs(i - other) - 1, 0) * dh, max(nearest[other, j] - 1, 0) * width)
                field[i, j] = min(field[i, j], gap)
    return field


@njit(cache=True)
def _smallest(field, prints):
    """Smallest value of the field under each print (R, H, rows, A), turned to every column."""
    rolls, heights, rows, columns = prints.shape
    gaps = np.full((rolls, heights, columns), np.inf)
    for r in range(rolls):
        for i in range(heights):
            for e in range(rows):
                for c in range(columns):
                    if prints[r, i, e, c]:
                        for j in range(columns):
                            value = field[e, (c + j) % columns]
                            if value < gaps[r, i, j]:
                                gaps[r, i, j] = value
    return gaps
