from __future__ import annotations

import pytest

from symgrasp.hand import HANDS
from symgrasp.profile import Profile

HAND = HANDS["franka"]
BOTTLE = Profile([[0, 0.0355], [0.19, 0.0375], [0.235, 0.0155], [0.3, 0.0145]])


def test_opening_leaves_the_clearance_on_both_sides():
    assert HAND.opening(0.02) == pytest.approx(0.05)
    assert HAND.opening(0.039) == HAND.max_opening
    assert HAND.joint_values(0.05) == {"panda_finger_joint1": 0.025}


def test_what_the_fingers_span():
    assert HAND.spans(0.04)
    assert not HAND.spans(0.0401)


@pytest.mark.parametrize(
    ("h", "rests"),
    [(0.1, True), (0.005, False), (0.295, False), (0.21, False), (0.26, True), (0.18, True), (0.2, False)],
)
def test_pads_rest_where_the_surface_is_even(h, rests):
    assert HAND.pads_rest(BOTTLE, h) == rests
