"""Simplices of the GJK method: their point nearest to the origin, and how deep they enclose it. Compiled.

A simplex is an array w (4, 3) of which the first points count: one to four.
"""

from __future__ import annotations

import math
from typing import Any

from symgrasp.compiling import njit

__all__ = ["FAST", "SURROUNDS", "depth_inside", "reduce_to_nearest"]

FAST: dict[str, Any] = {"inner": True, "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
"""Options of `njit` for code whose last bits do not matter: products and sums may be fused. The last one
switches off reference counting of arrays, which costs more than the functions themselves and is not
needed, because nothing here allocates arrays."""

SURROUNDS = 1e-9
"""A tetrahedron certainly surrounds the origin when its faces are at least this far (m) from it."""


@njit(**FAST)
def reduce_to_nearest(w, count):
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
def depth_inside(w):
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
