"""Zeros of trigonometric polynomials from 17 values, against the zeros that they were made of."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik import arcs
from symgrasp.poses import Array

bernstein, halve, zeros_within = (njit(**ENTRY)(f) for f in (arcs.bernstein, arcs.halve, arcs.zeros_within))
single_zero, double_zero = njit(**ENTRY)(arcs.single_zero), njit(**ENTRY)(arcs.double_zero)
slope_at_zero = njit(**ENTRY)(arcs.slope_at_zero)


def polynomial(roots: np.ndarray, angle: Array) -> Array:
    """Return the trigonometric polynomial of degree 8 with 16 zeros, complex ones in conjugate pairs."""
    return np.prod(np.sin((np.asarray(angle)[..., None] - roots) / 2), axis=-1).real


def zeros(values: Array, noise: float) -> list[float]:
    """Return all zeros; of those that all but coincide, at most two places near them."""
    found = []
    for arc in range(arcs.ARCS):
        c = np.empty(arcs.ARCS)
        bernstein(values, arc, c)
        parts = [(c, 0.0, 1.0)]
        while parts:
            c, first, last = parts.pop()
            many = zeros_within(c, noise, noise)
            if many == arcs.ONE_ZERO:
                places = [single_zero(c)]
            elif many == arcs.NO_ZERO:
                continue
            elif last - first < 1e-4 or arcs.largest_of(c) < 10 * noise:
                places = list(double_zero(c))
            else:
                left, right = np.empty(arcs.ARCS), np.empty(arcs.ARCS)
                halve(c, left, right)
                middle = 0.5 * (first + last)
                parts += [(left, first, middle), (right, middle, last)]
                continue
            found += [arcs.angle_in_arc(arc, first + (last - first) * u) for u in places]
    return found


def apart(a: float, others: list[float]) -> float:
    return float(np.abs((np.array(others) - a + np.pi) % (2 * np.pi) - np.pi).min(initial=np.inf))


TURN = 2 * np.pi * np.arange(arcs.ARCS) / arcs.ARCS


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(0, 8))
def test_all_real_zeros(seed, pairs):
    rng = np.random.default_rng(seed)
    real = rng.uniform(-np.pi, np.pi, 16 - 2 * pairs)
    complex_ = rng.uniform(-np.pi, np.pi, pairs) + 1j * rng.uniform(0.2, 1.0, pairs)
    roots = np.concatenate([real, complex_, complex_.conj()])
    values = polynomial(roots, TURN)
    values /= np.abs(values).max()
    found = zeros(values, 1e-14)
    # Where others are near, rounding moves a zero.
    for zero in real:
        alone = np.prod(np.abs(np.sin((zero - roots[roots != zero]) / 2)))
        assert apart(zero, found) < 1e-9 + 1e-12 / max(alone, 1e-12)
    if len(real) == 0:
        assert not found


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-6, 1e-3, 1e-9j, 1e-7j])
def test_zeros_that_all_but_coincide(gap):
    rng = np.random.default_rng(0)
    for _ in range(30):
        others = rng.uniform(-np.pi, np.pi, 7) + 1j * rng.uniform(0.3, 1.0, 7)
        zero = float(rng.uniform(-np.pi, np.pi))
        roots = np.concatenate([[zero + gap / 2, zero - gap / 2], others, others.conj()])
        values = polynomial(roots, TURN)
        found = zeros(values / np.abs(values).max(), 1e-14)
        assert apart(zero + np.real(gap) / 2, found) < 1e-4
        assert apart(zero - np.real(gap) / 2, found) < 1e-4


def test_a_polynomial_on_an_arc():
    """The first coefficient and the last are its values at the ends, up to a positive factor."""
    roots = np.random.default_rng(1).uniform(-np.pi, np.pi, 16)
    values, c = polynomial(roots, TURN), np.empty(arcs.ARCS)
    for arc in range(arcs.ARCS):
        bernstein(values, arc, c)
        for u, end in ((0.0, c[0]), (1.0, c[-1])):
            expected = polynomial(roots, np.array(arcs.angle_in_arc(arc, u)))
            assert end == pytest.approx(expected / np.cos(np.pi / 34) ** 16, rel=1e-6, abs=1e-14)


def test_coefficients_are_as_exact_as_numbers_are():
    """The polynomial between its values is known up to their own rounding, not to that of a matrix."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        waves = rng.normal(size=17)
        values, c = _series(waves, TURN), np.empty(arcs.ARCS)
        size = np.abs(values).max()
        for arc in range(arcs.ARCS):
            bernstein(values, arc, c)
            for u in np.linspace(0.0, 1.0, 21):
                basis = [math.comb(16, j) * u**j * (1.0 - u) ** (16 - j) for j in range(17)]
                y = (2.0 * u - 1.0) * np.tan(np.pi / 34)
                expected = _series(waves, np.array(arcs.angle_in_arc(arc, u))) * (1.0 + y * y) ** 8
                assert abs(c @ basis - expected) < 2e-14 * size


def _series(waves: np.ndarray, angle: Array) -> Array:
    """Return the sum of the waves 1, cos θ, sin θ, cos 2θ and so on at angles θ."""
    k = np.arange(1, 9) * np.asarray(angle)[..., None]
    return waves[0] + np.cos(k) @ waves[1:9] + np.sin(k) @ waves[9:]


def test_the_slope_at_a_zero():
    roots, c = np.linspace(-3.0, 3.0, 16) + 0.15, np.empty(arcs.ARCS)
    bernstein(polynomial(roots, TURN), 0, c)
    u = single_zero(c)
    assert arcs.angle_in_arc(0, u) == pytest.approx(-0.05, abs=1e-9)
    low, high = (polynomial(roots, np.array(arcs.angle_in_arc(0, u + step))) for step in (-1e-6, 1e-6))
    assert slope_at_zero(c, u) == pytest.approx((high - low) / 2e-6, rel=0.1)


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32 - 1), st.integers(1, 15), st.sampled_from([0.3, 2.0, 6.0]))
def test_a_single_zero_is_found_whatever_the_coefficients(seed, negative, powers):
    """Against halving alone, with coefficients that differ by many powers of ten."""
    c = 10.0 ** (powers * np.random.default_rng(seed).normal(size=arcs.ARCS))
    c[:negative] *= -1.0
    choose = [math.comb(arcs.ARCS - 1, j) for j in range(arcs.ARCS)]
    first, last = 0.0, 1.0
    while last - first > 1e-12:
        u = 0.5 * (first + last)
        value = sum(n * u**j * (1.0 - u) ** (arcs.ARCS - 1 - j) * c[j] for j, n in enumerate(choose))
        first, last = (u, last) if value < 0.0 else (first, u)
    assert single_zero(c) == pytest.approx(first, abs=2e-9)
