"""Zeros of a real trigonometric polynomial from its values, compiled: arc by arc, in Bernstein's basis.

On an arc about θ' the polynomial of degree d is ``p(y) / (1 + t² y²)^d`` of ``y = tan((θ − θ') / 2) / t``,
and p a polynomial of degree 2d. Its Bernstein coefficients bound it: where all have one sign it has no zero
there, and where the sign changes once it has one (J. Lane and R. Riesenfeld, Bounds on a polynomial, 1981).
Other arcs are halved.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT
from symgrasp.poses import Array

__all__ = [
    "ARCS", "HALVINGS", "MORE", "NO_ZERO", "ONE_ZERO", "angle_in_arc", "bernstein", "double_zero",
    "halve", "largest_of", "single_zero", "slope_at_zero", "zeros_within",
]  # fmt: skip

DEGREE = 8
"""Degree of the trigonometric polynomials."""

ARCS = 2 * DEGREE + 1
"""Values that determine one, at equal steps of a turn; each is the middle of an arc."""

HALVINGS = 14
"""Halvings of an arc after which two zeros that are still together are taken for a double one."""

NO_ZERO, ONE_ZERO, MORE = 0, 1, 2
"""How many zeros there are, as far as signs tell."""

TANGENT = math.tan(0.5 * math.pi / ARCS)
"""The t of an arc."""

APART = 0.05
"""Least distance of two zeros that are taken for a double one, as a share of half the part of an arc."""

STEPS, CLOSE = 100, 1e-9
"""Steps, and width (of the arc), at which the search for a single zero ends."""

SLOW = 2
"""Steps that are to halve where a zero may be."""

SECANT = 1e-3
"""How far from a place (of the arc) a slope is taken."""


def _from_values() -> Array:
    """Return what each value (row), that of an arc's middle first, adds to each coefficient (column).

    ``exp(ikθ) (1 + t² y²)^d = (1 + ity)^(d + k) (1 − ity)^(d − k)``, and 1 ± ity goes from 1 ∓ it to 1 ± it.
    """
    n, a = ARCS - 1, complex(1.0, -TANGENT)
    choose = [math.comb(n, j) for j in range(ARCS)]
    matrix = np.zeros((ARCS, ARCS))
    for k in range(-DEGREE, DEGREE + 1):
        first, last = (
            np.array([math.comb(m, j) * x ** (m - j) * x.conjugate() ** j for j in range(m + 1)])
            for x, m in ((a, DEGREE + k), (a.conjugate(), DEGREE - k))
        )
        turn = np.exp(-2j * np.pi * k * np.arange(ARCS) / ARCS)
        matrix += np.real(np.outer(turn, np.convolve(first, last) / choose)) / ARCS
    return matrix


FROM_VALUES = _from_values()


@njit(**STRICT)
def bernstein(values, arc, c):
    """Write the coefficients (ARCS,) of the polynomial on an arc into c, from all of its values (ARCS,)."""
    for j in range(ARCS):
        c[j] = 0.0
    for i in range(ARCS):
        value = values[(arc + i) % ARCS]
        for j in range(ARCS):  # several at once
            c[j] += FROM_VALUES[i, j] * value


@njit(**STRICT)
def angle_in_arc(arc, u):
    """Return the angle (rad) at a place in an arc, where its ends are at 0 and 1."""
    return 2.0 * math.pi * arc / ARCS + 2.0 * math.atan(TANGENT * (2.0 * u - 1.0))


@njit(**STRICT)
def zeros_within(c, noise, near):
    """Return `NO_ZERO`, `ONE_ZERO`, or `MORE` where these cannot be told from it.

    Args:
        c: the coefficients.
        noise: their error: those that are smaller may have either sign.
        near: how close to zero they are at least where there is `NO_ZERO`; not less than the noise.
    """
    least, most, changes, possible, negative = c[0], c[0], 0, 0, c[0] < 0.0
    for j in range(1, ARCS):
        least, most = min(least, c[j]), max(most, c[j])
        if (c[j] < 0.0) != (c[j - 1] < 0.0):
            changes += 1
        if abs(c[j]) <= noise or (c[j] < 0.0) != negative:
            possible += 1
            negative = not negative
    if least > near or most < -near:
        return NO_ZERO
    return ONE_ZERO if changes == possible == 1 else MORE


@njit(**STRICT)
def largest_of(c):
    """Return the largest size of some coefficients."""
    largest = 0.0
    for j in range(ARCS):
        largest = max(largest, abs(c[j]))
    return largest


@njit(**STRICT)
def halve(c, left, right):
    """Write the coefficients of both halves (de Casteljau)."""
    for j in range(ARCS):
        right[j] = c[j]
    for k in range(ARCS):
        left[k] = right[0]
        for j in range(ARCS - 1 - k):
            right[j] = 0.5 * (right[j] + right[j + 1])


@njit(**STRICT)
def _value(c, u):
    """Return the polynomial at a place from 0 to 1 (W. Boehm and A. Müller, On de Casteljau's algorithm)."""
    power, choose, total = 1.0, 1.0, c[0] * (1.0 - u)
    for j in range(1, ARCS - 1):
        power *= u
        choose *= (ARCS - j) / j
        total = (total + power * choose * c[j]) * (1.0 - u)
    return total + power * u * c[ARCS - 1]


@njit(**STRICT)
def single_zero(c):
    """Return the place, from 0 to 1, of the only zero, to within `CLOSE`.

    By the Illinois method. Where the coefficients differ by many powers of ten it would creep, and its steps
    be small far from the zero: where two of them have not halved what is left, that is halved.
    """
    a, b, fa, fb = 0.0, 1.0, c[0], c[ARCS - 1]
    side, taken, before = 0, 0, 1.0
    for _ in range(STEPS):
        if b - a <= CLOSE:
            break
        if taken == SLOW:
            u, side, taken, before = 0.5 * (a + b), 0, 0, b - a
        else:
            u = min(max((a * fb - b * fa) / (fb - fa), a + 0.5 * CLOSE), b - 0.5 * CLOSE)
        f = _value(c, u)
        if f == 0.0:
            return u
        if (f < 0.0) == (fb < 0.0):
            b, fb = u, f
            fa *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            a, fa = u, f
            fb *= 0.5 if side < 0 else 1.0
            side = -1
        taken += 1
        if b - a < 0.5 * before:
            taken, before = 0, b - a
    return (a * fb - b * fa) / (fb - fa)


@njit(**STRICT)
def slope_at_zero(c, u):
    """Return the slope of the polynomial at a place from 0 to 1 where it is zero."""
    step = SECANT if u < 0.5 else -SECANT
    return _value(c, u + step) / step


@njit(**STRICT)
def double_zero(c):
    """Return two places near two zeros that all but coincide, or where there almost are some."""
    middle = _value(c, 0.5)
    slope, bend = 0.5 * (c[ARCS - 1] - c[0]), 0.5 * (c[ARCS - 1] + c[0]) - middle
    top = min(max(-0.5 * slope / bend, -1.0), 1.0) if bend != 0.0 else 0.0
    rest = -(middle + top * (slope + top * bend)) / bend if bend != 0.0 else 0.0
    apart = math.sqrt(min(max(rest, APART * APART), 1.0))
    return 0.5 + 0.5 * (top - apart), 0.5 + 0.5 * (top + apart)
