"""The camera as it follows what is played and what was planned."""

from __future__ import annotations

import numpy as np

from symgrasp.poses import Array

from ..render.drawn_poses import drawn_joint_values, drawn_object_pose
from ..state.page_link import Camera
from ..state.state import State
from .viewpoint import FIELD_OF_VIEW

__all__ = ["followed", "points_to_follow"]

KEPT = 0.88
"""Share of the view, from its middle, in which everything is kept that is followed."""

NEAREST = 0.15
"""Least distance (m) in front of the camera."""


def points_to_follow(state: State) -> Array:
    """Return what has to be seen of the plan's task that is shown: points (n, 3) of the world.

    The ends of the object's axis, and all links of the robots that hold it in that task; none where no task
    of a plan is shown.
    """
    if state.shown_task is None:
        return np.empty((0, 3))
    profile, pose, values = state.scene.profile, drawn_object_pose(state), drawn_joint_values(state)
    ends = [(pose @ [0.0, 0.0, h, 1.0])[None, :3] for h in (profile.h_min, profile.h_max)]
    robots = {state.scene.arm(hold.arm).robot.name for hold in state.shown_task.holds}
    links = [
        (robot.T_world_base @ robot.model.forward(values[name]))[:, :3, 3]
        for name, robot in state.scene.robots.items()
        if name in robots
    ]
    return np.concatenate([*ends, *links])


def followed(camera: Camera, points: Array, aspect: float) -> Camera:
    """Return the camera from which points are in view: moved as little as possible, and not turned.

    Args:
        camera: where it is.
        points: the points (n, 3).
        aspect: ratio of width to height of the view.
    """
    eye, look_at = np.array(camera[:3]), np.array(camera[3:])
    forward = (look_at - eye) / np.linalg.norm(look_at - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if not len(points) or np.linalg.norm(right) < 1e-6:  # seen from straight above nothing is to the right
        return camera
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    depth = (points - eye) @ forward
    half = KEPT * np.tan(FIELD_OF_VIEW / 2)
    sides = [((points - eye) @ right, half * aspect), ((points - eye) @ up, half)]
    # Moved back by b, a point at x is in view if |x - t| <= k (depth + b), where t is the move sideways.
    back = max(
        0.0,
        float(NEAREST - depth.min()),
        *(float(((x - k * depth).max() - (x + k * depth).min()) / (2 * k)) for x, k in sides),
    )
    across, upwards = (
        float(np.clip(0.0, (x - k * (depth + back)).max(), (x + k * (depth + back)).min())) for x, k in sides
    )
    if not (back or across or upwards):
        return camera
    moved = across * right + upwards * up
    return tuple(float(v) for v in (*(eye + moved - back * forward), *(look_at + moved)))
