"""Arms of which the axes of the last two joints meet, compiled: Baxter, G1, Gen3, xArm and most others.

Six joints, or seven with one locked; the axes of joints 5 and 6 meet in a point W (or the same read
backwards). The displacement of the tool from its pose at zero is

    G = e1 e2 e3 e4 e5 e6,     ek = rotation by qk about the line (hk, ok),

so that with p = G W and m = R_G h6

    e2 e3 z(q4) = w(q1),                    z = e4 W,  w = e1⁻¹ p
    m(q1) · R2 R3 d(q4) = h5 · h6,          d = R4 h5,  R1 m(q1) = m.

For a value of q1 the first equation is one of three joints that reach a point. With the feet of the common
normal n of axes 2 and 3 as origins of w and z, a its length and α the angle of the axes,

    P = (|w|² − |z|² − a²) / 2a,   Q = (h2·w − cos α h3·z) / sin α,   P² + Q² = |z|² − (h3·z)²

for the coordinates P and Q of R3 z along n and h3 × n: a polynomial of degree 4 in b = exp(i q4) (D. L.
Pieper, The Kinematics of Manipulators under Computer Control, 1968); where axes 2 and 3 meet or are parallel,
two of degree 2. Its four complex roots give four residuals r of the second equation. Their product, times
ρ⁴ K for the poles at which q2 or q3 is infinite,

    N(q1) = ρ⁴ K r₁ r₂ r₃ r₄,   ρ² = |w|² − (h2·w)²,   K = |Res_b(z·n + i z·(h3 × n), P − i Q)|²,

is a trigonometric polynomial of degree 8, the number of solutions of a general arm being 16. Its real zeros
are found from 17 values (`symgrasp.ik.arcs`); a solution is where one of the residuals vanishes, and Newton's
method on the arm itself ends each. Where N is faint, as between solutions that all but coincide, it is found
from other values, there: with ``tan((q1 − c) / 2) = s tan(θ / 2)`` for a centre c and a stretch s,
``N (cos²(θ/2) + s² sin²(θ/2))⁸`` is such a polynomial of θ, too.

Where z does not depend on q4 (a wrist whose axes meet), q1 and q4 change their parts: what is called outer
below is q4, and inner q1.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.arcs import (
    ARCS,
    HALVINGS,
    NO_ZERO,
    ONE_ZERO,
    angle_in_arc,
    bernstein,
    double_zero,
    halve,
    largest_of,
    single_zero,
    zeros_within,
)
from symgrasp.ik.chain import AXES
from symgrasp.ik.joints import misses, nearest_turn, settle, tool_motion, within, write_branch
from symgrasp.ik.newton import polish_in
from symgrasp.ik.pair.geometry import OUTER_LAST, PAIR_PHI, SHIFTED
from symgrasp.ik.pair.polynomial import equations_of, may_reach, product, residual_at, solve_inner
from symgrasp.ik.roots import size2
from symgrasp.ik.self_motion import PULLS, into_limits
from symgrasp.ik.vectors import STRICT, perpendicular, rotate, subproblem1, times, vec
from symgrasp.robot.limits import LIMIT_TOLERANCE

__all__ = ["PAIR_BRANCHES", "STARTS", "VIEWS", "pair_branches"]

PAIR_BRANCHES = 16
"""Configurations of a pose and a redundancy value, at most."""

STARTS = 32
"""Joint values inside the limits from which Newton's method starts, at most, and as many outside."""

VIEWS = 12
"""Parts of a turn, at most, from whose values N is computed."""

NOISE = 1e-13
"""Error of N that is computed from values all around, as a share of the largest."""

FAINT = 1e3
"""Largest coefficient of N, as a multiple of that error, below which it is computed from other values."""

WIDEST, LEAST_STRETCH = 0.4, 1e-4
"""Stretch of such values at most, as a share of that of those before, and at least."""

NEARLY_ZERO, NEARLY_REAL = 0.02, 0.05
"""Residual, and imaginary part of angles (rad), up to which a zero of N is tried."""

ALMOST_ON_AXIS = 1e-3
"""Distance (m) of a point from an axis up to which the pose may be singular: zeros that coincide are known
less well than others."""

NARROW = 3e-4
"""Width (rad) of a part in which N is faint below which the pose may be singular, too."""

