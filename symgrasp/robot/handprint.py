"""Handprints: the cells of the grasp manifold that a hand covers (figure 7 of the paper).

**Theorem.** Two hands whose prints share no cell do not touch.

*Proof.* Suppose that they share a point, at height h. Off the axis, f maps it to one (h, θ), and
a print holds every cell that the image of any point of its hand lies in: both prints hold that
cell. On the axis θ is undefined, and a shape with a point there covers all angles of its row:
both prints hold the whole row. Rows continue beyond both ends of the object, so every point has one.

The converse does not hold: a print does not hold distances from the axis, so hands whose prints
overlap may still be apart, one further out than the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symgrasp.object.manifold import Manifold, wrap
from symgrasp.poses import Array

__all__ = ["Handprint", "handprint", "hull_edges", "slab_corners"]

ROUNDING_MARGIN = 1e-9
"""Intervals are widened by this on both sides (m, rad), so that rounding never loses a touched cell."""

ON_AXIS = 1e-6
"""A point closer to the axis than this (m) counts as on it, because its angle is rounding noise."""


@dataclass(frozen=True, eq=False)
class Handprint:
    """The cells that a hand covers when it grasps a given row at column 0.

    Rows continue with the same height beyond both ends of the object, for hands that reach past an end.

    Attributes:
        cells: (rows, angles) bool, read-only; true where any point of the hand projects to.
        first_row: the manifold's row (negative below the object) that ``cells[0]`` lies on.
    """

    cells: np.ndarray
    first_row: int

    def overlap(self, other: Handprint, columns: int) -> int:
        """Return how many cells this print at column 0 shares with another print at column ``columns``."""
        first = max(self.first_row, other.first_row)
        last = min(self.first_row + len(self.cells), other.first_row + len(other.cells))
        if first >= last:
            return 0
        mine = self.cells[first - self.first_row : last - self.first_row]
        theirs = other.cells[first - other.first_row : last - other.first_row]
        return int(np.count_nonzero(mine & np.roll(theirs, columns, axis=1)))

    def on(self, manifold: Manifold, column: int) -> np.ndarray:
        """Return the covered cells (heights, angles) bool of the manifold, for a grasp at a column."""
        covered = np.zeros((manifold.heights, manifold.angles), dtype=bool)
        first, last = max(self.first_row, 0), min(self.first_row + len(self.cells), manifold.heights)
        if first < last:
            covered[first:last] = self.cells[first - self.first_row : last - self.first_row]
        return np.roll(covered, column, axis=1)


def handprint(hulls: Sequence[Array], manifold: Manifold, T_object_tool: Array) -> Handprint:
    """Project the convex hulls of a hand that grasps a row at column 0 onto the manifold.

    Exact for each hull and row, then rounded up to whole cells: the slice of a convex hull between
    two heights is convex, so it covers one interval of angles about the axis, which its corners bound,
    or every angle where the slice holds a point of the axis.

    Args:
        hulls: vertices (n, 3) of each convex hull in the tool frame, at the opening of the grasp.
        manifold: the grid.
        T_object_tool: pose (4, 4) of the tool in the object.
    """
    placed = [points @ T_object_tool[:3, :3].T + T_object_tool[:3, 3] for points in hulls]
    lowest = min(points[:, 2].min() for points in placed)
    highest = max(points[:, 2].max() for points in placed)
    to_row = lambda h: int(np.floor((h - manifold.profile.h_min) / manifold.dh))  # noqa: E731
    first, last = to_row(lowest - ROUNDING_MARGIN), to_row(highest + ROUNDING_MARGIN)
    cells = np.zeros((last - first + 1, manifold.angles), dtype=bool)
    for hull, points in zip(hulls, placed, strict=True):
        edges = _known_edges(hull.tobytes())  # of one opening they are the same wherever the hand is
        lowest, highest = points[:, 2].min(), points[:, 2].max()
        for row in range(to_row(lowest - ROUNDING_MARGIN), to_row(highest + ROUNDING_MARGIN) + 1):
            bottom = manifold.profile.h_min + row * manifold.dh
            corners = slab_corners(
                points, edges, bottom - ROUNDING_MARGIN, bottom + manifold.dh + ROUNDING_MARGIN
            )
            if len(corners):
                cells[row - first] |= _covered_columns(corners, manifold)
    cells.setflags(write=False)
    return Handprint(cells, first)


def hull_edges(points: Array) -> np.ndarray:
    """Return the index pairs (m, 2) of the edges of the triangulated convex hull of points (n, 3)."""
    from scipy.spatial import ConvexHull

    triangles = ConvexHull(points).simplices
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    low, high = np.sort(pairs, axis=1).astype(np.int64).T
    numbers = np.unique(low * len(points) + high)  # which is faster than of rows
    return np.stack(np.divmod(numbers, len(points)), axis=1)


@lru_cache(maxsize=1024)
def _known_edges(points: bytes) -> np.ndarray:
    return hull_edges(np.frombuffer(points).reshape(-1, 3))


def slab_corners(points: Array, edges: np.ndarray, bottom: float, top: float) -> Array:
    """Return the xy coordinates (n, 2) of the corners of a convex hull cut to ``bottom <= z <= top``."""
    inside = (points[:, 2] >= bottom) & (points[:, 2] <= top)
    corners = [points[inside, :2]]
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    for level in (bottom, top):
        crosses = (a[:, 2] - level) * (b[:, 2] - level) < 0
        s = (level - a[crosses, 2]) / (b[crosses, 2] - a[crosses, 2])
        corners.append(a[crosses, :2] + s[:, None] * (b[crosses, :2] - a[crosses, :2]))
    return np.concatenate(corners)


def _covered_columns(corners: Array, manifold: Manifold) -> np.ndarray:
    """Return which columns (angles,) the convex hull of xy points (n, 2) covers, for a grasp at column 0."""
    distance = np.hypot(corners[:, 0], corners[:, 1])
    angles = np.arctan2(corners[:, 1], corners[:, 0])
    relative = wrap(angles - angles[0])
    low, high = relative.min() - ROUNDING_MARGIN, relative.max() + ROUNDING_MARGIN
    # A convex region spans half a turn or more exactly when it contains the axis.
    if distance.min() < ON_AXIS or high - low >= np.pi:
        return np.ones(manifold.angles, dtype=bool)
    columns = np.zeros(manifold.angles, dtype=bool)
    first = int(np.floor((angles[0] + low) / manifold.dtheta + 0.5))
    last = int(np.floor((angles[0] + high) / manifold.dtheta + 0.5))
    columns[np.arange(first, last + 1) % manifold.angles] = True
    return columns
