"""Rounded paths, against their polylines point by point."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.motion.times.rounding import RoundedPath, pieces
from symgrasp.poses import Array

WEIGHT = np.array([1.0, 0.5, 2.0])


@st.composite
def polylines(draw: st.DrawFn) -> Array:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = np.cumsum(rng.normal(0, draw(st.sampled_from([0.001, 0.1, 2.0])), (draw(st.integers(2, 7)), 3)), 0)
    return np.repeat(rows, rng.integers(1, 3, len(rows)), axis=0)


def off(points: Array, rows: Array) -> Array:
    """Return how far the body is off a polyline at each of some points, by searching along it."""
    share = np.linspace(0, 1, 400)[:, None, None]
    along = (rows[:-1] + share * np.diff(rows, axis=0)).reshape(-1, rows.shape[1])
    return (np.abs(points[:, None] - along) @ WEIGHT).min(axis=1)


@settings(max_examples=60)
@given(polylines(), st.sampled_from([1e-4, 1e-2, 1.0]))
def test_the_path_stays_as_near_as_it_says_and_has_no_corners(rows, tolerance):
    runs = pieces(rows, WEIGHT, tolerance)
    np.testing.assert_array_equal(runs[0][0], rows[0])
    np.testing.assert_array_equal(runs[-1][-1], rows[-1])
    for before, after in pairwise(runs):
        np.testing.assert_array_equal(before[-1], after[0])
    for run in runs:
        path = RoundedPath(run, WEIGHT, tolerance)
        s = np.linspace(0, path.length, 200)
        spacing = np.abs(np.diff(run, axis=0)).max() * WEIGHT.sum() / 400
        assert off(path(s), run).max() <= path.deviation + spacing + 1e-9
        assert path.deviation <= tolerance * (1 + 1e-9)
        np.testing.assert_allclose(path(np.array([0.0, path.length])), run[[0, -1]], atol=1e-9)
        for knot in path.knots[1:-1]:
            for order in (0, 1):
                both = path(np.array([knot - 1e-9, knot + 1e-9]), order)
                slope = np.abs(path(np.array([knot - 1e-9, knot + 1e-9]), order + 1)).max()
                np.testing.assert_allclose(both[0], both[1], atol=1e-8 * (1 + slope))
        chords = np.linspace(0, path.length, 23)
        inner = np.linspace(chords[:-1], chords[1:], 30)
        lines = np.linspace(path(chords[:-1]), path(chords[1:]), 30)
        assert (np.abs(path(inner) - lines) @ WEIGHT).max() <= path.chord_deviation(chords) + 1e-12


def test_corners_that_may_not_be_rounded_are_stops():
    rows = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [2, 2, 0.0]])
    assert [len(run) for run in pieces(rows, WEIGHT, 0.0)] == [2, 2, 2]
    assert [len(run) for run in pieces(rows, WEIGHT, 0.1)] == [4]
    assert pieces(rows[:1].repeat(3, axis=0), WEIGHT, 0.0) == []


def test_straight_rows_are_one_line():
    path = RoundedPath(np.linspace([0, 0, 0], [1, 2, 3.0], 5), WEIGHT, 1e-3)
    assert path.deviation < 1e-12
    assert path.chord_deviation(np.array([0.0, path.length])) < 1e-12
