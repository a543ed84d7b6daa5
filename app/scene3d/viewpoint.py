"""The camera's first pose: one from which robots and object are visible."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symgrasp.object.profile import Profile
from symgrasp.poses import Array, from_rotation, translation
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene

from ..state.page_link import Camera

__all__ = [
    "FIELD_OF_VIEW",
    "FLAT_SIZE",
    "Box",
    "Viewpoint",
    "box_of",
    "choose_viewpoint",
    "corners",
    "flat_map_box",
    "flat_map_pose",
    "flat_map_position",
    "hides",
    "link_boxes",
    "link_points",
    "stand_around",
    "surface_points",
]


FIELD_OF_VIEW = np.deg2rad(42)
"""Vertical field of view (rad)."""

ELEVATION = np.deg2rad(24)
"""Angle (rad) of the camera above the horizontal."""

MIN_WIDTH = 0.5
"""Least width (m) of the view at the point the camera looks at."""

WIDEST = 1.1
"""Ratio of width to height above which a wider view shows no more from bottom to top."""

NARROWEST = 0.25
"""Ratio of width to height below which a narrower view is not seen from further away."""

FILLED = 0.92
"""Share of the view, from its middle, that what has to be in view fills at most."""

STEEP = 1e-3
"""A camera nearer (m) than this to the vertical through the point it looks at has no azimuth."""

AZIMUTHS = np.deg2rad([65, -65, 40, -40, 20, -20, 90, -90, 115, -115])
"""Azimuths (rad) to choose from, relative to the direction from robot to object; the first wins a tie."""

NEARER = 1.0
"""What a metre that the camera is further away counts beside a fifth of the object's axis that is hidden."""

ALONG, AROUND_AXIS = 5, 6
"""Heights, and points around each, of the object's surface that are to be seen."""

FLAT_SIZE = (0.33, 0.22)
"""Width and height (m) of the flat map."""

TITLE_ROOM = 0.06
"""Height (m) above the flat map that its title needs in a view of a metre and a half."""

AROUND = 0.3
"""Robots surround an object that is nearer (m) than this to the mean of their bases."""


Box = tuple[Array, Array]
"""Half of the sizes (3,) of a box, and the pose (4, 4) of its middle in the world."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A direction to see a scene from, and what is in view.

    Attributes:
        direction: towards the camera (3,), horizontal, of length 1.
        points: those (n, 3) that are in view.
    """

    direction: Array
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

    def camera(self, aspect: float) -> Camera:
        """Return the nearest camera that has all points in the middle of a view with this width to height."""
        aspect = max(aspect, NARROWEST)
        towards = np.cos(ELEVATION) * self.direction + np.array([0.0, 0.0, np.sin(ELEVATION)])
        middle = (self.points.min(axis=0) + self.points.max(axis=0)) / 2
        offsets = self.points - middle
        nearer, half = offsets @ towards, FILLED * np.tan(FIELD_OF_VIEW / 2)
        sides = [(self.right, half * aspect), (np.cross(towards, self.right), half)]
        # A point at x is in view if |x - t| <= k (distance - nearer), where t is the move sideways.
        ranges = [(offsets @ side + k * nearer, offsets @ side - k * nearer, side, k) for side, k in sides]
        distance = max(
            MIN_WIDTH / (2 * np.tan(FIELD_OF_VIEW / 2) * min(aspect, WIDEST)),
            *(float((high.max() - low.min()) / (2 * k)) for high, low, _, k in ranges),
        )
        look_at = middle + sum((high.max() + low.min()) / 2 * side for high, low, side, _ in ranges)
        return tuple(float(v) for v in (*(look_at + distance * towards), *look_at))


def choose_viewpoint(
    scene: Scene,
    T_world_object: Array,
    values: Mapping[str, Array] | None = None,
    aspect: float = 1.0,
    *,
    close: bool = False,
    flat_map: bool = True,
) -> Viewpoint:
    """Choose a viewpoint from which robots and object are in view, the object large and not hidden.

    Of `AZIMUTHS`, the one wins from which boxes, cylinders and links hide least of the object, its axis is
    least foreshortened, and the camera is nearest.

    Args:
        scene: the scene.
        T_world_object: pose (4, 4) of the object.
        values: robot → its joint values (n,) in rad or m; any other is at home.
        aspect: ratio of width to height of the view.
        close: whether the places of the object in all tasks may be out of view.
        flat_map: whether the flat map is shown, and is to be in view.
    """
    bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
    profile = scene.profile
    axis = np.array([[0.0, 0.0, h, 1.0] for h in np.linspace(profile.h_min, profile.h_max, 5)])
    points = (axis @ T_world_object.T)[:, :3]
    ahead = (points[2] - bases.mean(axis=0)) * [1.0, 1.0, 0.0]
    if stand_around(scene, T_world_object):
        ahead = (bases[-1] - bases[0]) * [1.0, 1.0, 0.0]
    start = np.arctan2(ahead[1], ahead[0]) if np.linalg.norm(ahead) > 1e-6 else 0.0

    home = {name: robot.home for name, robot in scene.robots.items()}
    values = home | dict(values or {})
    middle = [0.0, 0.0, (profile.h_min + profile.h_max) / 2, 1.0]
    places = [] if close else [(task.T_world_object @ middle)[None, :3] for task in scene.tasks.values()]
    in_view = np.concatenate([*link_points(scene, values), surface_points(profile, T_world_object), *places])
    boxes = [box for o in scene.obstacles if (box := box_of(o))] + link_boxes(scene, values)

    def cost(view: Viewpoint) -> float:
        camera = np.array(view.camera(aspect))
        hidden = sum(int(hides(box, points, camera[:3]).sum()) for box in boxes)
        away = np.linalg.norm(camera[:3] - camera[3:])
        return hidden + 2 * abs(float(T_world_object[:3, 2] @ view.direction)) + NEARER * float(away)

    def view(azimuth: float) -> Viewpoint:
        view = Viewpoint(np.array([np.cos(azimuth), np.sin(azimuth), 0.0]), in_view)
        if not flat_map:
            return view
        edges = corners(flat_map_box(flat_map_position(scene, T_world_object, view), view))
        return replace(view, points=np.concatenate([in_view, edges]))

    return min((view(start + a) for a in AZIMUTHS), key=cost)


