"""The camera's first pose: one from which robots and object are visible."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symgrasp.poses import Array, translation
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene

__all__ = [
    "FIELD_OF_VIEW",
    "Box",
    "Viewpoint",
    "box_of",
    "choose_viewpoint",
    "hides",
    "link_boxes",
    "stand_around",
]


FIELD_OF_VIEW = np.deg2rad(42)
"""Vertical field of view (rad)."""

ELEVATION = np.deg2rad(24)
"""Angle (rad) of the camera above the horizontal."""

MIN_WIDTH = 1.3
"""Least width (m) of the view at the point the camera looks at."""

WIDEST = 1.1
"""Ratio of width to height above which a wider view shows no more from bottom to top."""

NARROWEST = 0.25
"""Ratio of width to height below which a narrower view is not seen from further away."""

AROUND_LINKS = 1.05
"""How much further away the camera is than it has to be for all links to be in view."""

STEEP = 1e-3
"""A camera nearer (m) than this to the vertical through the point it looks at has no azimuth."""

AZIMUTHS = np.deg2rad([65, -65, 40, -40, 90, -90, 115, -115])
"""Azimuths (rad) to choose from, relative to the direction from robot to object; the first wins a tie."""

AROUND = 0.3
"""Robots surround an object that is nearer (m) than this to the mean of their bases."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A direction to see a scene from, and how much of it is in view.

    Attributes:
        look_at: the point (3,) in the middle of the view.
        direction: from there towards the camera (3,), horizontal, of length 1.
        width: of the view (m) at that point, at the least.
        points: those (n, 3) that are in view.
    """

    look_at: Array
    direction: Array
    width: float
    points: Array

    @property
    def right(self) -> Array:
        """Horizontal unit vector (3,) that points to the right in the view."""
        return np.cross([0.0, 0.0, 1.0], self.direction)

    def seen_from(self, camera: Sequence[float]) -> Viewpoint:
        """Return this viewpoint with the direction of a camera; see `app.state.page_link.Camera`."""
        direction = (np.array(camera[:3]) - camera[3:]) * [1.0, 1.0, 0.0]
        length = np.linalg.norm(direction)
        return replace(self, direction=direction / length) if length > STEEP else self

    def camera(self, aspect: float) -> Array:
        """Return the position (3,) of the camera for a view with this ratio of width to height."""
        half = np.tan(FIELD_OF_VIEW / 2)
        aspect = max(aspect, NARROWEST)
        towards = np.cos(ELEVATION) * self.direction + np.array([0.0, 0.0, np.sin(ELEVATION)])
        up = np.cross(towards, self.right)
        offsets = self.points - self.look_at
        # What is nearer to the camera than the point that it looks at appears further from the middle.
        apart = np.maximum(np.abs(offsets @ self.right) / aspect, np.abs(offsets @ up)) / half
        distance = max(
            self.width / (2 * half * min(aspect, WIDEST)),
            AROUND_LINKS * float((apart + offsets @ towards).max()),
        )
        return self.look_at + distance * towards


def choose_viewpoint(
    scene: Scene, T_world_object: Array, values: Mapping[str, Array] | None = None
) -> Viewpoint:
    """Choose a viewpoint with robots and object side by side and the object visible.

    Of `AZIMUTHS`, the one wins from which boxes and cylinders hide least of the object and its axis is
    least foreshortened.

    Args:
        scene: the scene.
        T_world_object: pose (4, 4) of the object.
        values: robot → its joint values (n,) in rad or m, where links at them may hide the object as well.
    """
    bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
    axis = np.array([[0.0, 0.0, h, 1.0] for h in np.linspace(scene.profile.h_min, scene.profile.h_max, 5)])
    points = (axis @ T_world_object.T)[:, :3]
    middle = [0.0, 0.0, (scene.profile.h_min + scene.profile.h_max) / 2, 1.0]
    centres = np.array([(task.T_world_object @ middle)[:3] for task in scene.tasks.values()])
    ahead = (points[2] - bases.mean(axis=0)) * [1.0, 1.0, 0.0]
    look_at = 0.8 * points[2] + 0.2 * (bases.mean(axis=0) + np.array([0.0, 0.0, 0.5]))
    margin = 0.2
    if len(bases) > 1:  # all of them are in view, also one far from the object
        margin = 0.4
        everything = np.concatenate([bases, points])[:, :2]
        look_at[:2] = (everything.min(axis=0) + everything.max(axis=0)) / 2
    if stand_around(scene, T_world_object):
        ahead = (bases[-1] - bases[0]) * [1.0, 1.0, 0.0]
    start = np.arctan2(ahead[1], ahead[0]) if np.linalg.norm(ahead) > 1e-6 else 0.0

    in_view = np.concatenate([_corners(scene), points, centres])

    def view(azimuth: float) -> Viewpoint:
        direction = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        right = np.cross([0.0, 0.0, 1.0], direction)
        reach = np.abs((np.concatenate([bases, points, centres]) - look_at) @ right).max() + margin
        return Viewpoint(look_at, direction, float(max(MIN_WIDTH, 2 * reach)), in_view)

    boxes = [box for o in scene.obstacles if (box := box_of(o))] + link_boxes(scene, values or {})

    def cost(view: Viewpoint) -> float:
        eye = view.camera(aspect=1.0)
        hidden = sum(int(hides(box, points, eye).sum()) for box in boxes)
        return hidden + 2 * abs(float(T_world_object[:3, 2] @ view.direction))

    return min((view(start + a) for a in AZIMUTHS), key=cost)


def _corners(scene: Scene) -> Array:
    """Return the corners (n, 3) of boxes around the links of all robots at home, in the world."""
    corners = []
    for robot in scene.robots.values():
        model, poses = robot.model, robot.T_world_base @ robot.model.forward(robot.home)
        corners.append(poses[:, :3, 3])
        for link, pose in zip(model.link_names, poses, strict=True):
            for hull in model.hulls(link):
                ends = np.array(
                    list(itertools.product(*np.stack([hull.min(axis=0), hull.max(axis=0)], axis=1)))
                )
                corners.append(ends @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(corners)


def stand_around(scene: Scene, T_world_object: Array) -> bool:
    """Return whether several robots stand around the object, at a pose (4, 4)."""
    bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
    middle = T_world_object @ [0.0, 0.0, (scene.profile.h_min + scene.profile.h_max) / 2, 1.0]
    return len(bases) > 1 and bool(np.linalg.norm((middle[:3] - bases.mean(axis=0))[:2]) < AROUND)


Box = tuple[Array, Array]
"""Half of the sizes (3,) of a box, and the pose (4, 4) of its middle in the world."""


def box_of(o: Obstacle) -> Box | None:
    """Return the bounding box of a box or cylinder; None for any other obstacle."""
    if o.kind == "box":
        return np.array(o.size) / 2, o.T_world_obstacle
    if o.kind == "cylinder":
        return np.array([o.size[0], o.size[0], o.size[1] / 2]), o.T_world_obstacle
    return None


def link_boxes(scene: Scene, values: Mapping[str, Array]) -> list[Box]:
    """Return boxes around the pieces of the links of robots at joint values."""
    boxes = []
    for name, q in values.items():
        robot = scene.robots[name]
        poses = robot.T_world_base @ robot.model.forward(q)
        for link, pose in zip(robot.model.link_names, poses, strict=True):
            for hull in robot.model.hulls(link):
                low, high = hull.min(axis=0), hull.max(axis=0)
                boxes.append(((high - low) / 2, pose @ translation((low + high) / 2)))
    return boxes


def hides(box: Box, points: Array, eye: Array) -> Array:
    """Return for points (n, 3) whether a box intersects the lines from the eye (3,) to them: (n,)."""
    half, T_world_box = box
    to_local = np.linalg.inv(T_world_box)
    start = points @ to_local[:3, :3].T + to_local[:3, 3]
    step = to_local[:3, :3] @ eye + to_local[:3, 3] - start
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    near, far = np.sort([(-half - start) / step, (half - start) / step], axis=0)
    enter, leave = near.max(axis=-1), far.min(axis=-1)
    return (leave > np.maximum(enter, 0.01)) & (enter < 1.0)
