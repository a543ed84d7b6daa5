"""How far a hand may be pitched about its closing direction and still hold an object.

Arms of five joints leave the pitch free. Seen along the tangent of the object, x outwards from its axis and h
up, the hand that is pitched by β is turned about the point of the axis that it is at:

          h                                      b  back, out of the palm: (cos β, sin β)
          | object                               a  across, along the object at β = 0: (−sin β, cos β)
        __|__        b                           pads at b = −d, |a| <= half the pad width
       |  |  |    /                              palm from b = palm depth on, |a| <= half the palm width
       |  +~~|~~ / β                             + is at b = −d, where d is the standoff of the grasp
       |__|__|  ------ x
                                                 (positive: the palm is above)
The fingers close across this plane, so their pads stay at the two points of the object that are furthest
apart in their direction, and parallel to it. What changes with β, and is checked:

- the object reaches deeper between the fingers: ``max b`` over its section with ``|a| <= w/2`` may not
  exceed the finger depth, nor the palm depth over the width of the palm;
- the pads lie on other heights: on all those where they touch, the radius is that of the grasp up to the
  hand's tolerance, and none is past an end;
- the fingers lie beside other heights: on all of them the object may not be thicker.

Pads are taken to be as long as they are wide, with the point of the grasp in their middle, and fingers to be
as wide as pads from there to the palm. All other bodies are left to the collision check.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from symgrasp.object.profile import Profile
from symgrasp.poses import Array
from symgrasp.robot.hand import Hand

__all__ = ["SAME_PITCH", "STEEPEST", "holds_at", "pitch_range"]

STEEPEST = np.deg2rad(100.0)
"""Largest pitch (rad) to either side: a little more than for an approach along the object's axis."""

SAME_PITCH = 1e-4
"""Pitches (rad) that differ by no more are the same: 0.01 mm at a finger's length, and a little more than
what the rounded angles of URDFs make of one that all configurations would have in common."""

STEPS = 200
"""Pitches that are tried on either side of none: every half degree."""


ROUNDING = 1e-5
"""A pitch (rad) below this is none, up to the rounding of numbers."""


@lru_cache(maxsize=4096)
def pitch_range(hand: Hand, profile: Profile, h: float) -> tuple[float, float]:
    """Return the least and the largest pitch (rad) of a hand at a height (m), positive with the palm above.

    Every pitch between them is possible, as far as steps of half a degree tell. They are `ROUNDING` where the
    hand has to stay perpendicular to the axis.
    """
    section = _section(profile)
    ends = []
    for sign in (-1.0, 1.0):
        last = sign * ROUNDING
        for pitch in sign * STEEPEST * np.arange(1, STEPS + 1) / STEPS:
            if not _holds(hand, profile, section, h, float(pitch)):
                break
            last = float(pitch)
        ends.append(last)
    return ends[0], ends[1]


def holds_at(hand: Hand, profile: Profile, h: float, pitch: float) -> bool:
    """Whether a hand at a pitch (rad) holds an object at a height (m), whatever it does at other pitches."""
    return _holds(hand, profile, _section(profile), h, pitch)


def _section(profile: Profile) -> Array:
    """Return the corners (k, 2) of the object's section through its axis: distance from the axis, height."""
    h, r = profile.points.T
    return np.concatenate([np.column_stack([r, h]), np.column_stack([-r, h])[::-1]])


def _holds(hand: Hand, profile: Profile, section: Array, h: float, pitch: float) -> bool:
    """Whether a hand at a pitch (rad) holds an object at a height (m)."""
    radius, tolerance = float(profile.radius(h)), hand.radius_tolerance
    standoff = hand.standoff(radius)
    c, s = np.cos(pitch), np.sin(pitch)
    corners = (section - [0.0, h]) @ np.array([[c, -s], [s, c]])  # (b + d, a)
    corners[:, 0] -= standoff
    # Where the pads just reach the object's back, they do so on their whole width up to the tolerance.
    if _deepest(corners, hand.pad_width) > hand.finger_depth + tolerance:
        return False
    if hand.palm_width and _deepest(corners, hand.palm_width) > hand.palm_depth:
        return False
    half = 0.5 * hand.pad_width
    touched = half / max(c, abs(s))
    if h - touched < profile.h_min - 1e-9 or h + touched > profile.h_max + 1e-9:
        return False
    smallest, largest = profile.radius_span(h - touched, h + touched)
    if largest - smallest > tolerance:
        return False
    back = standoff + max(hand.finger_depth, hand.palm_depth)
    beside = [h + b * s + a * c for b in (-half, back) for a in (-half, half)]
    low, high = max(min(beside), profile.h_min), min(max(beside), profile.h_max)
    return profile.radius_span(low, high)[1] <= radius + tolerance


def _deepest(corners: Array, width: float) -> float:
    """Return the largest b of the points of a polygon (k, 2) of (b, a) with |a| at most half a width."""
    start, end = corners, np.roll(corners, -1, axis=0)
    run = end[:, 1] - start[:, 1]
    deepest = [start[np.abs(start[:, 1]) <= 0.5 * width, 0]]
    for level in (-0.5 * width, 0.5 * width):
        crosses = (start[:, 1] - level) * (end[:, 1] - level) < 0
        share = (level - start[crosses, 1]) / run[crosses]
        deepest.append(start[crosses, 0] + share * (end[crosses, 0] - start[crosses, 0]))
    return float(np.concatenate(deepest).max(initial=-np.inf))
