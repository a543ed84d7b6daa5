from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from symgrasp.engine.kinematics import rotate
from symgrasp.ik.vectors import sine_and_cosine

AXES = [*np.eye(3), *-np.eye(3), np.array([0.6, 0.0, 0.8]), np.array([2.0, -3.0, 6.0]) / 7.0]


@given(st.floats(-20.0, 20.0) | st.integers(-40, 40).map(lambda eighths: eighths * math.pi / 4))
def test_sine_and_cosine_are_those_of_the_library(angle):
    assert sine_and_cosine(angle) == pytest.approx((math.sin(angle), math.cos(angle)), abs=2e-15)


@pytest.mark.parametrize("axis", AXES, ids=str)
@given(seed=st.integers(0, 10_000), angle=st.floats(-7.0, 7.0))
def test_a_frame_turns_about_an_axis_of_its_own(axis, seed, angle):
    rng = np.random.default_rng(seed)
    before = Rotation.random(rng=rng).as_matrix()
    frame = np.concatenate([before.ravel(), [1.0, 2.0, 3.0]])
    rotate(frame, axis, angle)
    after = before @ Rotation.from_rotvec(angle * axis).as_matrix()
    assert frame == pytest.approx(np.concatenate([after.ravel(), [1.0, 2.0, 3.0]]), abs=1e-14)
