"""Parallel hands: their dimensions, how their joints follow the opening, and where they fit a profile.

The tool frame of a hand, between the finger tips:

        | |   palm | |            z  approach, out of the palm
        | |        | |            y  closing direction, from one finger to the other
        | |   +--y | |            x = y x z, out of the page
        |_|   |    |_|
              z (approach)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from symgrasp.errors import InputError
from symgrasp.object.profile import Profile
from symgrasp.robot.assembly import Frame

__all__ = ["HANDS", "Hand", "JointTable"]

JointTable = float | Sequence[tuple[float, float]]
"""Joint value as a function of the opening: the ratio of value (rad or m) to opening (m), or knots
``(opening, value)`` of a piecewise linear function."""


@dataclass(frozen=True)
class Hand:
    """A parallel hand. All lengths in metres.

    Args:
        name: its name in scenes.
        links: all links of the hand that have a collision shape.
        touch_links: the links that may touch the object (and nothing else): the fingers.
        joints: name of each joint that opens the hand → its value over the opening; mimic joints follow.
        min_opening: smallest distance between the finger pads.
        max_opening: largest distance between the finger pads.
        finger_depth: how deep an object may reach between the fingers, from the tool frame
            towards the palm.
        pad_width: extent of the finger pads along the object's axis (the tool's x).
        clearance: gap to leave on each side of the object.
        radius_tolerance: largest change of the radius under the pads at which a grasp still holds.
        palm_width: extent of the palm along the object's axis; 0 leaves contact of the palm to the
            collision check.
        palm_depth: distance from the tool frame back to the face of the palm that has this width.
        tool: the tool frame, for arms that do not name a link of their own.
        urdf: the hand's own URDF, for hands that are not part of the robot's URDF.

    Raises:
        InputError: the numbers do not describe a hand.
    """

    name: str
    links: tuple[str, ...]
    touch_links: tuple[str, ...]
    joints: Mapping[str, JointTable] = field(hash=False)
    min_opening: float
    max_opening: float
    finger_depth: float
    pad_width: float
    clearance: float = 0.005
    radius_tolerance: float = 0.003
    palm_width: float = 0.0
    palm_depth: float = 0.0
    tool: Frame | None = None
    urdf: str | None = None

    def __post_init__(self) -> None:
        where = f"hand {self.name}"
        if self.max_opening <= self.min_opening:
            raise InputError(where, "max_opening", self.max_opening, f"more than {self.min_opening:g}")
        if self.palm_width and self.palm_depth < self.finger_depth:
            least = f"at least the finger depth, {self.finger_depth:g}, where the palm has a width"
            raise InputError(where, "palm_depth", self.palm_depth, least)
        for joint, table in self.joints.items():
            if isinstance(table, float | int):
                continue
            at = [opening for opening, _ in table]
            if len(at) < 2 or any(b <= a for a, b in pairwise(at)):
                expected = "a number, or two or more [opening, value] with growing openings"
                raise InputError(where, f"joints.{joint}", table, expected)
            if at[0] > self.min_opening + 1e-9 or at[-1] < self.max_opening - 1e-9:
                expected = f"knots from {self.min_opening:g} to {self.max_opening:g} m"
                raise InputError(where, f"joints.{joint}", table, expected)

    def opening(self, radius: float) -> float:
        """Return the opening (m) around a radius (m): ``2·radius + 2·clearance``, clipped to the range."""
        return float(np.clip(2 * (radius + self.clearance), self.min_opening, self.max_opening))

    def joint_values(self, opening: float) -> dict[str, float]:
        """Return joint name → value of the hand's joints (rad or m) at an opening (m)."""
        return {name: _value(table, opening) for name, table in self.joints.items()}

    def standoff(self, radius: float) -> float:
        """Return the distance d (m) of the tool frame from the axis: ``max(0, radius − finger_depth)``."""
        return max(0.0, radius - self.finger_depth)

    def spans(self, radius: float) -> bool:
        """Whether the diameter of a radius (m) is within the range of openings."""
        return self.min_opening <= 2 * radius <= self.max_opening

    def palm_has_room(self, profile: Profile, h: float) -> bool:
        """Whether the object stays out of the palm of a hand that grasps it at height h (m)."""
        if not self.palm_width:
            return True
        _, largest = profile.radius_span(h - self.palm_width / 2, h + self.palm_width / 2)
        return largest <= self.standoff(float(profile.radius(h))) + self.palm_depth

    def pads_rest(self, profile: Profile, h: float) -> bool:
        """Whether the pads lie on the surface around height h (m): not past an end, not across a step."""
        low, high = h - self.pad_width / 2, h + self.pad_width / 2
        if low < profile.h_min - 1e-9 or high > profile.h_max + 1e-9:
            return False
        smallest, largest = profile.radius_span(low, high)
        return largest - smallest <= self.radius_tolerance

    def prefixed(self, prefix: str) -> Hand:
        """Return the hand with a prefix before the names of all its links and joints."""
        return replace(
            self,
            links=tuple(prefix + link for link in self.links),
            touch_links=tuple(prefix + link for link in self.touch_links),
            joints={prefix + joint: table for joint, table in self.joints.items()},
            tool=self.tool and replace(self.tool, link=prefix + self.tool.link),
        )


