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
from typing import Any

import numpy as np

from symgrasp.compiling import njit
from symgrasp.engine.pieces import SEED_GRID

__all__ = ["FAST", "distance_bounds"]

FAST: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
"""Options of numba for code whose last bits do not matter: products and sums may be fused. The last one
switches off reference counting of arrays, which costs more than the functions themselves and is not
needed, because nothing here allocates arrays."""

STEPS = 40
"""Largest number of iterations; the bounds at that point are returned."""

CLOSE = 0.03
"""Relative precision at which a clearance is precise enough."""

SURROUNDS = 1e-9
"""A tetrahedron certainly surrounds the origin when its faces are at least this far (m) from it."""


@njit(**FAST)
def distance_bounds(pieces, pose, a, b, enough, sure, little, work):
    """Return a lower and an upper bound (m) of the distance of two pieces.

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
        The bounds. Where the pieces overlap the upper one is negative and the lower one -inf.
    """
    vertices, edge_start, edges, seeds, index, size = pieces
    thick = size[a, 0] + size[b, 0]
    enough += thick
    sure += thick
    little += thick
    ca, cb = _centre(size, pose, a), _centre(size, pose, b)
    v0, v1, v2 = ca[0] - cb[0], ca[1] - cb[1], ca[2] - cb[2]
    square = v0 * v0 + v1 * v1 + v2 * v2
    if square < 1e-24:
        v0, v1, v2, square = 1.0, 0.0, 0.0, 1.0
    at_a, at_b = -1, -1
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
                return lower - thick, upper - thick  # w is in the simplex already: converged
        work[count, 0], work[count, 1], work[count, 2] = w0, w1, w2
        count += 1
        if count == 4:
            deep = _depth(work)
            if deep > SURROUNDS:
                return -math.inf, -deep - thick
        count, v0, v1, v2 = _nearest(work, count)
        square = v0 * v0 + v1 * v1 + v2 * v2
        upper = min(upper, math.sqrt(square))
        if upper < little:
            break
        if square < 1e-24:
            break
    return lower - thick, upper - thick


@njit(**FAST)
def _centre(size, pose, k):
    """Return the centre of the box of piece k in the world."""
    c0, c1, c2 = size[k, 3], size[k, 4], size[k, 5]
    return (
        pose[k, 0] * c0 + pose[k, 1] * c1 + pose[k, 2] * c2 + pose[k, 9],
        pose[k, 3] * c0 + pose[k, 4] * c1 + pose[k, 5] * c2 + pose[k, 10],
        pose[k, 6] * c0 + pose[k, 7] * c1 + pose[k, 8] * c2 + pose[k, 11],
    )


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


@njit(**FAST)
def _nearest(w, count):
    """Reduce a simplex of some points to those that support its point nearest to the origin.

    Returns:
        Number of points kept, and the nearest point.
    """
    if count == 1:
        return 1, w[0, 0], w[0, 1], w[0, 2]
    if count == 2:
        return _nearest_on_line(w)
    if count == 3:
        return _nearest_on_triangle(w)
    return _nearest_on_tetrahedron(w)


@njit(**FAST)
def _nearest_on_line(w):
    """Reduce a segment; Ericson, Real-Time Collision Detection, 5.1.2. The last point is the newest."""
    d0, d1, d2 = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
    along = -(w[0, 0] * d0 + w[0, 1] * d1 + w[0, 2] * d2)
    square = d0 * d0 + d1 * d1 + d2 * d2
    if along <= 0.0:
        return 1, w[0, 0], w[0, 1], w[0, 2]
    if along >= square:
        _keep1(w, 1)
        return 1, w[0, 0], w[0, 1], w[0, 2]
    t = along / square
    return 2, w[0, 0] + t * d0, w[0, 1] + t * d1, w[0, 2] + t * d2


@njit(**FAST)
def _nearest_on_triangle(w):
    """Reduce a triangle; Ericson, Real-Time Collision Detection, 5.1.5."""
    s, t, kept = _triangle_weights(w, 0, 1, 2)
    x = (
        w[0, 0] + s * (w[1, 0] - w[0, 0]) + t * (w[2, 0] - w[0, 0]),
        w[0, 1] + s * (w[1, 1] - w[0, 1]) + t * (w[2, 1] - w[0, 1]),
        w[0, 2] + s * (w[1, 2] - w[0, 2]) + t * (w[2, 2] - w[0, 2]),
    )
    return _keep(w, 0, 1, 2, kept), x[0], x[1], x[2]


