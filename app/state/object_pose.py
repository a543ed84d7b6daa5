"""A pose of the object in the parameters that a person sets: position, lean, spin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from symgrasp.poses import Array, axis_frame, rotation_z, spin
from symgrasp.scene.scene import Scene

__all__ = ["ObjectPose", "with_poses"]


@dataclass(frozen=True)
class ObjectPose:
    """A pose by the position of its origin, the lean of its axis and the spin about it.

    Attributes:
        x, y, z: origin of the object in the world (m).
        lean: angle (rad) between the axis and the world's z.
        towards: azimuth (rad) that the axis leans towards.
        spin: turn (rad) about the object's own axis.
    """

    x: float
    y: float
    z: float
    lean: float = 0.0
    towards: float = 0.0
    spin: float = 0.0

    @staticmethod
    def of(pose: Array) -> ObjectPose:
        """Return the parameters of a pose (4, 4)."""
        axis = pose[:3, 2]
        lean = float(np.arctan2(np.hypot(axis[0], axis[1]), axis[2]))
        towards = float(np.arctan2(axis[1], axis[0])) if lean > 1e-12 else 0.0
        x, y, z = pose[:3, 3].tolist()
        return ObjectPose(x, y, z, lean, towards, spin(pose))

    def matrix(self) -> Array:
        """Return the pose (4, 4)."""
        sine = np.sin(self.lean)
        pose = np.eye(4)
        pose[:3, 2] = [sine * np.cos(self.towards), sine * np.sin(self.towards), np.cos(self.lean)]
        pose[:3, 3] = [self.x, self.y, self.z]
        return axis_frame(pose) @ rotation_z(self.spin)


def with_poses(scene: Scene, poses: Mapping[str, ObjectPose]) -> Scene:
    """Return the scene with some of its tasks at other poses: task → pose."""
    for name, pose in poses.items():
        scene = scene.with_task(replace(scene.task(name), T_world_object=pose.matrix()))
    return scene