def _value(table: JointTable, opening: float) -> float:
    """Evaluate a joint table at an opening (m)."""
    if isinstance(table, float | int):
        return table * opening
    at, values = np.transpose(table)
    return float(np.interp(opening, at, values))


PR2_TABLE = ((0.0, 0.05533), (0.0507, 0.33394), (0.0853, 0.53087), (0.0886, 0.548))

HANDS: Mapping[str, Hand] = {
    # Each as measured by `symgrasp hand`; where the maker states a length, that one is taken.
    # Franka hand, as on the Panda of pybullet_data.
    "franka": Hand(
        name="franka",
        links=("panda_hand", "panda_leftfinger", "panda_rightfinger"),
        touch_links=("panda_leftfinger", "panda_rightfinger"),
        joints={"panda_finger_joint1": 0.5},
        min_opening=0.0,
        max_opening=0.08,
        finger_depth=0.035,
        pad_width=0.0175,
        palm_width=0.0354,
        palm_depth=0.044,
        tool=Frame("panda_grasptarget"),
    ),
    # Schunk WSG 50-110 with its force-measuring fingers; the meshes are those of pybullet_data.
    "wsg50": Hand(
        name="wsg50",
        links=("wsg50_base", "wsg50_left_finger", "wsg50_right_finger"),
        touch_links=("wsg50_left_finger", "wsg50_right_finger"),
        joints={"wsg50_joint": 0.5},
        min_opening=0.0,
        max_opening=0.11,
        finger_depth=0.067,
        pad_width=0.0203,
        palm_width=0.05,
        palm_depth=0.076,
        tool=Frame("wsg50_tool"),
        urdf="package://static_scenes/hands/wsg50.urdf",
    ),
    # PR2 gripper of pybullet_data, whose fingers turn: the pads are parallel only when closed.
    # The opening is that of their narrow end, and the pads meet 6 mm beside the gripper's axis.
    "pr2": Hand(
        name="pr2",
        links=("gripper_pole", "left_gripper", "right_gripper", "left_tip", "right_tip"),
        touch_links=("left_gripper", "right_gripper", "left_tip", "right_tip"),
        joints=dict.fromkeys(("left_gripper_joint", "right_gripper_joint"), PR2_TABLE),
        min_opening=0.0,
        max_opening=0.0886,
        finger_depth=0.0201,
        pad_width=0.02,
        palm_width=0.0162,
        palm_depth=0.1078,
        tool=Frame("gripper_pole", (0.3028, 0.0059, 0.0), (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)),
        urdf="package://pybullet_data/pr2_gripper.urdf",
    ),
}
"""Name → hand, of the hands that a scene may refer to by name."""
