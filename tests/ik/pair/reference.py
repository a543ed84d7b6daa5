"""The geometry of arms of which two axes meet, computed in another way than the project does: with numpy."""

import math

import numpy as np

from symgrasp.ik.pair.from_axes import NEARLY
from symgrasp.ik.pair.geometry import GENERAL, MEETING, PARALLEL, SPECIAL, VARIES, WORTH

__all__ = ["reference_row"]


def reference_row(h, o, R0, p0, W, phi, way_of_normal=1.0):
    """Return what `symgrasp.ik.pair.from_axes.pair_geometry` has in its row, or None; see there.

    Where the axes of joints 2 and 3 meet, their common normal may point either way.
    """
    normal = _common_normal(h[1], o[1], h[2], o[2])
    if normal is None:
        return None
    shoulder, elbow, n, length, s = normal
    n = way_of_normal * n
    ways = []
    for way in (1.0, -1.0):
        outer, inner = (h[1], h[2]) if way > 0.0 else (-h[2], -h[1])
        if s < NEARLY:  # a point on the axis of the outer one, and what is nearest to it on the other
            shoulder, elbow = o[1], o[2]
            if way > 0.0:
                elbow = o[2] + h[2] * (h[2] @ (o[1] - o[2]))
            else:
                shoulder = o[1] + h[1] * (h[1] @ (o[2] - o[1]))
            length = np.linalg.norm(elbow - shoulder)
            n = (elbow - shoulder) / length
        inner_frame = np.array([way * n, np.cross(inner, way * n), inner])
        tilt, sine, cosine = inner_frame @ outer
        kind = MEETING if length < SPECIAL else PARALLEL if abs(sine) < SPECIAL else GENERAL
        x = way * n - tilt * outer
        x /= np.linalg.norm(x)
        outer_frame = np.array([x, np.cross(outer, x), outer])
        frame2, frame3 = (outer_frame, inner_frame) if way > 0.0 else (inner_frame, outer_frame)
        chain = _circle(h[3], W - o[3]) @ frame3.T
        chain[0] += frame3 @ (o[3] - elbow)
        axis, point = frame2 @ h[0], frame2 @ (o[0] - shoulder)
        a = 0.0 if kind == MEETING else length
        sine = 0.0 if kind == PARALLEL else sine
        parts = [
            h, R0, p0, W, shoulder, frame2, axis, point, chain, _circle(h[3], h[4]) @ frame3.T, a,
            cosine, sine, h[4] @ h[5], kind, float(way < 0.0), phi, 0.0, tilt,
        ]  # fmt: skip
        least = _leading(kind, a, (tilt, sine, cosine), None if way > 0.0 else (axis, point), chain)
        ways.append((least, np.concatenate([np.ravel(part) for part in parts])))
    first, last = ways
    least, row = last if last[0] > WORTH * first[0] else first
    return row if least > VARIES else None


def _common_normal(k, a, m, b):
    """Return the feet of the common normal of two lines, its direction and length, and the sine."""
    normal, d = np.cross(k, m), b - a
    s = np.linalg.norm(normal)
    if s < SPECIAL:
        d = d - k * (k @ d)
        length = np.linalg.norm(d)
        return None if length < SPECIAL else (a, a + d, d / length, length, s)
    n = normal / s
    x, y, length = np.linalg.solve(np.array([k, -m, n]).T, d)
    return a + x * k, b + y * m, -n if length < 0.0 else n, abs(length), s


def _circle(k, v):
    """Return a vector turned about a unit axis: what rests, and the coefficients of cosine and sine."""
    rest = k * (k @ v)
    return np.array([rest, v - rest, np.cross(k, v)])


def _leading(kind, a, outer, first, chain):
    """Return the size of the coefficients that tell the values of the inner joint apart."""
    tilt, sine, cosine = outer
    if first is not None:  # any two directions normal to each other and to the axis
        axis, rest = first
        c, t = np.linalg.svd(axis[None])[2][1:]
    else:
        rest, c, t = chain
    h, square = complex(c[2], -t[2]), 2.0 * complex(rest @ c, -(rest @ t))
    if kind == MEETING:
        return abs(square)
    # In 2a P and sine Q, of which the squares are the quartic's.
    P, Q = -square, -cosine * h + (tilt * square / (2.0 * a))
    return (
        abs(Q)
        if kind == PARALLEL
        else math.sqrt(abs((sine * P) ** 2 + (2.0 * a) ** 2 * (Q**2 + (sine * h) ** 2)))
    )
