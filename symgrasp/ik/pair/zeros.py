"""The zeros of N (`symgrasp.ik.pair.solver`) from its values all around and on parts of a turn. Compiled."""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.arcs import (
    ARCS,
    HALVINGS,
    MORE,
    NO_ZERO,
    ONE_ZERO,
    angle_in_arc,
    bernstein,
    double_zero,
    halve,
    largest_of,
    single_zero,
    slope_at_zero,
    zeros_within,
)
from symgrasp.ik.joints import nearest_turn
from symgrasp.ik.pair.geometry import OUTER_LAST
from symgrasp.ik.pair.polynomial import product
from symgrasp.ik.pair.starts import add_starts
from symgrasp.ik.vectors import STRICT
from symgrasp.robot.limits import LIMIT_TOLERANCE

__all__ = ["VIEWS", "search_turn"]

VIEWS = 12
"""Parts of a turn, at most, from whose values N is computed."""

NOISE = 1e-14
"""Error of N that is computed from values all around, as a share of the largest."""

FAINT = 1e3
"""Largest coefficient of N, as a multiple of that error, below which it is computed from other values."""

TESTED = (3, 12, 0, 7, 9)
"""Values of N after which others are computed, half way to the next, to learn how large its error is."""

FEW_TESTS, TESTS = 1, 3
"""How many of them in the view of the whole turn, and in others."""

BETWEEN = np.array([
    (-1.0) ** k / (ARCS * math.sin(math.pi * (k + 0.5) / ARCS)) for k in range(ARCS)
])  # fmt: skip
"""What the values at k steps before half a step add to that between."""

MARGIN = 4.0
"""How much larger it may be elsewhere."""

HOPELESS = 1e-4
"""Error of N, as a share of its largest value, from which on no zeros are sought."""

UNCERTAIN, ASIDE = 1e-10, 0.1
"""Error of N, as a share of its largest value, from which on the whole turn is tried with another centre
(rad) than 0: N cannot be computed where the point is exactly on an axis, as it may be at one of them."""

LEAST_ERROR = 1e-13
"""Value of N, as a share of the largest, that rounding of the pose may change it by."""

TOUCHING, CLOSEST = 3e-5, 0.04
"""Distance (of an arc) up to which two zeros may be complex by such rounding that all but coincide, and that
distance, as a share of the part where they are, from which on they are tried."""

BLURRED = 1e-4
"""Error (of an arc) of a zero by that of N from which on it is sought in a view of its own."""

ADJOINING = 1e-7
"""Distance (rad) of parts of a turn that adjoin."""

WIDEST, LEAST_STRETCH = 0.4, 1e-4
"""Stretch of such values at most, as a share of that of those before, and at least."""

NARROW = 3e-4
"""Width (rad) of a part in which N is faint below which the pose may be singular, too."""


@njit(**STRICT)
def search_turn(chain, g, R, equations, memory, beyond):
    """Find the zeros of N where the outer joint is inside the limits, or beyond them, in all views."""
    count, view = 1, 0
    if not beyond:
        memory.views[0, 0] = 0.0
    while view < count:
        count = _search_view(chain, g, R, equations, memory, view, count, beyond)
        view += 1


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
        centre, stretch, last = memory.views[0, 0], 1.0, ARCS // 2
    else:  # shown from −90° to 90°
        first, width = memory.views[view, 0], memory.views[view, 1] - memory.views[view, 0]
        centre, stretch, last = first + 0.5 * width, math.tan(0.25 * width), ARCS // 4
    values = memory.values[min(view, 1)]
    if view > 0 or not beyond:  # those of the whole turn are known then
        tests = TESTS if view > 0 else FEW_TESTS
        values[ARCS], values[ARCS + 1] = _compute_values(
            equations, centre, stretch, tests, memory.numbers, values
        )
        if view == 0 and values[ARCS + 1] > UNCERTAIN * values[ARCS]:
            centre = _look_aside(equations, tests, memory)
    largest, noise = values[ARCS], values[ARCS + 1]
    near = max(noise, LEAST_ERROR * memory.values[0, ARCS])
    if not largest > 0.0:
        return count
    hopeless = noise > HOPELESS * largest
    if hopeless:
        memory.free[1] = 1.0
    outer = chain.joint[3] if g[OUTER_LAST] else chain.joint[0]
    for arc in range(-last, last + 1):
        if view == 0 and _arc_outside(chain.leeway, outer, arc, centre) != beyond:
            continue
        where = (centre, stretch, arc, view)
        if hopeless:
            if view == 0 or arc % 2 == 0:
                add_starts(chain, g, R, equations, memory, _angle(where, 0.5))
            continue
        bernstein(values, arc % ARCS, memory.coefficients[0])
        count = _search_arc(chain, g, R, equations, memory, where, (noise, near), count)
    return count


@njit(**STRICT)
def _look_aside(equations, tests, memory):
    """Take the values of N about another centre of the whole turn if they are better; return the centre."""
    values, others = memory.values[0], memory.values[1]
    others[ARCS], others[ARCS + 1] = _compute_values(equations, ASIDE, 1.0, tests, memory.numbers, others)
    if others[ARCS + 1] * values[ARCS] < values[ARCS + 1] * others[ARCS]:
        memory.views[0, 0] = ASIDE
        for i in range(ARCS + 2):
            values[i] = others[i]
    return memory.views[0, 0]


