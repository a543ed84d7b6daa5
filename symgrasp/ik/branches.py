"""Compiled closed form: all inverse-kinematics branches at a tool pose and a redundancy value.

See `symgrasp.ik.spherical` for the equations and the meaning of triple, middle joint and pair.
"""

from __future__ import annotations

import math
from typing import Any

from symgrasp.compiling import njit
from symgrasp.ik.chain import AXES, CENTRE, CENTRE_SEEN, MIDDLE, P0, PHI, R0, TRIPLE, WRIST, WRIST_SEEN

__all__ = ["BRANCHES", "STRICT", "branches_at", "solve_range"]

BRANCHES = 8
"""Branches of the closed form: two values of the middle joint, times two of the pair, two of the triple."""

ROOT_TOLERANCE = 1e-12
"""A radicand (dimensionless, or m²) above minus this counts as zero: at the limit of the reach two
branches coincide, and rounding decides on which side of zero it falls."""

STRICT: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
"""Options of numba: plain IEEE arithmetic. The last one switches off reference counting of arrays, which
is safe because nothing below allocates any."""


@njit(cache=True, error_model="numpy")
def solve_range(geometry, joint, limits, forward, T, first, last, q, exists, inside):
    """Solve a pose T (4, 4) at the redundancy values from first to before last; see `branches_at`."""
    for k in range(first, last):
        i = k - first
        branches_at(geometry, joint, limits, forward, k, T, False, q[i], exists[i], inside[i])


@njit(**STRICT)
def branches_at(geometry, joint, limits, forward, k, T, inside_only, q, exists, inside):
    """Solve one pose (4, 4) at redundancy sample k.

    Args:
        geometry, joint, limits, forward: the arm, see `Chain`.
        k: index of the redundancy sample.
        T: tool pose (4, 4) in the base.
        inside_only: leave out branches outside the limits as early as possible; those that remain are
            bit for bit the same.
        q: (BRANCHES, n) receives the joint values.
        exists: (BRANCHES,) receives which branches reach the pose.
        inside: (BRANCHES,) receives which branches reach it inside the limits.

    Returns:
        Whether some angle of the middle joint gives the distance between S and W that the pose needs.
    """
    for b in range(BRANCHES):
        exists[b] = False
        inside[b] = False
    g = geometry[k]
    R, p = _tool_motion(g, joint[7], T)
    a = _vec(g, CENTRE_SEEN)
    t = _minus(_transposed_times(R, _minus(_vec(g, CENTRE), p)), _vec(g, WRIST))  # G⁻¹ S − W
    # Subproblem 3: |R4⁻¹ a − b| = |t|. Where possible sines and cosines are computed without their angles:
    # most branches are dropped at a joint limit before an angle is needed.
    middle, length, part = _vec(g, MIDDLE)
    sm, cm = g[MIDDLE + 3], g[MIDDLE + 4]
    c = (-0.5 * _dot(t, t) - part) / length
    s = _sine(c)
    if s < 0.0:
        return False
    offset = math.atan2(s, c)
    for i in range(2):
        if i == 0:
            q4, s4, c4 = -(middle + offset), -(sm * c + cm * s), cm * c - sm * s
        else:
            q4, s4, c4 = offset - middle, s * cm - c * sm, cm * c + sm * s
        if inside_only and _outside(limits, joint[3], s4, c4):
            continue
        q4 = _nearest_turn(limits, joint[3], q4)
        if inside_only and not _within(limits, joint[3], q4):
            continue
        u = _minus(_rotate(_vec(g, AXES + 9), -s4, c4, a), _vec(g, WRIST_SEEN))  # e4⁻¹ S − W
        _pair(g, joint, limits, R, t, u, q4, s4, c4, i, inside_only, q, exists, inside)
    for i in range(BRANCHES):
        if exists[i] and _misses(forward, q[i], T):
            exists[i] = False
            inside[i] = False
    return True


@njit(**STRICT)
def _sine(cosine):
    """Return the sine of the arc cosine, which is not negative, or -1 where there is none."""
    rest = 1.0 - cosine * cosine
    return math.sqrt(max(rest, 0.0)) if rest >= -ROOT_TOLERANCE else -1.0


