"""Certified bounds on the distance of two convex pieces, by the method of Gilbert, Johnson and Keerthi (GJK).

For pieces A and B the method iterates in their Minkowski difference ``A − B``, whose distance from the
origin is the distance of the pieces. At every step it has

* a point v of the difference, as a convex combination of differences of vertices: so the pieces are at
  most ``|v|`` apart, however v was chosen;
* the extreme point w of the difference in direction −v: all of the difference lies beyond the plane
  through w perpendicular to v, so the pieces are at least ``v·w / |v|`` apart, however v was chosen;
* where four differences of vertices surround the origin, the radius of a ball around the origin
  inside their tetrahedron: the pieces penetrate each other by at least that.

So the bounds hold up to the rounding of a few sums and products (1e-14 m here), whether or not the method
has converged, and the iteration stops as soon as one of them suffices.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.collision.boxes import oriented_boxes_gap
from symgrasp.collision.pieces import SEED_GRID
from symgrasp.collision.simplex import FAST, SURROUNDS, depth_inside, reduce_to_nearest
from symgrasp.compiling import njit

__all__ = ["distance_bounds", "distance_bounds_from"]

STEPS = 40
"""Largest number of iterations; the bounds at that point are returned."""

CLOSE = 0.03
"""Relative precision at which a clearance is precise enough."""


@njit(**FAST)
def distance_bounds(pieces, pose, a, b, enough, sure, little, work):
    """Return a lower and an upper bound (m) of the distance of two pieces.

    The faces of the boxes around them are tried first. They tell most pieces apart that are not close, and
    the one that comes nearest to it faces the other piece, so the iterations begin across it.

    Args:
        pieces: the arrays of `PackedPieces`, as a tuple.
        pose: (P, 12) pose of each piece, see `pose_rows`.
        a: index of a piece.
        b: index of another piece.
        enough: stop when the lower bound is at least this (m).
        sure: stop when the lower bound is at least this (m) and the bounds are close, see `CLOSE`.
        little: stop when the upper bound is below this (m).
        work: (4, 3) the simplex, overwritten.

    Returns:
        The bounds. Where the pieces overlap the upper one is negative and the lower one -inf; where the boxes
        around them are far enough apart, the upper one is inf.
    """
    gap, (v0, v1, v2) = oriented_boxes_gap(pieces.size, pose, a, b, enough)
    if gap >= enough:
        return gap, math.inf
    lower, upper, _ = distance_bounds_from(
        pieces, pose, a, b, enough, sure, little, work, (v0, v1, v2, -1, -1)
    )
    return lower, upper


@njit(**FAST)
def distance_bounds_from(pieces, pose, a, b, enough, sure, little, work, begin):
    """Return the bounds of `distance_bounds`, and where to begin when the pieces have hardly moved since.

    Args:
        pieces, pose, a, b, enough, sure, little, work: see `distance_bounds`.
        begin: a direction (3,) from b to a, and vertices of both to climb from, -1 where none are known: what
            was returned when the pieces had almost the same poses, which is almost always enough, or the
            direction of `oriented_boxes_gap`.

    Returns:
        The bounds, and the last direction with its vertices.
    """
    vertices, edge_start, edges, seeds, index, size = pieces
    thick = size[a, 0] + size[b, 0]
    enough += thick
    sure += thick
    little += thick
    v0, v1, v2, at_a, at_b = begin
    square = v0 * v0 + v1 * v1 + v2 * v2
    if square < 1e-24:
        v0, v1, v2, square = 1.0, 0.0, 0.0, 1.0
    lower, upper = -math.inf, math.inf
    count = 0
    for _ in range(STEPS):
        x0, x1, x2, at_a = _extreme(
            vertices, edge_start, edges, seeds, index, size, pose, a, -v0, -v1, -v2, at_a
        )
        y0, y1, y2, at_b = _extreme(
            vertices, edge_start, edges, seeds, index, size, pose, b, v0, v1, v2, at_b
        )
        w0, w1, w2 = x0 - y0, x1 - y1, x2 - y2
        length = math.sqrt(square)
        lower = max(lower, (v0 * w0 + v1 * w1 + v2 * w2) / length)
        if lower >= enough:
            break
        if lower >= sure and lower >= (1.0 - CLOSE) * upper:
            break
        if upper - lower <= 1e-12:
            break
        for k in range(count):
            if work[k, 0] == w0 and work[k, 1] == w1 and work[k, 2] == w2:
                # w is in the simplex already: converged
                return lower - thick, upper - thick, (v0, v1, v2, at_a, at_b)
        work[count, 0], work[count, 1], work[count, 2] = w0, w1, w2
        count += 1
        if count == 4:
            deep = depth_inside(work)
            if deep > SURROUNDS:
                return -math.inf, -deep - thick, (v0, v1, v2, at_a, at_b)
        count, v0, v1, v2 = reduce_to_nearest(work, count)
        square = v0 * v0 + v1 * v1 + v2 * v2
        upper = min(upper, math.sqrt(square))
        if upper < little:
            break
        if square < 1e-24:
            break
    return lower - thick, upper - thick, (v0, v1, v2, at_a, at_b)


@njit(**FAST)
def _extreme(vertices, edge_start, edges, seeds, index, size, pose, k, d0, d1, d2, at):
    """Return the extreme point of piece k along a direction, and its vertex, to start from next time."""
    e0 = pose[k, 0] * d0 + pose[k, 3] * d1 + pose[k, 6] * d2
    e1 = pose[k, 1] * d0 + pose[k, 4] * d1 + pose[k, 7] * d2
    e2 = pose[k, 2] * d0 + pose[k, 5] * d1 + pose[k, 8] * d2
    if size[k, 2] > 0.0:
        x0, x1, x2 = _extreme_revolved(vertices, index[k, 0], index[k, 1], e0, e1, e2)
    else:
        row = index[k, 2]
        if row < 0:
            at = _best(vertices, index[k, 0], index[k, 1], e0, e1, e2)
        else:
            if at < 0:
                at = np.int64(seeds[row, _seed(e0, e1, e2)])
            at = _climb(vertices, edge_start, edges, at, e0, e1, e2)
        x0, x1, x2 = vertices[at, 0], vertices[at, 1], vertices[at, 2]
    return (
        pose[k, 0] * x0 + pose[k, 1] * x1 + pose[k, 2] * x2 + pose[k, 9],
        pose[k, 3] * x0 + pose[k, 4] * x1 + pose[k, 5] * x2 + pose[k, 10],
        pose[k, 6] * x0 + pose[k, 7] * x1 + pose[k, 8] * x2 + pose[k, 11],
        at,
    )


@njit(**FAST)
def _best(vertices, first, end, e0, e1, e2):
    """Return the extreme vertex from first to before end along a direction, by trying all."""
    at = first
    best = -math.inf
    for i in range(first, end):
        value = vertices[i, 0] * e0 + vertices[i, 1] * e1 + vertices[i, 2] * e2
        if value > best:
            best, at = value, i
    return np.int64(at)


@njit(**FAST)
def _climb(vertices, edge_start, edges, at, e0, e1, e2):
    """Return the extreme vertex along a direction, by hill climbing: on a hull a local maximum is global."""
    here = np.uint32(at)
    best = vertices[here, 0] * e0 + vertices[here, 1] * e1 + vertices[here, 2] * e2
    while True:
        top = here
        for j in range(edge_start[here], edge_start[here + np.uint32(1)]):
            i = edges[j]
            value = vertices[i, 0] * e0 + vertices[i, 1] * e1 + vertices[i, 2] * e2
            if value > best:
                best, top = value, i
        if top == here:
            return np.int64(here)
        here = top


@njit(**FAST)
def _extreme_revolved(vertices, first, end, e0, e1, e2):
    """Return the extreme point of a revolved piece along a direction."""
    flat = math.sqrt(e0 * e0 + e1 * e1)
    radius, height, best = 0.0, 0.0, -math.inf
    for i in range(first, end):
        value = vertices[i, 0] * flat + vertices[i, 2] * e2
        if value > best:
            best, radius, height = value, vertices[i, 0], vertices[i, 2]
    if flat == 0.0:
        return radius, 0.0, height
    return radius * e0 / flat, radius * e1 / flat, height


@njit(**FAST)
def _seed(e0, e1, e2):
    """Return the index of the cell on the cube, see `SEED_GRID`, that a direction points to."""
    a0, a1, a2 = abs(e0), abs(e1), abs(e2)
    if a0 >= a1 and a0 >= a2:
        face, along, u, v = 0, e0, e1, e2
    elif a1 >= a2:
        face, along, u, v = 2, e1, e2, e0
    else:
        face, along, u, v = 4, e2, e0, e1
    if along < 0.0:
        face += 1
    along = abs(along)
    if along == 0.0:
        return 0
    i = min(int((u / along + 1.0) * (0.5 * SEED_GRID)), SEED_GRID - 1)
    j = min(int((v / along + 1.0) * (0.5 * SEED_GRID)), SEED_GRID - 1)
    return (face * SEED_GRID + i) * SEED_GRID + j