def flat_map_position(scene: Scene, T_world_object: Array, view: Viewpoint) -> Array:
    """Return the centre (3,) of the flat map: beside the object away from the robots, or above it."""
    profile = scene.profile
    centre = (T_world_object @ [0.0, 0.0, (profile.h_min + profile.h_max) / 2, 1.0])[:3]
    if stand_around(scene, T_world_object):
        return centre + np.array([0.0, 0.0, 0.55])
    bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
    away = 1.0 if (centre - bases.mean(axis=0)) @ view.right >= 0 else -1.0
    position = centre + away * (profile.r_max + 0.07 + FLAT_SIZE[0] / 2) * view.right
    position[2] = max(position[2], FLAT_SIZE[1] / 2 + 0.06)
    return position


def flat_map_pose(position: Array, view: Viewpoint) -> Array:
    """Return the pose (4, 4) of the flat map at a position (3,) where it faces a viewpoint."""
    axes = np.stack([view.right, [0.0, 0.0, 1.0], view.direction], axis=-1)
    return from_rotation(axes, position)


def flat_map_box(position: Array, view: Viewpoint) -> Box:
    """Return the box that the flat map and its title fill; see `flat_map_pose`."""
    width, height = FLAT_SIZE
    middle = flat_map_pose(position, view) @ translation([0.0, TITLE_ROOM / 2, 0.0])
    return np.array([width, height + TITLE_ROOM, 0.01]) / 2, middle


def corners(box: Box) -> Array:
    """Return the corners (8, 3) of a box."""
    half, T_world_box = box
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    return (signs * half) @ T_world_box[:3, :3].T + T_world_box[:3, 3]


def surface_points(profile: Profile, T_world_object: Array) -> Array:
    """Return points (n, 3) of the surface of an object at a pose (4, 4)."""
    heights = np.linspace(profile.h_min, profile.h_max, ALONG)
    around = np.arange(AROUND_AXIS) * 2 * np.pi / AROUND_AXIS
    x, y = profile.radius(heights)[:, None] * np.stack([np.cos(around), np.sin(around)])[:, None]
    surface = np.stack(np.broadcast_arrays(x, y, heights[:, None], 1.0), axis=-1).reshape(-1, 4)
    return (surface @ T_world_object.T)[:, :3]


def stand_around(scene: Scene, T_world_object: Array) -> bool:
    """Return whether several robots stand around the object, at a pose (4, 4)."""
    bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
    middle = T_world_object @ [0.0, 0.0, (scene.profile.h_min + scene.profile.h_max) / 2, 1.0]
    return len(bases) > 1 and bool(np.linalg.norm((middle[:3] - bases.mean(axis=0))[:2]) < AROUND)


def box_of(o: Obstacle) -> Box | None:
    """Return the bounding box of a box or cylinder; None for any other obstacle."""
    if o.kind == "box":
        return np.array(o.size) / 2, o.T_world_obstacle
    if o.kind == "cylinder":
        return np.array([o.size[0], o.size[0], o.size[1] / 2]), o.T_world_obstacle
    return None


def link_points(scene: Scene, values: Mapping[str, Array]) -> list[Array]:
    """Return the corners (n, 3) of each convex piece of the links of robots at joint values."""
    return [hull @ pose[:3, :3].T + pose[:3, 3] for hull, pose in _link_hulls(scene, values)]


def link_boxes(scene: Scene, values: Mapping[str, Array]) -> list[Box]:
    """Return boxes around the pieces of the links of robots at joint values."""
    boxes = []
    for hull, pose in _link_hulls(scene, values):
        low, high = hull.min(axis=0), hull.max(axis=0)
        boxes.append(((high - low) / 2, pose @ translation((low + high) / 2)))
    return boxes


def _link_hulls(scene: Scene, values: Mapping[str, Array]) -> Iterator[tuple[Array, Array]]:
    """Yield the corners (n, 3) of each convex piece of the links of robots, and its pose (4, 4)."""
    for name, q in values.items():
        robot = scene.robots[name]
        poses = robot.T_world_base @ robot.model.forward(q)
        for link, pose in zip(robot.model.link_names, poses, strict=True):
            yield from ((hull, pose) for hull in robot.model.hulls(link))


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
