"""The geometry of arms of which the axes of the last two joints meet, from their axes.

Compiled code calls `write_pair`, and Python `pair_geometry`.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import interpreted, njit
from symgrasp.ik.chain import AXES
from symgrasp.ik.pair.geometry import (
    CHAIN_DIRECTION,
    CHAIN_POINT,
    COSINE,
    COSINE_56,
    FIRST_AXIS,
    FIRST_POINT,
    FRAME,
    GENERAL,
    KIND,
    LENGTH,
    MEETING,
    OUTER_LAST,
    PAIR_PHI,
    PARALLEL,
    SHOULDER_POINT,
    SINE,
    SIZE,
    SPECIAL,
    TILT,
    VARIES,
    WORTH,
    WRIST_POINT,
    PairGeometry,
)
from symgrasp.ik.vectors import STRICT, cross, dot, minus, perpendicular, plus, vec
from symgrasp.poses import Array

__all__ = ["meeting_point", "pair_geometry", "write_pair"]

NEARLY, LEAST_NORMAL = 0.02, 1e-3
"""Sine of the angle of axes from which on the feet of their common normal are near enough, and least distance
(m) of nearly parallel ones: closer ones all but meet there, so that these feet are near, too."""

NORMAL = 1e-9
"""Cosine of an angle below which it is a right one."""

BESIDE = np.array([1.1e-5, -0.7e-5, 0.9e-5])
"""How far (m) from its place the axis of joint 1 is taken to be where the equations vanish there. Newton's
method on the arm itself mends that."""


def pair_geometry(
    backwards: bool, h: Array, o: Array, R0: Array, p0: Array, W: Array, phi: float
) -> PairGeometry | None:
    """Return the geometry of joints, with the outer joint that makes the equations well-conditioned.

    Args:
        backwards: whether they are read from the tool to the base.
        h: (6, 3) unit axes.
        o: (6, 3) a point on each axis.
        R0: (3, 3) orientation of the tool.
        p0: (3,) position of the tool.
        W: (3,) point where the axes of joints 5 and 6 meet.
        phi: value of the locked joint (rad).

    Returns:
        None where joints 2 and 3 have the same axis, or neither joint 1 nor joint 4 can be the inner one, not
        even if the first axis is moved by `BESIDE`.
    """
    row = np.zeros(SIZE)
    row[:WRIST_POINT] = np.concatenate([h.ravel(), R0.ravel(), p0])
    row[PAIR_PHI] = phi
    # Interpreted it takes as long as a few calls of numpy, with nothing to compile. Where no joint can be the
    # inner one, which is rare, one can as soon as the first axis is elsewhere by little.
    for first in (o[0], o[0] + BESIDE):
        if interpreted(write_pair)(row, [tuple(point) for point in (first, *o[1:])], tuple(W)):
            return PairGeometry(backwards, row)
    return None


@njit(**STRICT)
def write_pair(g, points, W):
    """Write the parts of a `PairGeometry` that follow from its axes, which are in g.

    Args:
        g: (`SIZE`,) a packed geometry.
        points: six points (3,), one on each axis.
        W: (3,) point where the axes of joints 5 and 6 meet.

    Returns:
        Whether there is such a geometry; see `pair_geometry`.
    """
    k, m, a, b = vec(g, AXES + 3), vec(g, AXES + 6), points[1], points[2]
    known, feet, s = _common_normal(k, a, m, b)
    if not known:
        return False
    _put(g, WRIST_POINT, W)
    g[COSINE_56] = dot(vec(g, AXES + 12), vec(g, AXES + 15))
    near = s < NEARLY
    _write_frames(g, points, W, _feet(g, points, feet, -1.0, near), -1.0)
    last = _leading(g)
    _write_frames(g, points, W, _feet(g, points, feet, 1.0, near), 1.0)
    first = _leading(g)
    if last > WORTH * first:
        _write_frames(g, points, W, _feet(g, points, feet, -1.0, near), -1.0)
        return last > VARIES
    return first > VARIES


@njit(**STRICT)
def meeting_point(g, points, parallel):
    """Return whether the axes of joints 5 and 6 meet, and the point between them that is nearest to both.

    Args:
        g: (`SIZE`,) a packed geometry, of which the axes are read.
        points: six points (3,), one on each axis.
        parallel: sine of the angle between the axes below which they do not meet.
    """
    k, m, a, b = vec(g, AXES + 12), vec(g, AXES + 15), points[4], points[5]
    n, d = cross(k, m), minus(b, a)
    s2 = dot(n, n)
    if s2 < parallel * parallel:
        return False, a
    x, y = dot(d, cross(m, n)) / s2, dot(d, cross(k, n)) / s2
    p, q = _along(a, x, k), _along(b, y, m)
    return True, (0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2]))


@njit(**STRICT)
def _common_normal(k, a, m, b):
    """Return the common normal of two lines.

    Args:
        k: unit direction (3,) of the first line.
        a: point (3,) on it.
        m: unit direction (3,) of the second line.
        b: point (3,) on it.

    Returns:
        Whether there is one, which is not so where both are the same line; its feet (3,) on them and its
        direction (3,); and the sine of the angle.
    """
    normal, d = cross(k, m), minus(b, a)
    s = math.sqrt(dot(normal, normal))
    if s < SPECIAL:
        d = _along(d, -dot(k, d), k)
        length = math.sqrt(dot(d, d))
        n = _along((0.0, 0.0, 0.0), 1.0 / max(length, SPECIAL), d)
        return length >= SPECIAL, (a, plus(a, d), n), s
    n = (normal[0] / s, normal[1] / s, normal[2] / s)
    x, y, length = dot(d, cross(m, n)) / s, dot(d, cross(k, n)) / s, dot(d, n)
    if length < 0.0:
        n = (-n[0], -n[1], -n[2])
    return True, (_along(a, x, k), _along(b, y, m), n), s


@njit(**STRICT)
def _feet(g, points, feet, way, near):
    """Return points on the axes of joints 2 and 3, and the direction from one to the other.

    Args:
        g: (`SIZE`,) a packed geometry, of which the axes are read.
        points: six points (3,), one on each axis.
        feet: those of the common normal, and its direction from joint 2 to joint 3.
        way: 1 where joint 1 is the outer joint, -1 where joint 4 is.
        near: whether the axes are nearly parallel, so that these are far away.
    """
    k, m, a, b = vec(g, AXES + 3), vec(g, AXES + 6), points[1], points[2]
    if not near:
        return feet
    if way > 0.0:
        b = _along(b, dot(minus(a, b), m), m)
    else:
        a = _along(a, dot(minus(b, a), k), k)
    d = minus(b, a)
    length = math.sqrt(dot(d, d))
    if length < LEAST_NORMAL:
        return feet
    return a, b, (d[0] / length, d[1] / length, d[2] / length)


@njit(**STRICT)
def _along(a, x, k):
    """Return a + x k."""
    return (a[0] + x * k[0], a[1] + x * k[1], a[2] + x * k[2])


@njit(**STRICT)
def _write_frames(g, points, W, feet, way):
    """Write the parts that are seen in the frames of joints 2 and 3, turned around if ``way`` is -1."""
    k, m, h4, h5 = vec(g, AXES + 3), vec(g, AXES + 6), vec(g, AXES + 9), vec(g, AXES + 12)
    shoulder, elbow, n = feet
    e = (way * n[0], way * n[1], way * n[2])
    k, m = (way * k[0], way * k[1], way * k[2]), (way * m[0], way * m[1], way * m[2])
    outer, inner = (k, m) if way > 0.0 else (m, k)
    between, side = minus(elbow, shoulder), cross(inner, e)
    length, sine, tilt = abs(dot(between, n)), dot(outer, side), dot(outer, e)
    kind = MEETING if length < SPECIAL else PARALLEL if abs(sine) < SPECIAL else GENERAL
    g[LENGTH], g[KIND] = 0.0 if kind == MEETING else length, kind
    g[COSINE], g[SINE] = dot(outer, inner), 0.0 if kind == PARALLEL else sine
    g[TILT] = tilt if abs(tilt) > NORMAL else 0.0
    x = _along(e, -g[TILT], outer)
    size = math.sqrt(dot(x, x))
    x = (x[0] / size, x[1] / size, x[2] / size)
    of_outer, of_inner = (x, cross(outer, x), outer), (e, side, inner)
    F, E = (of_outer, of_inner) if way > 0.0 else (of_inner, of_outer)
    _put(g, SHOULDER_POINT, shoulder)
    for i in range(3):
        _put(g, FRAME + 3 * i, F[i])
    _put(g, FIRST_AXIS, _seen(F, vec(g, AXES)))
    _put(g, FIRST_POINT, _seen(F, minus(points[0], shoulder)))
    _write_circle(g, CHAIN_POINT, E, h4, minus(W, points[3]))
    _write_circle(g, CHAIN_DIRECTION, E, h4, h5)
    _put(g, CHAIN_POINT, plus(vec(g, CHAIN_POINT), _seen(E, minus(points[3], elbow))))
    g[OUTER_LAST] = 1.0 if way < 0.0 else 0.0


@njit(**STRICT)
def _seen(frame, v):
    """Return a vector as seen in a frame, whose axes are given."""
    return (dot(frame[0], v), dot(frame[1], v), dot(frame[2], v))


@njit(**STRICT)
def _write_circle(g, place, frame, k, v):
    """Write a vector turned about a unit axis, seen in a frame: at rest, coefficients of cosine and sine."""
    along = dot(k, v)
    rest = (along * k[0], along * k[1], along * k[2])
    _put(g, place, _seen(frame, rest))
    _put(g, place + 3, _seen(frame, minus(v, rest)))
    _put(g, place + 6, _seen(frame, cross(k, v)))


@njit(**STRICT)
def _put(g, place, v):
    """Write a vector (3,) into g."""
    g[place], g[place + 1], g[place + 2] = v


@njit(**STRICT)
def _leading(g):
    """Return the size (m², or m) of the coefficients that tell the values of the inner joint apart."""
    a, s = g[LENGTH], g[SINE]
    if g[OUTER_LAST]:
        # W has any distance from the axis of joint 1: 1 m stands for it. It turns in the plane of p and q.
        axis = vec(g, FIRST_AXIS)
        p = perpendicular(axis)
        q, centre = cross(axis, p), vec(g, FIRST_POINT)
        along1, square1 = complex(p[2], -q[2]), complex(2.0 * dot(centre, p), -2.0 * dot(centre, q))
    else:
        rest, c, t = vec(g, CHAIN_POINT), vec(g, CHAIN_POINT + 3), vec(g, CHAIN_POINT + 6)
        along1, square1 = complex(c[2], -t[2]), complex(2.0 * dot(rest, c), -2.0 * dot(rest, t))
    if g[KIND] == MEETING:
        return abs(square1)
    Q1 = g[COSINE] * along1
    if g[TILT] != 0.0:
        Q1 -= 0.5 * g[TILT] / a * square1
    if g[KIND] == PARALLEL:
        return abs(Q1)
    return math.sqrt(abs((s * square1) ** 2 + (2.0 * a) ** 2 * (Q1 * Q1 + (s * along1) ** 2)))
