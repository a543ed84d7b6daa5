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
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import InputError
from symgrasp.object.manifold import Manifold, grasp_to_tool
from symgrasp.object.profile import Profile
from symgrasp.poses import Array, from_rotation, rotation_about
from symgrasp.robot.assembly import Frame

__all__ = ["HANDS", "SIDED_HANDS", "Hand", "JointTable"]

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
        finger_width: extent along the object's axis of what of the fingers lies beside the object; 0 if
            that is no more than the pads.
        shift: y of the tool frame where the axis of the object lies, over the opening: 0 for fingers that
            close from two sides; with a jaw that is fixed it moves with the opening.
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
    finger_width: float = 0.0
    shift: JointTable = field(default=0.0, hash=False)
    tool: Frame | None = None
    urdf: str | None = None

    def __post_init__(self) -> None:
        where = f"hand {self.name}"
        if self.max_opening <= self.min_opening:
            raise InputError(where, "max_opening", self.max_opening, f"more than {self.min_opening:g}")
        if self.palm_width and self.palm_depth < self.finger_depth:
            least = f"at least the finger depth, {self.finger_depth:g}, where the palm has a width"
            raise InputError(where, "palm_depth", self.palm_depth, least)
        tables = {f"joints.{joint}": table for joint, table in self.joints.items()}
        for name, table in {**tables, "shift": self.shift}.items():
            if isinstance(table, float | int):
                continue
            at = [opening for opening, _ in table]
            if len(at) < 2 or any(b <= a for a, b in pairwise(at)):
                expected = "a number, or two or more [opening, value] with growing openings"
                raise InputError(where, name, table, expected)
            if at[0] > self.min_opening + 1e-9 or at[-1] < self.max_opening - 1e-9:
                expected = f"knots from {self.min_opening:g} to {self.max_opening:g} m"
                raise InputError(where, name, table, expected)

    def opening(self, radius: float) -> float:
        """Return the opening (m) around a radius (m): ``2·radius + 2·clearance``, clipped to the range."""
        return float(self._opening(radius))

    def _opening(self, radius: ArrayLike) -> Array:
        return np.clip(2 * (np.asarray(radius) + self.clearance), self.min_opening, self.max_opening)

    def joint_values(self, opening: float) -> dict[str, float]:
        """Return joint name → value of the hand's joints (rad or m) at an opening (m)."""
        return {
            name: float(table * opening if isinstance(table, float | int) else np.interp(opening, *table))
            for name, table in self._tables.items()
        }

    @cached_property
    def _tables(self) -> dict[str, float | Array]:
        """What `joints` holds, as ratios and as knots (2, k)."""
        return {
            name: float(table) if isinstance(table, float | int) else _knots(tuple(map(tuple, table)))
            for name, table in self.joints.items()
        }

    def standoff(self, radius: float) -> float:
        """Return the distance d (m) of the tool frame from the axis: ``max(0, radius − finger_depth)``."""
        return max(0.0, radius - self.finger_depth)

    def tool_pose(
        self,
        T_world_object: ArrayLike,
        h: ArrayLike,
        theta: ArrayLike,
        roll: ArrayLike,
        radius: ArrayLike,
        pitch: float = 0.0,
    ) -> Array:
        """Return the tool poses (..., 4, 4) of grasps; see `grasp_to_tool`.

        Args:
            T_world_object: one object pose (4, 4).
            h: heights (...) (m).
            theta: angles (...) (rad).
            roll: 0 or π (...).
            radius: radii (...) of the object at these heights (m).
            pitch: turn (rad) of the hand about its closing direction, through the point of the object's axis
                that it holds; positive with the palm above, towards larger heights.
        """
        standoff = np.maximum(0.0, np.asarray(radius) - self.finger_depth)
        poses = grasp_to_tool(T_world_object, h, theta, roll, standoff, self.shift_at(radius))
        if pitch == 0.0:
            return poses
        axis = np.stack(np.broadcast_arrays(0.0, self.shift_at(radius), standoff), axis=-1)
        turn = rotation_about(np.array([0.0, 1.0, 0.0]), -pitch * np.cos(np.asarray(roll, dtype=float)))
        return poses @ from_rotation(turn, axis - (turn @ axis[..., None])[..., 0])

    def tool_poses(self, manifold: Manifold, T_world_object: ArrayLike) -> Array:
        """Return ``T_world_tool`` (rolls, heights, angles, 4, 4) at every cell centre of a manifold."""
        shift = self.shift_at(manifold.profile.radius(manifold.h))
        return manifold.tool_poses(T_world_object, self.finger_depth, shift)

    def shift_at(self, radius: ArrayLike) -> Array:
        """Return y (...) (m) of the tool frame where the axis of an object lies, for radii (...) (m)."""
        return _value(self.shift, self._opening(radius))

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
        """Whether the pads lie on the surface around height h (m): not past an end, not across a step.

        Nor may the object be thicker beside them where the fingers are wider than their pads.
        """
        low, high = h - self.pad_width / 2, h + self.pad_width / 2
        if low < profile.h_min - 1e-9 or high > profile.h_max + 1e-9:
            return False
        smallest, largest = profile.radius_span(low, high)
        return largest - smallest <= self.radius_tolerance and self.fingers_have_room(profile, h, h)

    def fingers_have_room(self, profile: Profile, low: float, high: float) -> bool:
        """Whether open fingers are clear of the object beside their pads, at all heights of a range.

        The object may there be thicker than where it is held by what it may be under the pads; at the largest
        opening, where less than the clearance is left on either side, by that much less.

        Args:
            profile: the object.
            low: lower end (m) of the range of heights at which the hand may hold it.
            high: its upper end (m).
        """
        if self.finger_width <= self.pad_width:
            return True
        least, most = profile.radius_span(low, high)
        left = min(self.clearance, max(0.0, 0.5 * self.max_opening - most))
        rise = max(0.0, self.radius_tolerance - (self.clearance - left))
        _, largest = profile.radius_span(low - self.finger_width / 2, high + self.finger_width / 2)
        return largest <= least + rise

    def prefixed(self, prefix: str) -> Hand:
        """Return the hand with a prefix before the names of all its links and joints."""
        return replace(
            self,
            links=tuple(prefix + link for link in self.links),
            touch_links=tuple(prefix + link for link in self.touch_links),
            joints={prefix + joint: table for joint, table in self.joints.items()},
            tool=self.tool and replace(self.tool, link=prefix + self.tool.link),
        )


