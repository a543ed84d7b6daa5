"""Newton's method on the true kinematics of an arm, compiled: it ends what another method almost solved.

The steps are Levenberg's: with the twists J of the joints and the twist e that is missing, in the tool frame,

    dq = (Jᵀ J + μ I)⁻¹ Jᵀ e,     μ = |e|²,

which keeps the quadratic convergence of Newton's method, at many singular poses too (N. Yamashita and
M. Fukushima, On the rate of convergence of the Levenberg-Marquardt method, 2001), and bounds a step by
|e| / (2 √μ) = 0.5 rad.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT, column, cross, dot, minus, plus, rotate, row

__all__ = ["POLISHED", "linearise", "normal_equations", "polish", "polish_in", "solve_normal"]

POLISHED = 1e-9
"""Largest error (m and rad) of the tool at a configuration that counts as polished."""

NO_BETTER = 1e-14
"""Error (m and rad) that no further step is made for; rounding leaves about 1e-15."""

STEPS = 12
"""Steps after which polishing gives up: where two solutions all but coincide, each step only halves the
error of the joint values."""

LEAST_DAMPING = 1e-15
"""Least damping μ, about what rounding leaves of Jᵀ J."""


@njit(cache=True, error_model="numpy")
def polish(forward, fixed, q, T):
    """Move an arm whose tool is almost at a pose, so that it is at the pose.

    Args:
        forward: (2 n + 5, 3) the arm, see `symgrasp.ik.chain.Chain`; its tolerances are not used.
        fixed: (n,) which joints keep their values.
        q: (n,) joint values (rad), changed in place, without regard to their limits; where polishing fails,
            the last ones that were tried.
        T: tool pose (4, 4) in the base.

    Returns:
        Whether the tool is within `POLISHED` of the pose.
    """
    n = q.shape[0]
    return polish_in(forward, fixed, q, T, np.empty((n, 6)), np.empty((n, n + 1)))


@njit(**STRICT)
def polish_in(forward, fixed, q, T, J, A):
    """Do what `polish` does, in memory that is given: J (n, 6) and A (n, n + 1)."""
    free, move, turn, twist = linearise(forward, fixed, q, T, J)
    for _ in range(STEPS):
        if (move <= NO_BETTER and turn <= NO_BETTER) or not math.isfinite(move + turn):
            break
        normal_equations(J, twist, free, max(move * move + turn * turn, LEAST_DAMPING), A)
        solve_normal(A, free)
        k = 0
        for j in range(q.shape[0]):
            if not fixed[j]:
                q[j] += A[k, free]
                k += 1
        before = max(move, turn)
        free, move, turn, twist = linearise(forward, fixed, q, T, J)
        if before <= POLISHED and max(move, turn) > 0.5 * before:
            break  # all that rounding of the pose allows
    return move <= POLISHED and turn <= POLISHED


@njit(**STRICT)
def linearise(forward, fixed, q, T, J):
    """Compare the tool with a pose, and write the twists of the m free joints into the first rows of J.

    Returns:
        m, the error of the position (m), that of the rotation (rad), and the missing twist (6,). Twists are
        in the tool frame, the linear part first.
    """
    n = q.shape[0]
    # From the tool to the base, as in `symgrasp.ik.joints.misses`: x, y, z and p are the tool's axes and
    # position as seen before joint j.
    x, y, p = column(forward, 2 * n + 1, 0), column(forward, 2 * n + 1, 1), (0.0, 0.0, 0.0)
    free = n
    for j in range(n):
        if fixed[j]:
            free -= 1
    k = free
    for j in range(n - 1, -1, -1):
        axis, s, c = row(forward, j), math.sin(q[j]), math.cos(q[j])
        x, y = rotate(axis, s, c, x), rotate(axis, s, c, y)
        p = rotate(axis, s, c, plus(p, row(forward, n + j + 1)))
        if not fixed[j]:
            k -= 1
            z, v = cross(x, y), cross(axis, p)
            J[k, 0], J[k, 1], J[k, 2] = dot(x, v), dot(y, v), dot(z, v)
            J[k, 3], J[k, 4], J[k, 5] = dot(x, axis), dot(y, axis), dot(z, axis)
    z = cross(x, y)
    X, Y, Z = column(T, 0, 0), column(T, 0, 1), column(T, 0, 2)
    d = minus(column(T, 0, 3), plus(p, row(forward, n)))
    dx, dy = minus(X, x), minus(Y, y)
    # The rotation that is missing: its axis times the sine of its angle.
    w0, w1, w2 = dot(z, Y) - dot(y, Z), dot(x, Z) - dot(z, X), dot(y, X) - dot(x, Y)
    twist = (dot(x, d), dot(y, d), dot(z, d), 0.5 * w0, 0.5 * w1, 0.5 * w2)
    return free, math.sqrt(dot(d, d)), math.sqrt(dot(dx, dx) + dot(dy, dy)), twist


@njit(**STRICT)
def normal_equations(J, twist, m, damping, A):
    """Write the lower half of Jᵀ J + damping I, and Jᵀ twist into column m of A; J has m rows."""
    for i in range(m):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(6):
                total += J[i, k] * J[j, k]
            A[i, j] = total
        total = 0.0
        for k in range(6):
            total += J[i, k] * twist[k]
        A[i, m] = total


@njit(**STRICT)
def solve_normal(A, m):
    """Solve m equations by Cholesky's method, of which A has the lower half, and the right side in column m.

    The solution is written there; the half is overwritten.
    """
    for i in range(m):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            # Rounding may leave less than nothing of the damping.
            A[i, j] = math.sqrt(max(total, LEAST_DAMPING)) if i == j else total / A[j, j]
    for i in range(m):
        total = A[i, m]
        for k in range(i):
            total -= A[i, k] * A[k, m]
        A[i, m] = total / A[i, i]
    for i in range(m - 1, -1, -1):
        total = A[i, m]
        for k in range(i + 1, m):
            total -= A[k, i] * A[k, m]
        A[i, m] = total / A[i, i]