@njit(**FAST)
def _nearest_on_tetrahedron(w):
    """Reduce a tetrahedron to its face nearest to the origin, which is known not to be inside."""
    best, face, kept = math.inf, 0, 0
    x0, x1, x2 = 0.0, 0.0, 0.0
    for k in range(4):
        i, j, m = _face(k)
        s, t, mask = _triangle_weights(w, i, j, m)
        y0 = w[i, 0] + s * (w[j, 0] - w[i, 0]) + t * (w[m, 0] - w[i, 0])
        y1 = w[i, 1] + s * (w[j, 1] - w[i, 1]) + t * (w[m, 1] - w[i, 1])
        y2 = w[i, 2] + s * (w[j, 2] - w[i, 2]) + t * (w[m, 2] - w[i, 2])
        square = y0 * y0 + y1 * y1 + y2 * y2
        if square < best:
            best, face, kept, x0, x1, x2 = square, k, mask, y0, y1, y2
    i, j, m = _face(face)
    return _keep(w, i, j, m, kept), x0, x1, x2


@njit(**FAST)
def _face(k):
    """Return the points of a face of a tetrahedron; the point 3 - k is opposite."""
    if k == 0:
        return 0, 1, 2
    if k == 1:
        return 0, 1, 3
    if k == 2:
        return 0, 2, 3
    return 1, 2, 3


@njit(**FAST)
def _triangle_weights(w, i, j, m):
    """Return the weights of points j and m in the point nearest to the origin, and its support as bits."""
    ab0, ab1, ab2 = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
    ac0, ac1, ac2 = w[m, 0] - w[i, 0], w[m, 1] - w[i, 1], w[m, 2] - w[i, 2]
    p1 = -(ab0 * w[i, 0] + ab1 * w[i, 1] + ab2 * w[i, 2])
    p2 = -(ac0 * w[i, 0] + ac1 * w[i, 1] + ac2 * w[i, 2])
    if p1 <= 0.0 and p2 <= 0.0:
        return 0.0, 0.0, 1
    p3 = -(ab0 * w[j, 0] + ab1 * w[j, 1] + ab2 * w[j, 2])
    p4 = -(ac0 * w[j, 0] + ac1 * w[j, 1] + ac2 * w[j, 2])
    if p3 >= 0.0 and p4 <= p3:
        return 1.0, 0.0, 2
    vc = p1 * p4 - p3 * p2
    if vc <= 0.0 and p1 >= 0.0 and p3 <= 0.0 and p1 > p3:
        return p1 / (p1 - p3), 0.0, 3
    p5 = -(ab0 * w[m, 0] + ab1 * w[m, 1] + ab2 * w[m, 2])
    p6 = -(ac0 * w[m, 0] + ac1 * w[m, 1] + ac2 * w[m, 2])
    if p6 >= 0.0 and p5 <= p6:
        return 0.0, 1.0, 4
    vb = p5 * p2 - p1 * p6
    if vb <= 0.0 and p2 >= 0.0 and p6 <= 0.0 and p2 > p6:
        return 0.0, p2 / (p2 - p6), 5
    va = p3 * p6 - p5 * p4
    if va <= 0.0 and p4 >= p3 and p5 >= p6 and (p4 - p3) + (p5 - p6) > 0.0:
        t = (p4 - p3) / ((p4 - p3) + (p5 - p6))
        return 1.0 - t, t, 6
    total = va + vb + vc
    if total <= 0.0:  # the points lie on a line
        return 0.0, 0.0, 1
    return vb / total, vc / total, 7


@njit(**FAST)
def _keep(w, i, j, m, mask):
    """Move the points among i, j and m whose bits are set to the front; return their number."""
    count = 0
    for bit in range(3):
        if mask & (1 << bit):
            k = i if bit == 0 else (j if bit == 1 else m)
            # i < j < m, so no point is overwritten before it is moved.
            w[count, 0], w[count, 1], w[count, 2] = w[k, 0], w[k, 1], w[k, 2]
            count += 1
    return count


@njit(**FAST)
def _keep1(w, k):
    """Move point k to the front."""
    w[0, 0], w[0, 1], w[0, 2] = w[k, 0], w[k, 1], w[k, 2]


@njit(**FAST)
def _depth(w):
    """Return the distance (m) of the origin from the nearest face of a tetrahedron around it, else -1."""
    least = math.inf
    for k in range(4):
        i, j, m = _face(k)
        opposite = 3 - k
        b0, b1, b2 = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
        c0, c1, c2 = w[m, 0] - w[i, 0], w[m, 1] - w[i, 1], w[m, 2] - w[i, 2]
        n0, n1, n2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
        length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        if length == 0.0:
            return -1.0
        origin = -(n0 * w[i, 0] + n1 * w[i, 1] + n2 * w[i, 2]) / length
        inner = (
            n0 * (w[opposite, 0] - w[i, 0])
            + n1 * (w[opposite, 1] - w[i, 1])
            + n2 * (w[opposite, 2] - w[i, 2])
        ) / length
        if origin * inner <= 0.0 or abs(inner) < abs(origin):
            return -1.0
        least = min(least, abs(origin))
    return least
