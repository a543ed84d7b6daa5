"""How far a hand may be pitched, against points of the object and the hand, and by hand for cylinders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.object.profile import Profile
from symgrasp.robot.hand import HANDS
from symgrasp.robot.pitch import STEEPEST, pitch_range

HAND = replace(HANDS["wsg50"], palm_width=0.0, palm_depth=0.0)
LONG = Profile([[0.0, 0.02], [1.0, 0.02]])


def test_an_endless_cylinder_ends_it_by_its_depth():
    """Its back is (r + w/2 · sin β) / cos β behind the axis on the edge of the pads."""
    low, high = pitch_range(HAND, LONG, 0.5)
    assert -low == high
    depth = (0.02 + 0.5 * HAND.pad_width * np.sin(high)) / np.cos(high)
    assert depth <= HAND.finger_depth + HAND.radius_tolerance
    beyond = high + np.deg2rad(0.5)
    deeper = (0.02 + 0.5 * HAND.pad_width * np.sin(beyond)) / np.cos(beyond)
    assert deeper > HAND.finger_depth + HAND.radius_tolerance


def test_an_end_of_the_object_can_be_held_from_there():
    """Along the axis, as far as its end is no deeper between the fingers than they are long."""
    low, high = pitch_range(HAND, LONG, 1.0 - 0.06)
    assert high == pytest.approx(STEEPEST)
    assert low > -STEEPEST
    assert pitch_range(HAND, LONG, 1.0 - 0.09)[1] < np.pi / 2
    below = pitch_range(HAND, LONG, 0.06)
    assert below == pytest.approx((-high, -low))


def test_the_palm_is_kept_out():
    """The wide palm of the real hand meets the upper end of the cylinder, beside which the fingers fit."""
    bare = pitch_range(HAND, LONG, 0.5)
    assert pitch_range(replace(HAND, palm_width=0.1, palm_depth=0.068), LONG, 0.5)[1] < bare[1]


def test_fingers_stay_off_what_is_thicker():
    """A bottle's neck is held from above, and not from beside its shoulder."""
    bottle = Profile([[0.0, 0.04], [0.15, 0.04], [0.17, 0.014], [0.25, 0.014]])
    low, high = pitch_range(HAND, bottle, 0.2)
    assert high > np.deg2rad(50)
    assert -np.deg2rad(30) < low < 0


@given(
    radii=st.lists(st.floats(0.005, 0.05), min_size=2, max_size=6),
    at=st.floats(0.1, 0.9),
    part=st.floats(0.0, 1.0),
    palm=st.sampled_from([0.0, 0.03, 0.08]),
)
def test_no_point_of_the_object_is_where_the_hand_is(radii, at, part, palm):
    """Points of the object's section, turned into the frame of the hand, at any pitch in the range."""
    hand = replace(HAND, palm_width=palm, palm_depth=0.076 if palm else 0.0)
    profile = Profile(np.column_stack([np.linspace(0, 0.2, len(radii)), radii]))
    h = 0.2 * at
    radius = float(profile.radius(h))
    if not (hand.palm_has_room(profile, h) and hand.pads_rest(profile, h)):
        return
    low, high = pitch_range(hand, profile, h)
    assert low <= 0.0 <= high
    pitch = np.round((low + part * (high - low)) / np.deg2rad(0.5)) * np.deg2rad(0.5)
    heights = np.linspace(0, 0.2, 301)
    z, share = (part.ravel() for part in np.meshgrid(heights, np.linspace(-1, 1, 41)))
    r = profile.radius(z)
    x, up = share * r, z - h
    back = x * np.cos(pitch) + up * np.sin(pitch) - hand.standoff(radius)
    across = -x * np.sin(pitch) + up * np.cos(pitch)
    between = np.abs(across) <= 0.5 * hand.pad_width
    assert not (between & (back > hand.finger_depth + hand.radius_tolerance + 1e-9)).any()
    if palm:
        assert not ((np.abs(across) <= 0.5 * palm) & (back > hand.palm_depth + 1e-9)).any()
    beside = between & (back > -hand.standoff(radius) - 0.5 * hand.pad_width) & (back < hand.finger_depth)
    if pitch:
        assert (r[beside] <= radius + hand.radius_tolerance + 1e-9).all()
