"""Grasps as motions see them, and the straight paths of the tool and the object around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgrasp.ik import Solver
from symgrasp.motion.bodies.motion_scene import Rest
from symgrasp.motion.paths.lines import configurations
from symgrasp.object.profile import Profile
from symgrasp.plan.plan import Hold
from symgrasp.poses import Array, from_rotation, pose_error, rotation_about, translation
from symgrasp.robot.robot import Arm

__all__ = ["LIFT", "Grip", "lifted", "retreating", "straight"]

STEP = 0.01
"""Largest distance (m) between samples of straight paths."""

TURN = np.deg2rad(4.0)
"""Largest turn (rad) between them."""

APART = 0.01
"""Distance (m) of the finger tips from the object where the straight approach begins."""

LIFT = 0.02
"""Distance (m) by which the object is moved straight off what it rests on, and from which it is put down."""


@dataclass(frozen=True, eq=False)
class Grip:
    """A grasp of an arm.

    Attributes:
        arm: the arm.
        solver: its inverse kinematics at the samples of maps, which give its configurations.
        fine: the same at more samples, those of maps among them, for straight paths.
        T_object_tool: pose (4, 4) of the tool in the object.
        open: opening (m) of the hand around the object.
        closed: opening (m) of the hand that holds it.
    """

    arm: Arm
    solver: Solver
    fine: Solver
    T_object_tool: Array
    open: float
    closed: float

    @staticmethod
    def of(hold: Hold, arm: Arm, solver: Solver, fine: Solver, profile: Profile) -> Grip:
        """Return the grasp that a plan states; see `Grip` for the arguments."""
        g, hand = hold.grasp, arm.hand
        radius = float(profile.radius(g.h))
        closed = float(np.clip(2 * radius, hand.min_opening, hand.max_opening))
        tool = hand.tool_pose(np.eye(4), g.h, g.theta, g.roll, radius)
        return Grip(arm, solver, fine, tool, hold.opening, closed)

    def tool(self, T_world_object: Array) -> Array:
        """Return ``T_world_tool`` (4, 4) with the object at a pose (4, 4)."""
        return T_world_object @ self.T_object_tool

    def configurations(self, T_world_object: Array) -> Array:
        """Return its configurations (m, n) with the object at a pose (4, 4)."""
        return configurations(self.solver, self.tool(T_world_object))


def retreating(grip: Grip, T_world_object: Array, length: float, profile: Profile) -> list[Array]:
    """Return tool poses (4, 4) from a grasp straight back against its approach.

    Args:
        grip: the grasp.
        T_world_object: pose (4, 4) of the object.
        length: least length (m); more where the tips of the fingers would not be apart from the object.
        profile: of the object.
    """
    hand = grip.arm.hand
    links = (*hand.links, *hand.touch_links)  # such as a safety box around the fingers, which reaches further
    tips = max(float(points[:, 2].max()) for points in grip.arm.hand_hulls(grip.open, links))
    standoff = float(np.hypot(*grip.T_object_tool[:2, 3]))
    length = max(length, float(profile.points[:, 1].max()) + APART + tips - standoff)
    tool = grip.tool(T_world_object)
    return straight(tool, tool @ translation([0, 0, -length]))


def lifted(T_world_object: Array, rest: Rest, distance: float = LIFT) -> Array:
    """Return the pose (4, 4) of the object at a distance (m) from where it rests; there if on nothing."""
    return translation(distance * rest.normal) @ T_world_object if rest.pieces else T_world_object


def straight(start: Array, end: Array) -> list[Array]:
    """Return poses (4, 4) from one to another, along a straight line and turning about one axis."""
    distance, angle = (float(part) for part in pose_error(start, end))
    count = max(1, int(np.ceil(max(distance / STEP, angle / TURN))))
    turn = start[:3, :3].T @ end[:3, :3]
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    if np.linalg.norm(axis) > 1e-12:
        axis = axis / np.linalg.norm(axis)
    else:  # no turn, or half a turn: about the column that does not vanish
        half = turn + np.eye(3)
        axis = half[:, np.linalg.norm(half, axis=0).argmax()]
        axis = axis / np.linalg.norm(axis)
    return [
        from_rotation(
            start[:3, :3] @ rotation_about(axis, s * angle), (1 - s) * start[:3, 3] + s * end[:3, 3]
        )
        for s in np.linspace(0.0, 1.0, count + 1)
    ]
