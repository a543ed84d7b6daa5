"""Parallel hands as data, and how they fit a profile.

The tool frame of a hand, between the finger tips:

        | |   palm | |            z  approach, out of the palm
        | |        | |            y  closing direction, from one finger to the other
        | |   +--y | |            x = y x z, out of the page
        |_|   |    |_|
              z (approach)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from symgrasp.profile import Profile

__all__ = ["HANDS", "Hand"]


@dataclass(frozen=True)
class Hand:
    """A parallel hand. All lengths in metres.

    Args:
        name: what scenes call it.
        links: all links of the hand that have a body.
        touch_links: those that may touch the object (and nothing else): the fingers.
        joints: joint name → joint value for each metre of opening; mimic joints follow.
        min_opening: smallest distance between the finger pads.
        max_opening: largest distance between the finger pads.
        finger_depth: how deep an object may reach between the fingers, from the tool frame
            towards the palm.
        pad_width: extent of the finger pads along the object's axis (the tool's x).
        clearance: gap to leave on each side of the object.
        radius_tolerance: largest change of the radius under the pads that still holds.
    """

    name: str
    links: tuple[str, ...]
    touch_links: tuple[str, ...]
    joints: Mapping[str, float] = field(hash=False)
    min_opening: float
    max_opening: float
    finger_depth: float
    pad_width: float
    clearance: float = 0.005
    radius_tolerance: float = 0.003

    def opening(self, radius: float) -> float:
        """Return how far (m) the fingers stand open around a radius (m)."""
        return float(np.clip(2 * (radius + self.clearance), self.min_opening, self.max_opening))

    def joint_values(self, opening: float) -> dict[str, float]:
        """Return the values of the hand's joints at an opening (m)."""
        return {name: ratio * opening for name, ratio in self.joints.items()}

    def standoff(self, radius: float) -> float:
        """Return the distance d (m) of the tool frame from the axis that keeps the palm outside."""
        return max(0.0, radius - self.finger_depth)

    def spans(self, radius: float) -> bool:
        """Whether the fingers go around a radius (m)."""
        return self.min_opening <= 2 * radius <= self.max_opening

    def pads_rest(self, profile: Profile, h: float) -> bool:
        """Whether the pads rest on the surface around height h (m): not over an end, not on a step."""
        low, high = h - self.pad_width / 2, h + self.pad_width / 2
        if low < profile.h_min - 1e-9 or high > profile.h_max + 1e-9:
            return False
        smallest, largest = profile.radius_span(low, high)
        return largest - smallest <= self.radius_tolerance


HANDS: Mapping[str, Hand] = {
    # Franka hand of pybullet_data: the pads' middle is 0.105 m and the palm 0.066 m from the
    # flange, the pads are 17.5 mm wide, each finger travels 40 mm.
    "franka": Hand(
        name="franka",
        links=("panda_hand", "panda_leftfinger", "panda_rightfinger"),
        touch_links=("panda_leftfinger", "panda_rightfinger"),
        joints={"panda_finger_joint1": 0.5},
        min_opening=0.0,
        max_opening=0.08,
        finger_depth=0.035,
        pad_width=0.0175,
    ),
}
"""The hands that a scene may name."""
