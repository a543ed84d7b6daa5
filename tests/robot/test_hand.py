from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from symgrasp.errors import InputError
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import HANDS
from tests.robot.hands import arms_with_hands, random_points_in

HAND = HANDS["franka"]
BOTTLE = Profile([[0, 0.0355], [0.19, 0.0375], [0.235, 0.0155], [0.3, 0.0145]])


def test_opening_leaves_the_clearance_on_both_sides():
    assert HAND.opening(0.02) == pytest.approx(0.05)
    assert HAND.opening(0.039) == HAND.max_opening
    assert HAND.joint_values(0.05) == {"panda_finger_joint1": 0.025}


def test_joints_that_do_not_follow_the_opening_in_proportion():
    hand = replace(HAND, joints={"a": ((0.0, 0.1), (0.04, 0.5), (0.08, 0.7)), "b": -2.0})
    assert hand.joint_values(0.0) == {"a": 0.1, "b": 0.0}
    assert hand.joint_values(0.02) == pytest.approx({"a": 0.3, "b": -0.04})
    assert hand.joint_values(0.06) == pytest.approx({"a": 0.6, "b": -0.12})


@pytest.mark.parametrize(
    ("change", "field", "expected"),
    [
        ({"max_opening": 0.0}, "max_opening", "more than 0"),
        ({"palm_depth": 0.03}, "palm_depth", "at least the finger depth, 0.035"),
        ({"joints": {"j": ((0.0, 1.0),)}}, "joints.j", "two or more"),
        ({"joints": {"j": ((0.0, 1.0), (0.0, 2.0))}}, "joints.j", "growing openings"),
        ({"joints": {"j": ((0.01, 1.0), (0.08, 2.0))}}, "joints.j", "knots from 0 to 0.08 m"),
        ({"joints": {"j": ((0.0, 1.0), (0.07, 2.0))}}, "joints.j", "knots from 0 to 0.08 m"),
    ],
)
def test_numbers_that_are_no_hand(change, field, expected):
    with pytest.raises(InputError) as caught:
        replace(HAND, **change)
    assert caught.value.source == "hand franka"
    assert caught.value.field == field
    assert expected in caught.value.expected


def test_what_the_fingers_span():
    assert HAND.spans(0.04)
    assert not HAND.spans(0.0401)


@pytest.mark.parametrize(
    ("h", "rests"),
    [(0.1, True), (0.005, False), (0.295, False), (0.21, False), (0.26, True), (0.18, True), (0.2, False)],
)
def test_pads_rest_where_the_surface_is_even(h, rests):
    assert HAND.pads_rest(BOTTLE, h) == rests


def test_the_palm_needs_room_where_the_object_is_wider_beside_the_grasp():
    """A 30 mm neck on a 120 mm jar: beside the jar, the palm would be inside it."""
    jar = Profile([[0, 0.06], [0.2, 0.06], [0.201, 0.015], [0.4, 0.015]])
    edge = 0.2 + HAND.palm_width / 2
    assert not HAND.palm_has_room(jar, edge - 0.002)
    assert HAND.palm_has_room(jar, edge + 0.002)
    assert HAND.palm_has_room(jar, 0.1)
    assert replace(HAND, palm_width=0.0, palm_depth=0.0).palm_has_room(jar, edge - 0.002)


@given(st.floats(0.001, 0.06), st.floats(0.0, 0.2), st.sampled_from(sorted(HANDS)))
def test_the_palm_always_has_room_on_a_straight_object(radius, h, name):
    assert HANDS[name].palm_has_room(Profile([[0, radius], [0.2, radius]]), h)


@pytest.mark.parametrize("name", sorted(HANDS))
def test_where_there_is_no_room_the_palm_is_inside_the_object(name):
    """The face that the check stands for lies in the palm, so it never refuses what would fit."""
    arm = arms_with_hands()[name]
    palm = Delaunay(arm.hand_hulls(arm.hand.max_opening)[0])
    x = np.linspace(-0.5, 0.5, 21) * (arm.hand.palm_width - 2e-4)
    face = np.column_stack([x, np.zeros(21), np.full(21, -arm.hand.palm_depth - 2e-4)])
    assert (palm.find_simplex(face) >= 0).all()


@pytest.mark.parametrize("name", sorted(HANDS))
@pytest.mark.parametrize("opening", [0.012, 0.03, 0.06, 0.0797])
def test_the_fingers_of_the_shipped_hands_stand_as_far_open_as_asked(name, opening):
    """No point of the fingers is nearer to the axis of an object as thick as the opening than its surface."""
    arm = arms_with_hands()[name]
    palms = len([link for link in arm.hand.links if link not in arm.hand.touch_links])
    points = random_points_in(arm.hand_hulls(opening)[palms:], np.random.default_rng(0), 100_000)
    distance = np.hypot(points[:, 1], points[:, 2] - arm.hand.standoff(opening / 2))
    for side in (points[:, 1] > 0, points[:, 1] < 0):
        assert distance[side].min() == pytest.approx(opening / 2, abs=1e-3)


def test_a_prefix_renames_all_that_belongs_to_the_robot():
    hand = HANDS["pr2"].prefixed("left_")
    assert hand.links[0] == "left_gripper_pole"
    assert hand.touch_links[0] == "left_left_gripper"
    assert list(hand.joint_values(0.05)) == ["left_left_gripper_joint", "left_right_gripper_joint"]
    assert hand.tool is not None
    assert hand.tool.link == "left_gripper_pole"
    assert hand.prefixed("").max_opening == HANDS["pr2"].max_opening