@njit(**STRICT)
def _pair(g, joint, limits, R, t, u, q4, s4, c4, i, inside_only, q, exists, inside):
    """Subproblem 2: R5⁻¹ u = R6 t gives q5 and q6 for a value of the middle joint."""
    h4, h5, h6 = _vec(g, AXES + 9), _vec(g, AXES + 12), _vec(g, AXES + 15)
    c = _dot(h5, h6)
    across = 1.0 - c * c
    along5, along6 = _dot(h5, u), _dot(h6, t)
    alpha = (along5 - c * along6) / across
    beta = (along6 - c * along5) / across
    rest = (_dot(u, u) - alpha * alpha - beta * beta - 2.0 * alpha * beta * c) / across
    if rest < -ROOT_TOLERANCE:
        return
    gamma = math.sqrt(max(rest, 0.0))
    normal = _cross(h5, h6)
    h3 = _vec(g, AXES + 6)
    side = _perpendicular(h3)
    v3, vside = _rotate(h4, -s4, c4, h3), _rotate(h4, -s4, c4, side)
    for j in range(2):
        out = gamma if j == 0 else -gamma
        z = (
            alpha * h5[0] + beta * h6[0] + out * normal[0],
            alpha * h5[1] + beta * h6[1] + out * normal[1],
            alpha * h5[2] + beta * h6[2] + out * normal[2],
        )
        y6, x6 = _subproblem1(h6, t, z)
        s6, c6 = _unit(y6, x6)
        if inside_only and _outside(limits, joint[5], s6, c6):
            continue
        y5, x5 = _subproblem1(h5, z, u)
        s5, c5 = _unit(y5, x5)
        if inside_only and _outside(limits, joint[4], s5, c5):
            continue
        q6 = _nearest_turn(limits, joint[5], math.atan2(y6, x6))
        if inside_only and not _within(limits, joint[5], q6):
            continue
        q5 = _nearest_turn(limits, joint[4], math.atan2(y5, x5))
        if inside_only and not _within(limits, joint[4], q5):
            continue
        # M = R_G R6⁻¹ R5⁻¹ R4⁻¹, applied to h3 and to a vector perpendicular to it
        M3 = _times(R, _rotate(h6, -s6, c6, _rotate(h5, -s5, c5, v3)))
        Mside = _times(R, _rotate(h6, -s6, c6, _rotate(h5, -s5, c5, vside)))
        _triple(g, joint, limits, M3, Mside, side, q4, q5, q6, 4 * i + 2 * j, inside_only, q, exists, inside)


@njit(**STRICT)
def _triple(g, joint, limits, M3, Mside, side, q4, q5, q6, branch, inside_only, q, exists, inside):
    """Subproblem 4: R1 R2 R3 = M, so h1ᵀ R2 h3 = h1ᵀ M h3, gives q1, q2 and q3; write the branch."""
    h1, h2, h3 = _vec(g, AXES), _vec(g, AXES + 3), _vec(g, AXES + 6)
    middle, length, part = _vec(g, TRIPLE)
    sm, cm = g[TRIPLE + 3], g[TRIPLE + 4]
    c = (_dot(h1, M3) - part) / length
    s = _sine(c)
    if s < 0.0:
        return
    for i in range(2):
        way = s if i == 0 else -s
        s2, c2 = sm * c + cm * way, cm * c - sm * way
        if inside_only and _outside(limits, joint[1], s2, c2):
            continue
        y1, x1 = _subproblem1(h1, _rotate(h2, s2, c2, h3), M3)
        s1, c1 = _unit(y1, x1)
        if inside_only and _outside(limits, joint[0], s1, c1):
            continue
        # q3 from R2⁻¹ R1⁻¹ M with the q1 found: where h1 and h3 align, any q1 will do and q3 compensates.
        y3, x3 = _subproblem1(h3, side, _rotate(h2, -s2, c2, _rotate(h1, -s1, c1, Mside)))
        q2 = _nearest_turn(limits, joint[1], middle + math.atan2(way, c))
        if inside_only and not _within(limits, joint[1], q2):
            continue
        q1 = _nearest_turn(limits, joint[0], math.atan2(y1, x1))
        if inside_only and not _within(limits, joint[0], q1):
            continue
        q3 = _nearest_turn(limits, joint[2], math.atan2(y3, x3))
        if inside_only and not _within(limits, joint[2], q3):
            continue
        row = q[branch + i]
        row[joint[0]] = q1
        row[joint[1]] = q2
        row[joint[2]] = q3
        row[joint[3]] = q4
        row[joint[4]] = q5
        row[joint[5]] = q6
        if joint[6] >= 0:
            row[joint[6]] = _nearest_turn(limits, joint[6], g[PHI])
        exists[branch + i] = True
        fits = True
        for j in range(row.shape[0]):
            fits = fits and _within(limits, j, row[j])
        inside[branch + i] = fits


@njit(**STRICT)
def _tool_motion(g, backwards, T):
    """Return the displacement G of the tool as nested tuples (rotation, position), or G⁻¹ if backwards."""
    p0 = _vec(g, P0)
    # G = T T0⁻¹: rotation T R0ᵀ, position p − R p0.
    R = (
        (_row3(T, 0, g, 0), _row3(T, 0, g, 1), _row3(T, 0, g, 2)),
        (_row3(T, 1, g, 0), _row3(T, 1, g, 1), _row3(T, 1, g, 2)),
        (_row3(T, 2, g, 0), _row3(T, 2, g, 1), _row3(T, 2, g, 2)),
    )
    p = (
        T[0, 3] - (R[0][0] * p0[0] + R[0][1] * p0[1] + R[0][2] * p0[2]),
        T[1, 3] - (R[1][0] * p0[0] + R[1][1] * p0[1] + R[1][2] * p0[2]),
        T[2, 3] - (R[2][0] * p0[0] + R[2][1] * p0[1] + R[2][2] * p0[2]),
    )
    if backwards:
        back = _transposed_times(R, p)
        p = (-back[0], -back[1], -back[2])
        R = (
            (R[0][0], R[1][0], R[2][0]),
            (R[0][1], R[1][1], R[2][1]),
            (R[0][2], R[1][2], R[2][2]),
        )
    return R, p