MORE_STARTS, MORE_STEPS = 24, 20
"""Joint values all over the range from which a singular pose is sought where nothing else leads inside the
limits, and steps from each."""

SPREAD = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0])
"""Numbers whose multiples, less whole ones, spread evenly (R. Kronecker's sequence), one for each joint."""

SAME = 1e-7
"""Largest difference (rad) of the joints of configurations that count as one."""


@njit(**STRICT)
def pair_branches(chain, k, T, inside_only, q, exists, inside, memory):
    """Solve one pose (4, 4); see `symgrasp.ik.branches.branches_at` for arguments and result.

    Unlike the closed forms, it checks itself that a configuration reaches the pose.
    """
    g = chain.geometry[k]
    R, p = tool_motion(g, chain.joint[7], T)
    equations = equations_of(g, R, p)
    if not may_reach(equations):
        return False
    memory.counts[0] = memory.counts[1] = 0
    memory.free[1] = g[SHIFTED]
    for beyond in range(1 if inside_only else 2):
        count, view = 1, 0
        while view < count:
            count = _search_view(chain, g, R, equations, memory, view, count, beyond)
            view += 1
    found, reached = 0, False
    singular = memory.free[1] != 0.0
    # Those that start inside the limits come first: which rows they get does not depend on the others.
    for beyond in range(1 if inside_only and not singular else 2):
        for i in range(memory.counts[beyond]):
            if found == q.shape[0]:
                break
            row, start = q[found], memory.starts[beyond, i]
            for j in range(row.shape[0]):
                row[j] = start[j]
            reaches = polish_in(chain.forward, chain.fixed, row, T, memory.J, memory.A)
            fits = reaches and settle(chain.limits, row) and not beyond
            if singular and not fits:
                for j in range(row.shape[0]):
                    memory.row[j] = start[j]
                if into_limits(chain, memory.row, T, PULLS, memory.J, memory.A):
                    reaches = fits = True
                    for j in range(row.shape[0]):
                        row[j] = memory.row[j]
            if not reaches or misses(chain.forward, row, T) or _is_known(q, found):
                continue
            exists[found], inside[found] = True, fits
            found += 1
            reached |= fits
    if singular and not reached and found < q.shape[0]:
        found = _search_everywhere(chain, g, T, q, exists, inside, memory, found)
    return found > 0 or inside_only


@njit(**STRICT)
def _search_everywhere(chain, g, T, q, exists, inside, memory, found):
    """Look for a configuration inside the limits from joint values all over; return how many there are."""
    for i in range(MORE_STARTS):
        row = memory.row
        for j in range(row.shape[0]):
            first = max(chain.limits[0, j], chain.limits[2, j] - math.pi)
            last = min(chain.limits[1, j], chain.limits[2, j] + math.pi)
            share = (i + 1) * SPREAD[j]
            row[j] = first + (share - math.floor(share)) * (last - first)
        if chain.joint[6] >= 0:
            row[chain.joint[6]] = nearest_turn(chain.limits, chain.joint[6], g[PAIR_PHI])
        if into_limits(chain, row, T, MORE_STEPS, memory.J, memory.A):
            for j in range(row.shape[0]):
                q[found, j] = row[j]
            exists[found] = inside[found] = True
            return found + 1
    return found


@njit(**STRICT)
def _search_view(chain, g, R, equations, memory, view, count, beyond):
    """Find the zeros of N in a view; the parts where it is faint become views themselves.

    Args:
        chain, g, R, equations, memory: the arm at the pose.
        view: index of the view: the first is the whole turn, others are parts of it.
        count: number of views.
        beyond: of the whole turn, whether to search what is outside the limits, or what is inside.

    Returns:
        The number of views now.
    """
    if view == 0:
        centre, stretch, last = 0.0, 1.0, ARCS // 2
    else:  # shown from −90° to 90°
        first, width = memory.views[view, 0], memory.views[view, 1] - memory.views[view, 0]
        centre, stretch, last = first + 0.5 * width, math.tan(0.25 * width), ARCS // 4
    largest = _compute_values(equations, centre, stretch, memory)
    if not largest > 0.0:
        return count
    # The residuals are known up to some error, and small where the view is.
    noise = NOISE * largest / stretch
    outer = chain.joint[3] if g[OUTER_LAST] else chain.joint[0]
    for arc in range(-last, last + 1):
        if view == 0 and _arc_outside(chain.leeway, outer, arc) != beyond:
            continue
        bernstein(memory.values, arc % ARCS, memory.coefficients[0])
        where = (centre, stretch, arc, view)
        count = _search_arc(chain, g, R, equations, memory, where, noise, count)
    return count


