"""Complex roots of polynomials, compiled: all at once, by the method of Ehrlich and Aberth."""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT

__all__ = ["find_roots", "inverse_of", "size2", "start_circle_quartic"]

CONVERGED2 = 1e-20
"""Square of the relative step below which a root counts as found: the next step is smaller than rounding."""

LINE_STEPS, LINE_CLOSE = 40, 1e-12
"""Steps, and the last step, at which the search for a pair of lines ends."""

INSIDE = 1.0 - 1e-12
"""Where it begins: at ±1 there may be a zero whose lines are imaginary."""

LEAST_LEADING = 1e-12
"""Leading coefficient, as a share of the others, below which two roots are far away, wherever."""

LEAST_DIVISOR = 0.1
"""A quotient by less is computed otherwise."""

STEPS = 60
"""Steps after which the search ends: roots that coincide converge slowly, and are blurred anyhow."""


@njit(**STRICT)
def size2(z):
    """Return |z|² of a complex number."""
    return z.real * z.real + z.imag * z.imag


@njit(**STRICT)
def inverse_of(z):
    """Return 1 / z of a complex number."""
    scale = 1.0 / size2(z)  # a division of complex numbers by zero would raise
    return complex(z.real * scale, -z.imag * scale)


@njit(**STRICT)
def find_roots(c, first, last, z):
    """Improve estimates of all roots of the polynomial ``c[first] + … + c[last] x^(last − first)``.

    Args:
        c: complex coefficients.
        first: index of the constant one.
        last: index of the leading one, which is not zero.
        z: (last − first or more,) complex estimates; receives the roots.
    """
    n = last - first
    for _ in range(STEPS):
        largest = 0.0
        for i in range(n):
            x = z[i]
            value, slope = c[last], 0.0j
            for k in range(last - 1, first - 1, -1):
                slope = slope * x + value
                value = value * x + c[k]
            if size2(value) == 0.0:
                continue
            others = 0.0j
            for j in range(n):
                if j != i and x != z[j]:  # estimates of a double root may be the same
                    others += inverse_of(x - z[j])
            step = inverse_of(slope * inverse_of(value) - others)
            if not size2(step) < math.inf:
                continue
            z[i] = x - step
            largest = max(largest, size2(step) / size2(x))
        if not largest > CONVERGED2:
            break


@njit(**STRICT)
def start_circle_quartic(c, first, z):
    """Write estimates of the four roots of ``k2 + k1 b + k0 b² + …`` whose other coefficients are conjugate.

    On the unit circle, turned so that ``k2 b²`` becomes A (X + iY)² with real A, it is the conic

        (1 + μ) X² − (1 − μ) Y² + 2 a X − 2 b Y + c − μ = 0     for any μ, as X² + Y² = 1.

    Some μ from −1 to 1 makes it two real lines, which meet the circle at the roots, or pass it.

    Args:
        c: complex coefficients.
        first: index of the constant one.
        z: index in c of the first estimate.
    """
    largest = math.sqrt(size2(c[first + 3])) + abs(c[first + 2].real)
    size = max(math.sqrt(size2(c[first + 4])), LEAST_LEADING * largest)
    turn = _unit_root(c[first + 4].conjugate() * (1.0 / size))
    k1 = c[first + 3] * turn
    a, b, k0 = 0.5 * k1.real / size, 0.5 * k1.imag / size, 0.5 * c[first + 2].real / size
    mu = _line_pair(a * a, b * b, k0)
    s1, s2 = math.sqrt(1.0 + mu), math.sqrt(1.0 - mu)
    p, r = a / s1, b / s2  # p² − r² = c − μ
    if s1 < LEAST_DIVISOR:
        p = math.copysign(math.sqrt(max(r * r + k0 - mu, 0.0)), a)
    elif s2 < LEAST_DIVISOR:
        r = math.copysign(math.sqrt(max(p * p - k0 + mu, 0.0)), b)
    half = math.sqrt(0.5)
    for i in range(2):
        way = 1.0 if i == 0 else -1.0
        d = half * (way * r - p)  # the distance of a line along its normal (s1, −way s2) / √2
        normal = half * turn * complex(s1, -way * s2)
        rest = 1.0 - d * d
        if rest >= 0.0:
            root = math.sqrt(rest)
            z0, z1 = complex(d, root), complex(d, -root)
        else:
            far = d + math.copysign(math.sqrt(-rest), d)
            z0, z1 = far + 0.0j, 1.0 / far + 0.0j
        c[z + 2 * i], c[z + 2 * i + 1] = normal * z0, normal * z1


@njit(**STRICT)
def _line_pair(a2, b2, c):
    """Return a zero μ of ``(c − μ)(1 − μ²) − a² (1 − μ) + b² (1 + μ)`` from −1 to 1 (Newton, bracketed)."""
    # Of three zeros, the outer one that is further from the next is known best: on this side of the middle.
    low, high, mu = -1.0, 1.0, c / 3.0
    mu = -INSIDE if (c - mu) * (1.0 - mu * mu) - a2 * (1.0 - mu) + b2 * (1.0 + mu) > 0.0 else INSIDE
    for _ in range(LINE_STEPS):
        value = (c - mu) * (1.0 - mu * mu) - a2 * (1.0 - mu) + b2 * (1.0 + mu)
        slope = mu * mu - 1.0 - 2.0 * mu * (c - mu) + a2 + b2
        if value < 0.0:
            low = mu
        else:
            high = mu
        before, mu = mu, mu - value / slope
        if not low < mu < high:
            mu = 0.5 * (low + high)
        if abs(mu - before) < LINE_CLOSE:
            break
    return mu


@njit(**STRICT)
def _unit_root(z):
    """Return a square root of a complex number of size 1."""
    if z.real >= 0.0:
        re = math.sqrt(0.5 * (1.0 + z.real))
        return complex(re, 0.5 * z.imag / re)
    im = math.sqrt(0.5 * (1.0 - z.real))
    return complex(0.5 * z.imag / im, im)
