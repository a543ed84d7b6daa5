"""How far apart two handprints are, for every pair of grasps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from symgrasp.manifold import ROLLS, Manifold
from symgrasp.poses import Array
from symgrasp.robot import Arm

__all__ = ["OVERLAP", "GapTable", "PrintGaps"]

OVERLAP = -1.0
"""The gap of prints that share a cell."""


class GapTable(NamedTuple):
    """The gaps between all prints of two arms.

    A line is a roll and a row: roll · heights + row. L lines, A angles.

    Attributes:
        row: (L, L) where in ``gaps`` a pair of lines is: those of the first arm by those of the second.
        gaps: (K, A) gaps (m) by the second column less the first.
    """

    row: np.ndarray
    gaps: Array


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
        self.arms, self.grid = arms, grid
        self._kind = cache(self._kind_of)
        self._shapes = cache(self._shapes_of)
        self._between = cache(self._compute)

    def table(self, a: int, b: int) -> GapTable:
        """Return the gaps between all prints of arms a and b."""
        return self._between(self._kind(a), self._kind(b))

    def around(self, a: int, roll: int, row: int, b: int) -> Array:
        """Return the gaps (R, H, A) from arm a's print at a roll, row and column 0 to all prints of arm b."""
        table, heights = self.table(a, b), self.grid.heights
        return table.gaps[table.row[roll * heights + row]].reshape(len(ROLLS), heights, -1)

    def _kind_of(self, a: int) -> int:
        """Return the first arm whose hand is the same as that of arm a."""
        return next(k for k in range(a + 1) if k == a or _same_hand(self.arms[k], self.arms[a], self.grid))

    def _shapes_of(self, a: int) -> tuple[np.ndarray, list[tuple[np.ndarray, int]]]:
        """Return the shape of each line's print (L,), and the shapes: cells, first row less the line's."""
        known: dict[tuple, int] = {}
        shapes, ids = [], []
        for roll, row in np.ndindex(len(ROLLS), self.grid.heights):
            p = self.arms[a].handprint(self.grid, row, roll)
            key = (p.first_row - row, p.cells.shape, p.cells.tobytes())
            if key not in known:
                known[key] = len(shapes)
                shapes.append((p.cells, p.first_row - row))
            ids.append(known[key])
        return np.array(ids), shapes

    def _compute(self, a: int, b: int) -> GapTable:
        """The gap depends on the two shapes and on how many rows they are apart: each once."""
        (ids_a, shapes_a), (ids_b, shapes_b) = self._shapes(a), self._shapes(b)
        row = np.tile(np.arange(self.grid.heights), len(ROLLS))
        apart = row[None, :] - row[:, None]
        keys = np.stack([*np.broadcast_arrays(ids_a[:, None], ids_b[None, :], apart)], axis=-1)
        unique, inverse = np.unique(keys.reshape(-1, 3), axis=0, return_inverse=True)
        gaps = np.empty((len(unique), self.grid.angles))
        steps = (self.grid.dh, self.grid.dtheta * self.grid.profile.r_max)
        low = min(0, *(first for _, first in shapes_b)) - self.grid.heights
        high = self.grid.heights + max(first + len(cells) for cells, first in shapes_b)
        for s, (cells, first) in enumerate(shapes_a):
            around = np.zeros((max(high, first + len(cells)) - min(low, first), self.grid.angles), np.bool_)
            bottom = min(low, first)
            around[first - bottom : first - bottom + len(cells)] = cells
            field = _distance_field(around, *steps)
            for t in np.flatnonzero(unique[:, 0] == s):
                other, offset = shapes_b[unique[t, 1]]
                _smallest(field, other, int(unique[t, 2]) + offset - bottom, gaps[t])
        gaps.setflags(write=False)
        return GapTable(np.ascontiguousarray(inverse.reshape(apart.shape)), gaps)


def _same_hand(a: Arm, b: Arm, grid: Manifold) -> bool:
    """Whether two arms leave the same prints, as far as their bodies tell."""
    if a.hand != b.hand:
        return False
    openings = {a.hand.opening(float(radius)) for radius in grid.profile.radius(grid.h)}
    pairs = [zip(a.hand_bodies(o), b.hand_bodies(o), strict=True) for o in openings]
    return all(np.array_equal(x, y) for bodies in pairs for x, y in bodies)


@njit(cache=True)
def _distance_field(cells, dh, width):
    """Distance (m) of every cell of the grid to the nearest covered one; OVERLAP where covered."""
    rows, columns = cells.shape
    nearest = np.full((rows, columns), columns)  # columns to the nearest covered cell of the row
    for i in range(rows):
        if not cells[i].any():
            continue
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
def _smallest(field, cells, first, gaps):
    """Receive in gaps (A,) the smallest value of the field under cells (rows, A) turned to every column."""
    rows, columns = cells.shape
    gaps[:] = np.inf
    for e in range(rows):
        for c in range(columns):
            if cells[e, c]:
                for j in range(columns):
                    value = field[first + e, (c + j) % columns]
                    gaps[j] = min(gaps[j], value)
