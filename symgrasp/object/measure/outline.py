"""Outlines (h, r) of solids of revolution in a half-plane through the axis: simplification and distances."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from symgrasp.poses import Array

__all__ = ["distance_outside", "simplify"]

SPACING = 1e-4
"""Distance (m) of the samples on an outline that tell which segment a point is nearest to."""


def distance_outside(points: Array, outline: Array) -> Array:
    """Return the signed distances (n,) (m) of points from a solid of revolution, negative inside it.

    Args:
        points: (n, 2) as [h, r].
        outline: (m, 2) knots [h, r]; the ends are closed by flat discs.
    """
    closed = np.concatenate([[[outline[0, 0], 0.0]], outline, [[outline[-1, 0], 0.0]]])
    lengths = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    count = np.ceil(lengths / SPACING).astype(int) + 1
    segment = np.repeat(np.arange(len(lengths)), count)
    s = (np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)) / (count - 1).clip(1)[segment]
    samples = closed[segment] + s[:, None] * (closed[segment + 1] - closed[segment])
    nearest = segment[KDTree(samples).query(points)[1]]
    distance = np.full(len(points), np.inf)
    for step in (-1, 0, 1):
        k = np.clip(nearest + step, 0, len(lengths) - 1)
        distance = np.minimum(distance, _to_segment(points, closed[k], closed[k + 1]))
    h, r = points.T
    inside = (h >= outline[0, 0]) & (h <= outline[-1, 0]) & (r <= np.interp(h, *outline.T))
    return np.where(inside, -distance, distance)


def simplify(outline: Array, tolerance: float) -> Array:
    """Return a subset of the knots (n, 2) as [h, r] that keeps r(h) within a tolerance (m) everywhere.

    The algorithm of Ramer, Douglas and Peucker with the distance along r: the knot with the largest
    error is kept first, so shoulders stay sharp.
    """
    h, r = outline.T
    kept = np.zeros(len(outline), dtype=bool)
    kept[[0, -1]] = True
    stretches = [(0, len(outline) - 1)]
    while stretches:
        first, last = stretches.pop()
        if last - first < 2:
            continue
        ends, between = [first, last], slice(first + 1, last)
        error = np.abs(r[between] - np.interp(h[between], h[ends], r[ends]))
        worst = first + 1 + int(np.argmax(error))
        if error[worst - first - 1] > tolerance:
            kept[worst] = True
            stretches += [(first, worst), (worst, last)]
    return outline[kept]


def _to_segment(points: Array, start: Array, end: Array) -> Array:
    """Return the distances (n,) of points (n, 2) from one segment each."""
    run, offset = end - start, points - start
    length = np.maximum((run**2).sum(axis=-1), 1e-300)
    s = np.clip((offset * run).sum(axis=-1) / length, 0.0, 1.0)
    return np.linalg.norm(offset - s[:, None] * run, axis=-1)
