"""What a hand holds: the largest cylinder that fits between its fingers, seen along the cylinder's axis.

Along that axis, x of the tool frame, fingers are polygons and the object is a disc. An object of radius r
is held with its axis at ``z = max(0, r - depth)`` of the tool frame (see `Hand.standoff`): at the tool frame,
or so far in front of it that its back is ``depth`` behind it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from symgrasp.poses import Array

__all__ = ["Outline", "held_radius", "outline"]

LARGEST_RADIUS = 1.0
"""Radii up to this (m) are looked for."""

HALVINGS = 30
"""Bisections of a radius: its error is `LARGEST_RADIUS` times two to the power of minus this."""


class Outline:
    """The convex hulls of some links, seen along an axis.

    Args:
        hulls: (n, 2) points of each in the plane: distance outwards from the plane between the fingers, and
            height z along the approach (m).

    Attributes:
        starts: (m, 2) starts of the edges of all polygons.
        ends: (m, 2) their ends.
        reach: the largest height z (m).
        covers_origin: whether a polygon contains the origin.
    """

    def __init__(self, hulls: Sequence[Array]) -> None:
        corners = [points[ConvexHull(points).vertices] for points in hulls]  # anticlockwise
        self.starts = np.concatenate(corners)
        self.ends = np.concatenate([np.roll(polygon, -1, axis=0) for polygon in corners])
        self.reach = float(self.starts[:, 1].max())
        self.covers_origin = any(_left_of_all(polygon) for polygon in corners)

    def distance(self, z: ArrayLike) -> Array:
        """Return the distances (...) (m) of the edges from the points (0, z), z (...)."""
        z = np.asarray(z, dtype=float)[..., None]
        (y0, z0), (along_y, along_z) = self.starts.T, (self.ends - self.starts).T
        share = ((z - z0) * along_z - y0 * along_y) / (along_y**2 + along_z**2)
        share = np.clip(share, 0, 1)
        return np.hypot(y0 + share * along_y, z0 + share * along_z - z).min(axis=-1)


def outline(hulls: Sequence[Array], outwards: float) -> Outline:
    """Return the outline along x of hulls (n, 3) in the tool frame.

    Args:
        hulls: their vertices.
        outwards: 1 or -1: the sign of y on this side of the plane between the fingers.
    """
    return Outline([points[:, 1:] * [outwards, 1.0] for points in hulls])


def _left_of_all(polygon: Array) -> bool:
    """Whether the origin is inside a convex polygon (n, 2) whose corners run anticlockwise."""
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    return bool((x0 * y1 - x1 * y0 >= 0).all())


def held_radius(side: Outline, depth: ArrayLike) -> Array:
    """Return the radii (...) (m) of the largest objects that one side of a hand leaves room for.

    Discs with their backs at the same depth lie inside each other, so a disc is free of the outline as long
    as its centre is further than its radius from every edge.

    Args:
        side: the outline of the fingers of that side.
        depth: how far (...) (m) an object may reach behind the tool frame.
    """
    depth = np.asarray(depth, dtype=float)
    low, high = np.zeros_like(depth), np.full_like(depth, LARGEST_RADIUS)
    if side.covers_origin:
        return low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        free = side.distance(np.maximum(0.0, middle - depth)) >= middle
        low, high = np.where(free, middle, low), np.where(free, high, middle)
    return low
