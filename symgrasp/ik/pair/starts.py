"""Joint values from which Newton's method starts, at a zero of N. Compiled; see `symgrasp.ik.pair.solver`."""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.chain import AXES
from symgrasp.ik.joints import nearest_turn, within, write_branch
from symgrasp.ik.pair.geometry import OUTER_LAST, PAIR_PHI
from symgrasp.ik.pair.polynomial import residual_at, solve_inner
from symgrasp.ik.roots import size2
from symgrasp.ik.vectors import STRICT, perpendicular, rotate, subproblem1, times, vec

__all__ = ["STARTS", "add_starts"]

STARTS = 2048
"""Joint values inside the limits from which Newton's method starts, at most, and as many outside. About 140
come of each view where N is all but zero throughout, as between two pairs of zeros that coincide."""

NEARLY_ZERO, NEARLY_REAL = 0.02, 0.05
"""Residual, and imaginary part of angles (rad), up to which a zero of N is tried."""

ALMOST_ON_AXIS = 1e-3
"""Distance (m) of a point from an axis up to which the pose may be singular: zeros that coincide are known
less well than others."""


@njit(**STRICT)
def add_starts(chain, g, R, equations, memory, x):
    """Write joint values at a zero of N, where a residual all but vanishes, after those that are known."""
    c, s = math.cos(x), math.sin(x)
    solve_inner(equations, c, s, memory.numbers)
    for i in range(4):
        r, b, e, f, far2 = residual_at(equations, c, s, memory.numbers, i)
        if far2 < ALMOST_ON_AXIS * ALMOST_ON_AXIS and size2(r) < 1.0 and _nearly_real(b):
            memory.free[1] = 1.0
        elif not (
            size2(r) < NEARLY_ZERO * NEARLY_ZERO and _nearly_real(b) and _nearly_real(e) and _nearly_real(f)
        ):
            continue
        other = math.atan2(b.imag, b.real)
        q2, q3 = math.atan2(f.imag, f.real), math.atan2(e.imag, e.real)
        q1, q4 = x, other
        if g[OUTER_LAST]:
            q1, q2, q3, q4 = other, q3, q2, x
        row = memory.row
        write_branch(
            chain.joint, chain.leeway, g[PAIR_PHI], (q1, q2, q3, q4, *_wrist(g, R, q1, q2, q3, q4)), row
        )
        beyond = 0
        for j in range(row.shape[0]):
            row[j] = nearest_turn(chain.leeway, j, row[j])
            beyond |= not within(chain.leeway, j, row[j])
        known = memory.counts[beyond]
        if known < STARTS:
            for j in range(row.shape[0]):
                memory.starts[beyond, known, j] = row[j]
            memory.counts[beyond] += 1


@njit(**STRICT)
def _nearly_real(e):
    """Whether ``e = exp(i q)`` is that of a nearly real angle q."""
    return abs(size2(e) - 1.0) < 2.0 * NEARLY_REAL


@njit(**STRICT)
def _wrist(g, R, q1, q2, q3, q4):
    """Return joints 5 and 6: R5 R6 = (R1 R2 R3 R4)⁻¹ R_G."""
    h5, h6 = vec(g, AXES + 12), vec(g, AXES + 15)
    side = perpendicular(h6)
    a, b = times(R, h6), times(R, side)
    h1, h2, h3, h4 = vec(g, AXES), vec(g, AXES + 3), vec(g, AXES + 6), vec(g, AXES + 9)
    for axis, angle in ((h1, q1), (h2, q2), (h3, q3), (h4, q4)):
        c, s = math.cos(angle), math.sin(angle)
        a, b = rotate(axis, -s, c, a), rotate(axis, -s, c, b)
    y, x = subproblem1(h5, h6, a)
    q5 = math.atan2(y, x)
    y, x = subproblem1(h6, side, rotate(h5, -math.sin(q5), math.cos(q5), b))
    return q5, math.atan2(y, x)
