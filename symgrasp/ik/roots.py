"""All complex roots of a polynomial at once, compiled: the method of Ehrlich and Aberth."""

from __future__ import annotations

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT

__all__ = ["find_roots", "inverse_of", "size2"]

CONVERGED2 = 1e-20
"""Square of the relative step below which a root counts as found: the next step is smaller than rounding."""

STEPS = 60
"""Steps after which the search ends: roots that coincide converge slowly, and are blurred anyhow."""


@njit(**STRICT)
def size2(z):
    """Return |z|² of a complex number."""
    return z.real * z.real + z.imag * z.imag


@njit(**STRICT)
def inverse_of(z):
    """Return 1 / z of a complex number."""
    return z.conjugate() / size2(z)


@njit(**STRICT)
def find_roots(c, first, last, z):
    """Improve estimates of all roots of the polynomial ``c[first] + … + c[last] x^(last − first)``.

    Args:
        c: complex coefficients.
        first: index of the constant one.
        last: index of the leading one, which is not zero.
        z: (last − first or more,) complex estimates, all different; receives the roots.
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
                if j != i:
                    others += inverse_of(x - z[j])
            step = inverse_of(slope * inverse_of(value) - others)
            z[i] = x - step
            largest = max(largest, size2(step) / size2(x))
        if not largest > CONVERGED2:
            break
