"""The joints of a robot's tree, and how they move what they carry."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from symgrasp.poses import Array

__all__ = ["DEFAULT_VELOCITY", "Joint", "JointMotions"]

DEFAULT_VELOCITY = 1.0
"""Largest speed (rad/s or m/s) of joints for which a URDF states none above zero."""


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of the tree.

    Attributes:
        name: its name in the URDF.
        kind: its type in the URDF: revolute, continuous, prismatic or fixed.
        parent: index of the parent link.
        child: index of the child link.
        origin: pose (4, 4) of the joint in its parent link at zero.
        axis: unit axis (3,) in the joint frame.
        lower: lower limit (rad or m); -inf for a continuous joint.
        upper: upper limit.
        source: index into the robot's joint values, or -1 for a fixed joint.
        ratio: value of this joint for each unit of the source (1 unless it mimics).
        offset: value of this joint where the source is zero.
        velocity: largest speed (rad/s or m/s).
    """

    name: str
    kind: str
    parent: int
    child: int
    origin: Array
    axis: Array
    lower: float
    upper: float
    source: int
    ratio: float = 1.0
    offset: float = 0.0
    velocity: float = DEFAULT_VELOCITY


class JointMotions:
    """What the joints of a robot that move do at values of its joints, all at once.

    Args:
        joints: all its joints.

    Attributes:
        moving: those that move.
    """

    def __init__(self, joints: Iterable[Joint]) -> None:
        self.moving = tuple(joint for joint in joints if joint.source >= 0)
        slides = np.array([joint.kind == "prismatic" for joint in self.moving], dtype=bool)
        axis = np.array([joint.axis for joint in self.moving]).reshape(-1, 3)
        x, y, z = np.where(slides[:, None], 0.0, axis).T
        zero = np.zeros_like(x)
        cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
        self._source = np.array([joint.source for joint in self.moving], dtype=np.int64)
        self._ratio = np.array([joint.ratio for joint in self.moving])
        self._offset = np.array([joint.offset for joint in self.moving])
        self._cross, self._square, self._slide = cross, cross @ cross, np.where(slides[:, None], axis, 0.0)

    def poses(self, q: Array) -> Array:
        """Return the poses (..., J, 4, 4) of their frames relative to zero, by Rodrigues' formula.

        Args:
            q: (..., n) the values of the robot's joints (rad or m).
        """
        value = (self._ratio * q[..., self._source] + self._offset)[..., None]
        turn = value[..., None]
        poses = np.zeros((*value.shape[:-1], 4, 4))
        poses[..., :3, :3] = np.eye(3) + np.sin(turn) * self._cross + (1.0 - np.cos(turn)) * self._square
        poses[..., :3, 3] = value * self._slide
        poses[..., 3, 3] = 1.0
        return poses
