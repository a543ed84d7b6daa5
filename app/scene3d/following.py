"""The camera as it follows what is played and what was planned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.poses import Array, rotation_z

from ..render.drawn_poses import drawn_joint_values, drawn_object_pose
from ..state.page_link import Camera
from ..state.state import State
from .flat_map import FlatMap
from .viewpoint import FIELD_OF_VIEW, Box, box_of, corners, hides, link_boxes, link_points, surface_points

__all__ = ["followed", "hidden_points", "objects_of_plan", "points_to_follow", "unhidden", "with_flat_map"]

KEPT = 0.88
"""Share of the view, from its middle, in which everything is kept that is followed."""

NEAREST = 0.15
"""Least distance (m) in front of the camera."""

TURNS = np.deg2rad([0, 15, -15, 30, -30, 45, -45, 60, -60, 75, -75, 90, -90, 120, -120, 150, -150, 180])
"""Angles (rad) that the camera may be turned by about the vertical; the first wins a tie."""


def points_to_follow(state: State) -> Array:
    """Return what has to be seen of the plan's task that is shown: points (n, 3) of the world.

    The object's surface, and all links of the robots that hold it in that task; none where no task of a plan
    is shown.
    """
    if state.shown_task is None:
        return np.empty((0, 3))
    values = drawn_joint_values(state)
    robots = {state.scene.arm(hold.arm).robot.name for hold in state.shown_task.holds}
    links = link_points(state.scene, {name: q for name, q in values.items() if name in robots})
    return np.concatenate([surface_points(state.scene.profile, drawn_object_pose(state)), *links])


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


def with_flat_map(points: Array, flat_map: FlatMap | None, camera: Camera) -> Array:
    """Return points (n, 3) that have to be seen, and the corners of the flat map if there is one.

    Args:
        points: the points.
        flat_map: the flat map, where it is shown.
        camera: from where it is seen.
    """
    return points if flat_map is None else np.concatenate([points, corners(flat_map.box(camera))])


def objects_of_plan(state: State) -> list[Array]:
    """Return points (n, 3) of the object's surface: as it is drawn, then in every task of the plan."""
    tasks = state.plan.plan.tasks if state.plan else []
    poses = [drawn_object_pose(state), *(task.object_pose_turned.array() for task in tasks)]
    return [surface_points(state.scene.profile, pose) for pose in poses]


def hidden_points(camera: Camera, points: Array, boxes: Sequence[Box]) -> int:
    """Return how many of the points (n, 3) boxes hide from a camera."""
    eye = np.array(camera[:3])
    return int(np.any([hides(box, points, eye) for box in boxes], axis=0).sum()) if boxes else 0


def unhidden(camera: Camera, state: State, aspect: float, flat_map: FlatMap | None = None) -> Camera:
    """Return the camera that follows a plan and sees the object, which obstacles may hide.

    Where they hide it, the camera is turned about the vertical through the object, by that of `TURNS` from
    which least of the object is hidden: first as it is drawn, then in all tasks of the plan.

    Args:
        camera: where it is.
        state: the state, with a plan.
        aspect: ratio of width to height of the view.
        flat_map: which is followed, too, and may hide the object, where it is shown.
    """
    points, objects = points_to_follow(state), objects_of_plan(state)
    obstacles = [box for o in state.scene.obstacles if (box := box_of(o))]

    def hidden(camera: Camera) -> list[int]:
        boxes = [*obstacles, flat_map.box(camera)] if flat_map else obstacles
        return [hidden_points(camera, points, boxes) for points in objects]

    def follow(camera: Camera) -> Camera:
        return followed(camera, with_flat_map(points, flat_map, camera), aspect)

    after = follow(camera)
    if not hidden(after)[0]:
        return after

    links = link_boxes(state.scene, drawn_joint_values(state))

    def cost(camera: Camera) -> tuple[int, int, int]:
        now, *later = hidden(camera)
        return now, hidden_points(camera, objects[0], links), sum(later)

    middle = objects[0].mean(axis=0)
    turned = (follow(_turned(camera, middle, turn)) for turn in TURNS)
    return min(turned, key=cost)


def _turned(camera: Camera, middle: Array, angle: float) -> Camera:
    """Return a camera turned about the vertical through a point (3,)."""
    ends = np.array(camera).reshape(2, 3)
    around = (ends - middle) @ rotation_z(angle)[:3, :3].T + middle
    return tuple(float(v) for v in around.ravel())