def _value(table: JointTable, opening: ArrayLike) -> Array:
    """Evaluate a joint table at openings (...) (m)."""
    if isinstance(table, float | int):
        return table * np.asarray(opening)
    at, values = _knots(tuple(map(tuple, table)))
    return np.interp(np.asarray(opening, dtype=float), at, values)


@lru_cache(maxsize=1024)
def _knots(table: tuple[tuple[float, float], ...]) -> Array:
    """Return the openings and the values (2, k) of a joint table."""
    return np.array(table).T.copy()


def _pr2(side: str) -> Hand:
    """Return the gripper on the left or right arm of the PR2 of example-robot-data."""
    fingers = ("l_finger_link", "r_finger_link", "l_finger_tip_link", "r_finger_tip_link")
    table = ((0.0, 0.00856), (0.0309, 0.17981), (0.0533, 0.30825), (0.0733, 0.42813), (0.092, 0.548))
    hand = Hand(
        name=f"pr2_{side}",
        links=("palm_link", *fingers),
        touch_links=fingers,
        joints={"l_finger_joint": table},
        min_opening=0.0,
        max_opening=0.092,
        finger_depth=0.0507,
        pad_width=0.0207,
        finger_width=0.054,
        palm_width=0.0452,
        palm_depth=0.0597,
        tool=Frame("tool_frame", quat_wxyz=(np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)),
    )
    return hand.prefixed(f"{side[0]}_gripper_")


def _talos(side: str) -> Hand:
    """Return the gripper on the left or right arm of TALOS: two fingers close against one."""
    fingers = (
        "motor_double_link", "inner_double_link", "motor_single_link", "inner_single_link",
        "fingertip_1_link", "fingertip_2_link", "fingertip_3_link",
    )  # fmt: skip
    table = ((0.0, -0.61496), (0.0356, -0.38997), (0.0564, -0.25498), (0.0762, -0.11999), (0.0926, 0.0))
    hand = Hand(
        name=f"talos_{side}",
        links=("base_link", *fingers),
        touch_links=fingers,
        joints={"joint": table},
        min_opening=0.0,
        max_opening=0.0926,
        finger_depth=0.0826,
        pad_width=0.0854,
        finger_width=0.1114,
        palm_width=0.1,
        palm_depth=0.0916,
        tool=Frame("base_link", (0.0, 0.0, -0.1416), (0.0, 0.0, 1.0, 0.0)),
    )
    return hand.prefixed(f"gripper_{side}_")


