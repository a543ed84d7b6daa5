"""Roots of quartics that are conics on the unit circle, against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik import roots as of_polynomials
from symgrasp.poses import Array

find_roots = njit(**ENTRY)(of_polynomials.find_roots)
start_circle_quartic = njit(**ENTRY)(of_polynomials.start_circle_quartic)

part = st.floats(-1.0, 1.0)


def solved(k2: complex, k1: complex, k0: float) -> tuple[Array, Array]:
    """Return the estimates and the roots."""
    c = np.array([k2.conjugate(), k1.conjugate(), k0, k1, k2, 0, 0, 0, 0], dtype=complex)
    start_circle_quartic(c, 0, 5)
    start = c[5:].copy()
    find_roots(c, 0, 4, c[5:])
    return start, c[5:].copy()


@settings(deadline=None, max_examples=300)
@given(part, part, part, part, part)
def test_roots(a, b, c, d, k0):
    k2, k1 = complex(a, b), complex(c, d)
    if abs(k2) < 1e-6:
        k2 = complex(1e-6, 1e-6)
    _, roots = solved(k2, k1, k0)
    expected = np.roots([k2, k1, k0, k1.conjugate(), k2.conjugate()])
    for root in expected:
        others = np.abs(expected - root)
        others = np.sort(others[others > 0]) / abs(root)
        # A root that all but coincides with others is blurred.
        blur = 1e-15 / max(float(np.prod(np.minimum(others, 1.0))), 1e-12) if len(others) == 3 else 1e-3
        assert np.abs(roots - root).min() < (1e-9 + min(1e3 * blur, 1e-3)) * abs(root) + 1e-14


def of_angles(angles: Array) -> tuple[complex, complex, float]:
    P = np.poly(np.exp(1j * angles))[::-1]
    P = P * np.exp(-0.5j * np.angle(P[0] * P[4]))
    return complex(P[4]), complex(P[3]), float(P[2].real)


@pytest.mark.parametrize("gap", [1e-4, 1e-3, 1e-2, 1.0])
def test_estimates_of_four_points_on_the_circle(gap):
    """They are as good as rounding allows, for pairs that are close, too."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        first = rng.uniform(-np.pi, np.pi, 2)
        angles = np.concatenate([first, first + gap * rng.uniform(0.5, 1.5, 2)])
        start, roots = solved(*of_angles(angles))
        for angle in angles:
            assert np.abs(roots - np.exp(1j * angle)).min() < 1e-10 / gap**2
            assert np.abs(start - np.exp(1j * angle)).min() < 1e-6 / gap
