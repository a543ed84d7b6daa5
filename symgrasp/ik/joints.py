"""What the closed forms share in compiled code: the motion asked for, joint limits, writing and checking."""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.chain import P0, R0
from symgrasp.ik.vectors import (
    STRICT,
    column,
    cross,
    dot,
    minus,
    plus,
    rotate,
    row,
    sine_and_cosine,
    subproblem1,
    transposed_times,
    vec,
)
from symgrasp.robot.limits import LIMIT_TOLERANCE

__all__ = [
    "BLURS",
    "BLURS_SLIGHTLY",
    "FAMILY",
    "ROOT_TOLERANCE",
    "aligned_below",
    "all_within",
    "is_known",
    "miss",
    "misses",
    "nearest_turn",
    "note_blur",
    "onto_limits",
    "outside",
    "settle",
    "sine",
    "spread_in",
    "tool_motion",
    "turn_between",
    "within",
    "write_branch",
]

ROOT_TOLERANCE = 1e-8
"""A radicand (dimensionless, or m²) above minus this counts as zero: at the limit of the reach two branches
coincide, and rounding decides on which side of zero it falls: of maps' tool poses by up to 1e-9 rad and m
(see `symgrasp.object.manifold`). The tool pose that is then reached is checked."""

ALIGNED = 1e-7
"""A vector whose part across an axis is shorter than this (m, or of a unit vector) is along the axis:
rounding leaves up to 2e-8 of one that is."""

NEARLY_ALIGNED = 1e-20
"""Square of the product of such parts below which they are computed with more digits."""

ROUNDED_ALIGNED, MOST_ALIGNED = 10.0, 1e-3
"""The same of an arm whose geometry is rounded, as a share of the slack of its roots, and at most."""

SPREAD = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0])
"""Numbers whose multiples, less whole ones, spread evenly (R. Kronecker's sequence), one for each joint."""

BLURRED, SLIGHTLY_BLURRED = 1e-4, 1e-2
"""Sines of a joint, or lengths of the part of a vector across the axis about which it is turned into another,
below which other joints may be off, by the rounding of numbers, up to 1e-13, divided by the square: by a lot,
and by little, but more than the tolerance of limits."""

SLIGHTLY_BLURRED4 = SLIGHTLY_BLURRED**4

FAMILY, BLURS, BLURS_SLIGHTLY = 2.0, 1.0, 0.5
"""What is told of branches, see `symgrasp.ik.branches.Memory`: that a joint may take any angle, or that they
are blurred or slightly so."""


@njit(**STRICT)
def aligned_below(slack):
    """Return the length below which a part across an axis is none; slack is that of roots, see `sine`."""
    return max(ALIGNED, min(ROUNDED_ALIGNED * slack, MOST_ALIGNED))


@njit(**STRICT)
def note_blur(square, slack, free):
    """Note that branches are blurred, if so, by the square of a sine or length; slack is that of roots, see
    `sine`, and free is of `symgrasp.ik.branches.Memory`."""
    if square <= max(BLURRED * BLURRED, slack):
        free[1] = max(free[1], BLURS)
    elif square <= SLIGHTLY_BLURRED * SLIGHTLY_BLURRED:
        free[1] = max(free[1], BLURS_SLIGHTLY)


@njit(**STRICT)
def turn_between(axis, a, b, aligned, free):
    """Subproblem 1: y and x of the angle ``atan2(y, x)`` about an axis that turns a into b.

    Args:
        axis: unit axis (3,).
        a, b: vectors (3,).
        aligned: length of the part of a or b across the axis below which any angle will do.
        free: see `symgrasp.ik.branches.Memory`.
    """
    y, x = subproblem1(axis, a, b)
    if y * y + x * x > max(NEARLY_ALIGNED, aligned * aligned):
        if y * y + x * x <= SLIGHTLY_BLURRED4:
            note_blur(math.sqrt(y * y + x * x), 0.0, free)  # the product of both parts
        return y, x
    along_a, along_b = dot(axis, a), dot(axis, b)
    a = (a[0] - along_a * axis[0], a[1] - along_a * axis[1], a[2] - along_a * axis[2])
    b = (b[0] - along_b * axis[0], b[1] - along_b * axis[1], b[2] - along_b * axis[2])
    if min(dot(a, a), dot(b, b)) < aligned * aligned:
        free[1] = FAMILY
        if not math.isnan(free[0]):
            return math.sin(free[0]), math.cos(free[0])
        return y, x
    free[1] = max(free[1], BLURS)
    return dot(axis, cross(a, b)), dot(a, b)


@njit(**STRICT)
def tool_motion(g, backwards, T):
    """Return the displacement G of the tool as nested tuples (rotation, position), or G⁻¹ if backwards."""
    p0 = vec(g, P0)
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
        back = transposed_times(R, p)
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
def nearest_turn(limits, joint, value):
    """Add the full turns to a joint value that bring it nearest to the middle of its limits."""
    return value + 2.0 * math.pi * math.floor((limits[2, joint] - value) / (2.0 * math.pi) + 0.5)


