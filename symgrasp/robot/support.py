"""What a legged robot stands on: the area that its centre of mass must stay above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.poses import Array
from symgrasp.robot.model import RobotModel

__all__ = ["area_of_corners", "area_of_feet"]

SOLE = 5e-3
"""Corners of a foot that are at most this much (m) above its lowest one touch the ground."""


def area_of_corners(corners: Sequence[tuple[float, float]], T_world_base: Array) -> Array | None:
    """Return the convex area between corners, seen from above.

    Args:
        corners: [x, y] (m) in the base frame.
        T_world_base: pose (4, 4) of the base.

    Returns:
        Its corners (k, 2) in the world, counterclockwise; None if it has no area.
    """
    points = np.array([[x, y, 0.0] for x, y in corners])
    return _convex(points @ T_world_base[:3, :3].T + T_world_base[:3, 3])


def area_of_feet(feet: Sequence[str], model: RobotModel, home: Array, T_world_base: Array) -> Array | None:
    """Return the convex area between the soles of feet, seen from above.

    Args:
        feet: links of the model.
        model: the robot's model.
        home: (N,) its joint values.
        T_world_base: pose (4, 4) of the base.

    Returns:
        Its corners (k, 2) in the world, counterclockwise; None if it has no area.
    """
    poses = T_world_base @ model.forward(home)
    soles = []
    for link in feet:
        pose = poses[model.link_index(link)]
        for hull in model.hulls(link):
            points = hull @ pose[:3, :3].T + pose[:3, 3]
            soles.append(points[points[:, 2] <= points[:, 2].min() + SOLE])
    return _convex(np.concatenate(soles)) if soles else None


def _convex(points: Array) -> Array | None:
    """Return the corners (k, 2) of the convex hull of points (n, 3) from above; None if it has no area."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points[:, :2]).vertices, :2]
    except (QhullError, ValueError):
        return None