@njit(**STRICT)
def _compute_values(equations, centre, stretch, tests, work, values):
    """Compute the values of N in a view; return the size of the largest, and about how large their error is.

    Args:
        equations: those of the pose.
        centre, stretch: the view.
        tests: at how many other angles of it N is computed, to compare it with what the values say it is.
        work: memory for N.
        values: (ARCS or more,) receives the values.
    """
    c0, s0 = math.cos(centre), math.sin(centre)
    largest = error = 0.0
    for i in range(ARCS):
        values[i] = _weighted(equations, c0, s0, stretch, math.pi * i / ARCS, work)
        largest = max(largest, abs(values[i]))
    for k in range(tests):
        between = 0.0
        for i in range(ARCS):
            between += BETWEEN[(TESTED[k] - i) % ARCS] * values[i]
        half = math.pi * (TESTED[k] + 0.5) / ARCS
        error = max(error, abs(between - _weighted(equations, c0, s0, stretch, half, work)))
    # The residuals are known up to some error, and small where the view is.
    return largest, max(NOISE * largest, MARGIN * error)


@njit(**STRICT)
def _weighted(equations, c0, s0, stretch, half, work):
    """Return N, times its weight, at half an angle θ of a view about a centre of that cosine and sine."""
    c, s = math.cos(half), stretch * math.sin(half)
    size = c * c + s * s
    c, s = (c * c - s * s) / size, 2.0 * c * s / size
    weight = size * size * size * size
    return product(equations, c0 * c - s0 * s, s0 * c + c0 * s, work) * weight * weight


@njit(**STRICT)
def _angle(where, u):
    """Return the outer joint (rad) at a place from 0 to 1 in an arc of a view."""
    centre, stretch, arc, _ = where
    half = 0.5 * angle_in_arc(arc, u)
    return centre + 2.0 * math.atan2(stretch * math.sin(half), math.cos(half))


@njit(**STRICT)
def _arc_outside(limits, joint, arc, centre):
    """Whether an arc of the whole turn, about a centre, is outside the limits of a joint."""
    middle, half = nearest_turn(limits, joint, centre + angle_in_arc(arc, 0.5)), math.pi / ARCS
    beyond = half + LIMIT_TOLERANCE
    return middle + beyond < limits[0, joint] or middle - beyond > limits[1, joint]


@njit(**STRICT)
def _search_arc(chain, g, R, equations, memory, where, errors, count):
    """Find the zeros of N on an arc, of which memory has the coefficients; return the number of views."""
    spans, (noise, near) = memory.spans, errors
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    top = 0
    while top >= 0:
        c, first, last = memory.coefficients[top], spans[top, 0], spans[top, 1]
        largest, share = largest_of(c), min(TOUCHING / ((last - first) * where[1]), CLOSEST)
        zeros = zeros_within(c, noise, max(near, share * share * largest))
        faint = largest < FAINT * noise
        single, goes_on = zeros == ONE_ZERO and not faint, where[1] > LEAST_STRETCH and count < VIEWS
        u = single_zero(c) if single else 0.0
        # Several zeros that all but coincide may look like single ones beside them.
        blurred = single and noise * (last - first) * where[1] > BLURRED * abs(slope_at_zero(c, u))
        touches = (
            zeros == MORE
            and (share == CLOSEST or largest < FAINT * near)
            and zeros_within(c, noise, noise) == NO_ZERO
        )
        if zeros == NO_ZERO:
            pass
        elif single and not (blurred and goes_on):
            if blurred:
                memory.free[1] = 1.0
            add_starts(chain, g, R, equations, memory, _angle(where, first + (last - first) * u))
        elif not single and not faint and not touches and last - first > 1.5 / 2.0**HALVINGS:
            middle = 0.5 * (first + last)
            halve(c, memory.coefficients[top + 1], c)
            spans[top, 0], spans[top, 1] = middle, last
            spans[top + 1, 0], spans[top + 1, 1] = first, middle
            top += 2
        elif goes_on and not touches:
            begin, end = _angle(where, first), _angle(where, last)
            count = _add_view(memory.views, begin, end, where, count)
            if end - begin < NARROW:
                memory.free[1] = 1.0
        else:
            memory.free[1] = 1.0
            u, v = double_zero(c)
            add_starts(chain, g, R, equations, memory, _angle(where, first + (last - first) * u))
            add_starts(chain, g, R, equations, memory, _angle(where, first + (last - first) * v))
        top -= 1
    return count


@njit(**STRICT)
def _add_view(views, first, last, where, count):
    """Add a part of a turn, from a first to a last angle, to the last view or after it; return how many."""
    _, stretch, _, view = where
    adjoins = count - 1 > view and abs(views[count - 1, 1] - first) < ADJOINING
    if adjoins and math.tan(0.25 * (last - views[count - 1, 0])) < WIDEST * stretch:
        views[count - 1, 1] = last
        return count
    views[count, 0], views[count, 1] = first, last
    return count + 1