@njit(**STRICT)
def _compute_values(equations, centre, stretch, memory):
    """Compute the values of N in a view; return the size of the largest."""
    c0, s0 = math.cos(centre), math.sin(centre)
    largest = 0.0
    for i in range(ARCS):
        half = math.pi * i / ARCS
        c, s = math.cos(half), stretch * math.sin(half)
        size = c * c + s * s
        c, s = (c * c - s * s) / size, 2.0 * c * s / size
        weight = size * size * size * size
        value = product(equations, c0 * c - s0 * s, s0 * c + c0 * s, memory.numbers) * weight * weight
        memory.values[i] = value
        largest = max(largest, abs(value))
    return largest


@njit(**STRICT)
def _angle(where, u):
    """Return the outer joint (rad) at a place from 0 to 1 in an arc of a view."""
    centre, stretch, arc, _ = where
    half = 0.5 * angle_in_arc(arc, u)
    return centre + 2.0 * math.atan2(stretch * math.sin(half), math.cos(half))


@njit(**STRICT)
def _arc_outside(limits, joint, arc):
    """Whether an arc of the whole turn is outside the limits of a joint."""
    middle, half = nearest_turn(limits, joint, angle_in_arc(arc, 0.5)), math.pi / ARCS
    beyond = half + LIMIT_TOLERANCE
    return middle + beyond < limits[0, joint] or middle - beyond > limits[1, joint]


@njit(**STRICT)
def _search_arc(chain, g, R, equations, memory, where, noise, count):
    """Find the zeros of N on an arc, of which memory has the coefficients; return the number of views."""
    spans = memory.spans
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    top = 0
    while top >= 0:
        c, first, last = memory.coefficients[top], spans[top, 0], spans[top, 1]
        zeros, faint = zeros_within(c, noise), largest_of(c) < FAINT * noise
        if zeros == NO_ZERO:
            pass
        elif zeros == ONE_ZERO and not faint:
            u = first + (last - first) * single_zero(c)
            _add_starts(chain, g, R, equations, memory, _angle(where, u))
        elif not faint and last - first > 1.5 / 2.0**HALVINGS:
            middle = 0.5 * (first + last)
            halve(c, memory.coefficients[top + 1], c)
            spans[top, 0], spans[top, 1] = middle, last
            spans[top + 1, 0], spans[top + 1, 1] = first, middle
            top += 2
        elif where[1] > LEAST_STRETCH and count < VIEWS:
            begin, end = _angle(where, first), _angle(where, last)
            count = _add_view(memory.views, begin, end, where, count)
            if end - begin < NARROW:
                memory.free[1] = 1.0
        else:
            u, v = double_zero(c)
            _add_starts(chain, g, R, equations, memory, _angle(where, first + (last - first) * u))
            _add_starts(chain, g, R, equations, memory, _angle(where, first + (last - first) * v))
        top -= 1
    return count


@njit(**STRICT)
def _add_view(views, first, last, where, count):
    """Add a part of a turn, from a first to a last angle, to the last view or after it; return how many."""
    _, stretch, _, view = where
    adjoins = count - 1 > view and abs(views[count - 1, 1] - first) < SAME
    if adjoins and math.tan(0.25 * (last - views[count - 1, 0])) < WIDEST * stretch:
        views[count - 1, 1] = last
        return count
    views[count, 0], views[count, 1] = first, last
    return count + 1


@njit(**STRICT)
def _nearly_real(e):
    """Whether ``e = exp(i q)`` is that of a nearly real angle q."""
    return abs(size2(e) - 1.0) < 2.0 * NEARLY_REAL


@njit(**STRICT)
def _add_starts(chain, g, R, equations, memory, x):
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


@njit(**STRICT)
def _is_known(q, found):
    """Whether the configuration in a row is that of a row before it, up to full turns."""
    for i in range(found):
        largest = 0.0
        for j in range(q.shape[1]):
            d = q[i, j] - q[found, j]
            largest = max(largest, abs(d - 2.0 * math.pi * math.floor(d / (2.0 * math.pi) + 0.5)))
        if largest < SAME:
            return True
    return False
