"""Where an object is worth trying: within reach, on the table, on a grid of round numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.poses import from_position_rpy
from symgrasp.scene.scene import Scene
from symgrasp.survey.regions import Rectangle, length_of_arm, places_of_object, support_height

BOTTLE = Scene.load("bottle_on_table")


def test_an_object_on_a_table_stays_above_it_and_within_reach():
    places = places_of_object(BOTTLE, "panda", BOTTLE.task())
    length = length_of_arm(BOTTLE, "panda")
    assert 0.855 < length < 1.3  # the reach that its maker states, and its links one after the other
    assert places.x == pytest.approx((0.05, length))  # the table begins there
    assert places.y == pytest.approx((-0.6, 0.6))


def test_an_object_in_mid_air_may_be_anywhere_within_reach():
    task = BOTTLE.task()
    high = replace(task, T_world_object=from_position_rpy([0.5, 0.0, 0.4], [0.0, 0.0, 0.0]))
    length = length_of_arm(BOTTLE, "panda")
    assert places_of_object(BOTTLE, "panda", high).x == pytest.approx((-length, length))


def test_nothing_of_the_object_is_below_where_it_stands():
    profile, task = BOTTLE.profile, BOTTLE.task()
    for tilt in (0.0, 30.0, 90.0, 135.0):
        T = from_position_rpy([0.5, 0.0, 0.4], np.deg2rad([0.0, tilt, 0.0]))
        h = np.linspace(profile.h_min, profile.h_max, 4001)
        lowest = (h * T[2, 2] - profile.radius(h) * np.sin(np.deg2rad(tilt)) + 0.4).min()
        assert support_height(BOTTLE, replace(task, T_world_object=T)) == pytest.approx(lowest, abs=2e-3)


@given(st.floats(-2, 2), st.floats(0, 3), st.floats(0.02, 0.5))
def test_places_are_multiples_of_the_spacing(low, size, spacing):
    x, _ = Rectangle((low, low + size), (0.0, 1.0)).grid(spacing)
    # One that is all but at an edge may count or not.
    least, most = (
        len([k for k in range(-300, 300) if low - slack <= k * spacing <= low + size + slack])
        for slack in (-1e-7, 1e-7)
    )
    assert max(1, least) <= len(x) <= max(1, most)
    assert np.allclose(x / spacing, np.round(x / spacing), atol=1e-4)
    assert np.allclose(np.diff(x), spacing, atol=2e-6)
