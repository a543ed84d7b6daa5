"""A joint of a robot's tree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgrasp.poses import Array, from_rotation, rotation_about

__all__ = ["DEFAULT_VELOCITY", "Joint", "joint_motion"]

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


def joint_motion(joint: Joint, value: Array) -> Array:
    """Return the poses (..., 4, 4) of a joint's frame relative to zero, at values (...) (rad or m)."""
    if joint.kind == "prismatic":
        return from_rotation(np.eye(3), value[..., None] * joint.axis)
    return from_rotation(rotation_about(joint.axis, value))