def _dex3(side: str) -> Hand:
    """Return the left or right hand of a G1: a thumb closes against two fingers. One mirrors the other."""
    way = 1.0 if side == "left" else -1.0
    proximal = (
        (0.0032, -0.98175), (0.0483, -0.70956), (0.0533, -0.67859), (0.055, -0.66533), (0.0583, -0.62149),
        (0.0616, -0.57375), (0.065, -0.52272), (0.0683, -0.46748), (0.07, -0.44581), (0.0717, -0.43311),
        (0.08, -0.37811), (0.09, -0.32051), (0.1001, -0.27044), (0.1101, -0.22662),
    )  # fmt: skip
    distal = (
        (0.0032, -1.09083), (0.0483, -0.7884), (0.0533, -0.75399), (0.055, -0.73926), (0.0583, -0.69054),
        (0.0616, -0.6375), (0.065, -0.5808), (0.0683, -0.51943), (0.07, -0.49535), (0.0717, -0.48123),
        (0.08, -0.42012), (0.09, -0.35612), (0.1001, -0.30049), (0.1101, -0.2518),
    )  # fmt: skip
    tables = {
        "thumb_1_joint": (
            (0.0032, 0.42426), (0.0433, 0.23379), (0.0633, 0.13516), (0.07, 0.10022), (0.075, 0.06901),
            (0.0817, 0.03038), (0.0917, -0.02188), (0.1017, -0.06831), (0.1101, -0.10313),
        ),
        "thumb_2_joint": (
            (0.0032, 1.08961), (0.0433, 0.88911), (0.0633, 0.78529), (0.07, 0.74851), (0.075, 0.71566),
            (0.0817, 0.675), (0.0917, 0.61999), (0.1017, 0.57111), (0.1101, 0.53446),
        ),
        "middle_0_joint": proximal,
        "middle_1_joint": distal,
        "index_0_joint": proximal,
        "index_1_joint": distal,
    }  # fmt: skip
    joints = {name: tuple((opening, way * value) for opening, value in t) for name, t in tables.items()}
    fingers = (
        "thumb_0_link", "middle_0_link", "index_0_link", "thumb_1_link", "middle_1_link", "index_1_link",
        "thumb_2_link",
    )  # fmt: skip
    half = np.deg2rad(31.029)
    c, s = np.sqrt(0.5) * np.cos(half), np.sqrt(0.5) * np.sin(half)
    hand = Hand(
        name=f"dex3_{side}",
        links=("palm_link", *fingers),
        touch_links=fingers,
        joints={**joints, "thumb_0_joint": 0.0},
        min_opening=0.0032,
        max_opening=0.1101,
        finger_depth=0.0347,
        pad_width=0.0738,
        finger_width=0.0852,
        palm_width=0.0815,
        palm_depth=0.0458,
        tool=Frame(
            "palm_link", (0.0815, -0.055 * way, 0.0002 * way), (c, s, c, -s) if way > 0 else (s, -c, -s, -c)
        ),
    )
    return hand.prefixed(f"{side}_hand_")


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
        finger_width=0.023,
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
        finger_width=0.032,
        palm_width=0.05,
        palm_depth=0.076,
        tool=Frame("wsg50_tool"),
        urdf="package://static_scenes/hands/wsg50.urdf",
    ),
    # PR2 gripper of pybullet_data, whose fingers turn: the pads are parallel only when closed, and meet 6 mm
    # beside the gripper's axis.
    "pr2": Hand(
        name="pr2",
        links=("gripper_pole", "left_gripper", "right_gripper", "left_tip", "right_tip"),
        touch_links=("left_gripper", "right_gripper", "left_tip", "right_tip"),
        joints={
            "left_gripper_joint": (
                (0.0, 0.05994), (0.0387, 0.26314), (0.0789, 0.48352), (0.0867, 0.51099), (0.0991, 0.548),
            ),
            "right_gripper_joint": (
                (0.0, 0.03425), (0.0015, 0.05017), (0.0279, 0.18875), (0.0774, 0.459), (0.0805, 0.47399),
                (0.0867, 0.49875), (0.0991, 0.54214),
            ),
        },
        min_opening=0.0,
        max_opening=0.0991,
        finger_depth=0.0395,
        pad_width=0.02,
        finger_width=0.0491,
        palm_width=0.0162,
        palm_depth=0.1026,
        tool=Frame("gripper_pole", (0.2976, 0.0059, 0.0), (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)),
        urdf="package://pybullet_data/pr2_gripper.urdf",
    ),
}  # fmt: skip
"""Name → hand, of the hands that a scene may refer to by name on any robot that has them."""

SIDED_HANDS: Mapping[str, Hand] = {
    hand.name: hand for side in ("left", "right") for hand in (_pr2(side), _talos(side), _dex3(side))
}
"""Name → hand, of those of robots with two arms, whose links have other names on either side."""