@njit(**STRICT)
def within(limits, joint, value):
    """Whether a joint value is inside its limits, or beyond them by at most `LIMIT_TOLERANCE`."""
    return limits[0, joint] - LIMIT_TOLERANCE <= value <= limits[1, joint] + LIMIT_TOLERANCE


@njit(**STRICT)
def all_within(limits, row):
    """Whether all joint values (n,) are inside their limits, or beyond them by at most `LIMIT_TOLERANCE`."""
    fits = True
    for k in range(row.shape[0]):
        fits = fits and within(limits, k, row[k])
    return fits


@njit(**STRICT)
def onto_limits(limits, row):
    """Move joint values (n,) that are beyond their limits onto them."""
    for k in range(row.shape[0]):
        row[k] = min(max(row[k], limits[0, k]), limits[1, k])


@njit(**STRICT)
def settle(limits, row):
    """Add the full turns to joint values (n,) that bring them nearest to the middle of their limits.

    Returns:
        Whether all of them are inside the limits.
    """
    fits = True
    for k in range(row.shape[0]):
        row[k] = nearest_turn(limits, k, row[k])
        fits = fits and within(limits, k, row[k])
    return fits


@njit(**STRICT)
def is_known(q, first, found, same):
    """Whether the configuration in a row of q (m, n) is that of a row before it, up to full turns.

    Args:
        q: configurations (rad).
        first: the first row that is compared.
        found: the row.
        same: largest difference (rad) of joints that are the same.
    """
    for i in range(first, found):
        largest = 0.0
        for j in range(q.shape[1]):
            d = q[i, j] - q[found, j]
            largest = max(largest, abs(d - 2.0 * math.pi * math.floor(d / (2.0 * math.pi) + 0.5)))
        if largest < same:
            return True
    return False


@njit(**STRICT)
def outside(limits, joint, s, c):
    """Whether an angle of this sine and cosine is outside the limits of a joint, with any full turns added.

    It is inside when the value nearest to the middle of the range is within half the range of it.
    """
    return c * limits[3, joint] + s * limits[4, joint] < limits[5, joint]


@njit(**STRICT)
def spread_in(limits, i, row):
    """Write the i-th of joint values (n,) that spread evenly over the limits, or a turn of them."""
    for j in range(row.shape[0]):
        first = max(limits[0, j], limits[2, j] - math.pi)
        last = min(limits[1, j], limits[2, j] + math.pi)
        share = (i + 1) * SPREAD[j]
        row[j] = first + (share - math.floor(share)) * (last - first)


@njit(**STRICT)
def sine(cosine, slack):
    """Return the sine of the arc cosine, which is not negative, or -1 where there is none.

    Args:
        cosine: the cosine.
        slack: of an arm whose geometry is rounded: its true square of the sine is known up to that. Where it
            may be zero, two branches all but coincide, and each has to start on its own side for Newton's
            method to find them both, so that the square is not taken for less. 0 for other arms.
    """
    rest = 1.0 - cosine * cosine
    return math.sqrt(max(rest, slack)) if rest >= -(ROOT_TOLERANCE + slack) else -1.0


@njit(**STRICT)
def miss(missing, first, count, root, radicand):
    """Write down that some branches do not exist, because the radicand of a root of the closed form is
    negative.

    Args:
        missing: (B,) see `symgrasp.ik.branches.Memory`.
        first: the first of them.
        count: how many.
        root: number of the root, from 1.
        radicand: its radicand (dimensionless), negative.
    """
    for b in range(first, first + count):
        missing[b] = max(radicand, -9.0) - 10.0 * root


@njit(**STRICT)
def misses(forward, q, T):
    """Whether the tool pose at joint values q differs from T by more than the tolerances."""
    n = q.shape[0]
    x, y, p = column(forward, 2 * n + 1, 0), column(forward, 2 * n + 1, 1), (0.0, 0.0, 0.0)
    for j in range(n - 1, -1, -1):
        axis, (s, c) = row(forward, j), sine_and_cosine(q[j])
        x, y = rotate(axis, s, c, x), rotate(axis, s, c, y)
        p = rotate(axis, s, c, plus(p, row(forward, n + j + 1)))
    d = minus(plus(p, row(forward, n)), column(T, 0, 3))
    dx, dy = minus(x, column(T, 0, 0)), minus(y, column(T, 0, 1))
    # For rotations an angle apart, a column differs by at most that angle, and two columns together (root
    # sum of squares) by about that angle at least.
    turn = math.sqrt(dot(dx, dx) + dot(dy, dy))
    return not (math.sqrt(dot(d, d)) <= forward[2 * n + 4, 0] and turn <= forward[2 * n + 4, 1])


@njit(**STRICT)
def write_branch(joint, limits, phi, values, row):
    """Write joint values into a row of the arm's configurations.

    Args:
        joint, limits: the arm, see `symgrasp.ik.chain.Chain`.
        phi: value of the locked joint (rad).
        values: the six free joints' values, in the order of the closed form.
        row: (n,) receives them in the arm's order.

    Returns:
        Whether all of them are inside the limits.
    """
    for k in range(6):
        row[joint[k]] = values[k]
    if joint[6] >= 0:
        row[joint[6]] = nearest_turn(limits, joint[6], phi)
    return all_within(limits, row)
