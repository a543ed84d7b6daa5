"""How far apart two handprints are, for every pair of grasps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.planners.passing import Hands
from symgrasp.poses import Array
from symgrasp.progress import Progress, at_start
from symgrasp.robot.handprint import Handprint
from symgrasp.robot.robot import Arm

__all__ = ["OVERLAP", "PASSING", "GapTable", "PrintGaps", "print_gap"]

OVERLAP = -1.0
"""The gap of prints that share a cell."""

PASSING = -0.25
"""The gap of prints that share a cell where the hands may pass each other, one behind the other."""


class GapTable(NamedTuple):
    """The gaps between all prints of two arms.

    A line is a roll and a row: roll · heights + row, with rolls as `FeasibilityMap.pitches` counts them.
    L and M lines, A angles.

    Attributes:
        row: (L, M) where in ``gaps`` a pair of lines is: those of the first arm by those of the second.
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
        pitches: of every arm the pitches (rad) that its maps have; see `FeasibilityMap.pitches`. Prints are
            those of a hand in the middle of its cell.
        progress: called with 0 between the lines of cells of which gaps are computed; may raise `Cancelled`.
    """

    def __init__(
        self,
        arms: Sequence[Arm],
        grid: Manifold,
        pitches: Sequence[Sequence[float]] | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.arms, self.grid, self._tell = arms, grid, at_start(progress)
        self._pitches = [own or (0.0,) for own in pitches or ((),) * len(arms)]
        self._kind = cache(self._kind_of)
        self._lines = cache(self._lines_of)
        self._between = cache(self._compute)
        self._passing = cache(self._compute_passing)

    def table(self, a: int, b: int) -> GapTable:
        """Return the gaps between all prints of arms a and b."""
        return self._between(self._kind(a), self._kind(b))

    def passing(self, a: int, b: int) -> GapTable:
        """Return the same with `PASSING` where the prints overlap and the hands do not meet for certain."""
        return self._passing(self._kind(a), self._kind(b))

    def around(self, a: int, roll: int, row: int, b: int) -> Array:
        """Return the gaps (R, H, A) from arm a's print at a roll, row and column 0 to all prints of arm b."""
        table, heights = self.table(a, b), self.grid.heights
        return table.gaps[table.row[roll * heights + row]].reshape(len(ROLLS), heights, -1)

    def _kind_of(self, a: int) -> int:
        """Return the first arm whose hand and pitches are the same as those of arm a."""
        for k in range(a):
            if self._pitches[k] == self._pitches[a] and _same_hand(self.arms[k], self.arms[a], self.grid):
                return k
        return a

    def _lines_of(self, a: int) -> tuple[np.ndarray, list[_Line]]:
        """Return which kind each line is (L,), and the kinds: lines that differ by their height alone."""
        known: dict[tuple[int, float, float], int] = {}
        kinds, ids = [], []
        for pitch, roll, row in product(self._pitches[a], range(len(ROLLS)), range(self.grid.heights)):
            radius = float(self.grid.profile.radius(self.grid.h[row]))
            key = (roll, pitch, radius)
            if key not in known:
                if self._tell:
                    self._tell(0.0)
                known[key] = len(kinds)
                p = self.arms[a].handprint(self.grid, row, roll, pitch)
                kinds.append(_Line(roll, pitch, radius, p.first_row - row, p.cells))
            ids.append(known[key])
        return np.array(ids), kinds

    def _pairs_of(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        """Return pairs (K, 3) of kinds of lines and rows apart, and which one two lines are (L, L)."""
        of_a, of_b = self._lines(a)[0], self._lines(b)[0]
        rows = [np.arange(len(lines)) % self.grid.heights for lines in (of_a, of_b)]
        kinds = np.broadcast_arrays(of_a[:, None], of_b, rows[1] - rows[0][:, None])
        unique, inverse = np.unique(np.stack(kinds, axis=-1).reshape(-1, 3), axis=0, return_inverse=True)
        return unique, np.ascontiguousarray(inverse.reshape(len(of_a), len(of_b)))

    def _compute(self, a: int, b: int) -> GapTable:
        pairs, row = self._pairs_of(a, b)
        gaps = np.empty((len(pairs), self.grid.angles))
        steps = (self.grid.dh, self.grid.dtheta * self.grid.profile.r_max)
        lines_a, lines_b = self._lines(a)[1], self._lines(b)[1]
        low = min(line.first for line in lines_b) - self.grid.heights
        high = max(line.first + len(line.cells) for line in lines_b) + self.grid.heights
        for kind, line in enumerate(lines_a):
            if self._tell:
                self._tell(0.0)
            bottom, top = min(low, line.first), max(high, line.first + len(line.cells))
            around = np.zeros((top - bottom, self.grid.angles), np.bool_)
            around[line.first - bottom : line.first - bottom + len(line.cells)] = line.cells
            field = _distance_field(around, *steps)
            for t in np.flatnonzero(pairs[:, 0] == kind):
                other = lines_b[pairs[t, 1]]
                _smallest(field, other.cells, int(pairs[t, 2]) + other.first - bottom, gaps[t])
        gaps.setflags(write=False)
        return GapTable(row, gaps)

    def _compute_passing(self, a: int, b: int) -> GapTable:
        pairs, row = self._pairs_of(a, b)
        gaps = self._between(a, b).gaps.copy()
        hands = cache(lambda *radii: Hands(self._bodies(a, radii[0]), self._bodies(b, radii[1])))
        for t, (kind_a, kind_b, apart) in enumerate(pairs.tolist()):
            overlap = gaps[t] == OVERLAP
            if overlap.any():
                if self._tell:
                    self._tell(0.0)
                line_a, line_b = self._lines(a)[1][kind_a], self._lines(b)[1][kind_b]
                tools = self._tool(a, line_a, 0.0), self._tool(b, line_b, apart * self.grid.dh)
                meet = hands(line_a.radius, line_b.radius).meet(*tools, overlap)
                gaps[t, overlap & ~meet] = PASSING
        gaps.setflags(write=False)
        return GapTable(row, gaps)

    def _bodies(self, a: int, radius: float) -> list[Array]:
        """Return the bodies of a hand in its tool frame, open for a radius (m)."""
        return self.arms[a].hand_hulls(self.arms[a].hand.opening(radius))

    def _tool(self, a: int, line: _Line, h: float) -> Array:
        """Return the tool pose (4, 4) on the object at column 0 and a height (m)."""
        hand = self.arms[a].hand
        return hand.tool_pose(np.eye(4), h, 0.0, ROLLS[line.roll], line.radius, line.pitch)


class _Line(NamedTuple):
    """A hand at a line: roll, pitch (rad), radius (m), first row of its print less its own, and print."""

    roll: int
    pitch: float
    radius: float
    first: int
    cells: np.ndarray


def print_gap(a: Handprint, b: Handprint, columns: int, grid: Manifold) -> float:
    """Return the gap (m) between two prints, the second at ``columns`` more than the first; see `PrintGaps`.

    For a single pair: `PrintGaps` computes those of all at once.
    """
    first, second = (np.argwhere(p.cells) + np.array([p.first_row, 0]) for p in (a, b))
    rows, turned = np.abs(np.moveaxis(first[:, None] - second - [0, columns], -1, 0))
    turned %= grid.angles
    apart = np.minimum(turned, grid.angles - turned)
    if np.any((rows == 0) & (apart == 0)):
        return OVERLAP
    along = np.maximum(rows - 1, 0) * grid.dh
    around = np.maximum(apart - 1, 0) * grid.dtheta * grid.profile.r_max
    return float(np.maximum(along, around).min())


def _same_hand(a: Arm, b: Arm, grid: Manifold) -> bool:
    """Whether two arms leave the same prints, as far as their bodies tell."""
    if a.hand != b.hand:
        return False
    openings = {a.hand.opening(float(radius)) for radius in grid.profile.radius(grid.h)}
    pairs = [zip(a.hand_hulls(o), b.hand_hulls(o), strict=True) for o in openings]
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
