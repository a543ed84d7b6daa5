"""Where points of the world are seen in a view."""

from __future__ import annotations

import numpy as np

from app.scene3d.viewpoint import FIELD_OF_VIEW
from app.state.page_link import Camera
from symgrasp.robot.robot import Robot


def in_view(camera: Camera, points: np.ndarray, aspect: float) -> np.ndarray:
    """Where points (n, 3) are in the view: from -1 to 1 across and upwards; NaN behind the camera."""
    eye, target = np.array(camera[:3]), np.array(camera[3:])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, depth = np.stack([right, np.cross(right, forward), forward]) @ (points - eye).T
    half = np.tan(FIELD_OF_VIEW / 2)
    depth = np.where(depth > 0, depth, np.nan)
    return np.stack([x / (depth * half * aspect), y / (depth * half)], axis=-1)


def link_corners(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return the corners (n, 3) of all links' hulls at joint values (n,)."""
    poses = robot.T_world_base @ robot.model.forward(q)
    return np.concatenate(
        [
            hull @ pose[:3, :3].T + pose[:3, 3]
            for link, pose in zip(robot.model.link_names, poses, strict=True)
            for hull in robot.model.hulls(link)
        ]
    )