@njit(**STRICT)
def _row3(T, i, g, j):
    """Return entry (i, j) of the rotation T R0ᵀ."""
    return T[i, 0] * g[R0 + 3 * j] + T[i, 1] * g[R0 + 3 * j + 1] + T[i, 2] * g[R0 + 3 * j + 2]


@njit(**STRICT)
def _times(R, v):
    """Return R v."""
    return (
        R[0][0] * v[0] + R[0][1] * v[1] + R[0][2] * v[2],
        R[1][0] * v[0] + R[1][1] * v[1] + R[1][2] * v[2],
        R[2][0] * v[0] + R[2][1] * v[1] + R[2][2] * v[2],
    )


@njit(**STRICT)
def _nearest_turn(limits, joint, value):
    """Add the full turns to a joint value that bring it nearest to the middle of its limits."""
    return value + 2.0 * math.pi * math.floor((limits[2, joint] - value) / (2.0 * math.pi) + 0.5)


@njit(**STRICT)
def _within(limits, joint, value):
    """Whether a joint value is inside its limits."""
    return limits[0, joint] <= value <= limits[1, joint]


@njit(**STRICT)
def _outside(limits, joint, s, c):
    """Whether an angle of this sine and cosine is outside the limits of a joint, with any full turns added.

    It is inside when the value nearest to the middle of the range is within half the range of it.
    """
    return c * limits[3, joint] + s * limits[4, joint] < limits[5, joint]


@njit(**STRICT)
def _unit(y, x):
    """Return sine and cosine of ``atan2(y, x)``."""
    length = math.sqrt(y * y + x * x)
    if length == 0.0:
        return 0.0, 1.0
    return y / length, x / length


@njit(**STRICT)
def _misses(forward, q, T):
    """Whether the tool pose at joint values q differs from T by more than the tolerances."""
    n = q.shape[0]
    x, y, p = _column(forward, 2 * n + 1, 0), _column(forward, 2 * n + 1, 1), (0.0, 0.0, 0.0)
    for j in range(n - 1, -1, -1):
        axis, s, c = _row(forward, j), math.sin(q[j]), math.cos(q[j])
        x, y = _rotate(axis, s, c, x), _rotate(axis, s, c, y)
        p = _rotate(axis, s, c, _plus(p, _row(forward, n + j + 1)))
    d = _minus(_plus(p, _row(forward, n)), _column(T, 0, 3))
    dx, dy = _minus(x, _column(T, 0, 0)), _minus(y, _column(T, 0, 1))
    # For rotations an angle apart, a column differs by at most that angle, and two columns together (root
    # sum of squares) by about that angle at least.
    turn = math.sqrt(_dot(dx, dx) + _dot(dy, dy))
    return not (math.sqrt(_dot(d, d)) <= forward[2 * n + 4, 0] and turn <= forward[2 * n + 4, 1])


@njit(**STRICT)
def _rotate(axis, s, c, v):
    """Rotate v about a unit axis by the angle of that sine and cosine (Rodrigues)."""
    along = _dot(axis, v) * (1.0 - c)
    w = _cross(axis, v)
    return (
        c * v[0] + s * w[0] + along * axis[0],
        c * v[1] + s * w[1] + along * axis[1],
        c * v[2] + s * w[2] + along * axis[2],
    )


@njit(**STRICT)
def _subproblem1(axis, a, b):
    """Subproblem 1: y and x of the angle ``atan2(y, x)`` about an axis that turns a into b."""
    return _dot(axis, _cross(a, b)), _dot(a, b) - _dot(axis, a) * _dot(axis, b)


@njit(**STRICT)
def _perpendicular(v):
    """Return a unit vector perpendicular to v."""
    w = (0.0, -v[2], v[1]) if abs(v[0]) < 0.6 else (v[2], 0.0, -v[0])
    length = math.sqrt(_dot(w, w))
    return (w[0] / length, w[1] / length, w[2] / length)


@njit(**STRICT)
def _transposed_times(R, v):
    """Return Rᵀ v."""
    return (
        R[0][0] * v[0] + R[1][0] * v[1] + R[2][0] * v[2],
        R[0][1] * v[0] + R[1][1] * v[1] + R[2][1] * v[2],
        R[0][2] * v[0] + R[1][2] * v[1] + R[2][2] * v[2],
    )


@njit(**STRICT)
def _row(a, i):
    return (a[i, 0], a[i, 1], a[i, 2])


@njit(**STRICT)
def _column(a, i, j):
    return (a[i, j], a[i + 1, j], a[i + 2, j])


@njit(**STRICT)
def _vec(a, i):
    return (a[i], a[i + 1], a[i + 2])


@njit(**STRICT)
def _plus(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@njit(**STRICT)
def _minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@njit(**STRICT)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**STRICT)
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
