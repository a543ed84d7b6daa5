"""What stands in a scene and never moves by itself: obstacles, floor, lights and camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import viser

from app.meshes import link_visuals
from symgrasp.meshes import read_mesh
from symgrasp.poses import Array, quat_wxyz
from symgrasp.robot import RobotModel
from symgrasp.scene import Obstacle, Scene

__all__ = ["FIELD_OF_VIEW", "add_floor", "add_links", "add_obstacle", "camera_position", "place", "viewpoint"]

OBSTACLE = (171, 166, 158)
FLOOR_GAP = 0.002

FIELD_OF_VIEW = np.deg2rad(42)
VIEW_WIDTH = 1.3
"""Width (m) that is seen where the camera looks at."""
VIEW_HEIGHT = np.deg2rad(24)
AZIMUTHS = np.deg2rad([65, -65, 40, -40, 90, -90, 115, -115])
"""Directions to look from, against that from robot to object; the first with a free view is taken."""


def place(node: viser.SceneNodeHandle, pose: Array) -> None:
    """Put a node at a pose (4, 4) in its parent."""
    node.wxyz = quat_wxyz(pose)
    node.position = pose[:3, 3]


def add_links(client: viser.ClientHandle, root: str, path: Path) -> dict[str, viser.GlbHandle]:
    """Add the visible links of a URDF under a node; link name → its node."""
    visuals = link_visuals(path)
    return {
        link: client.scene.add_glb(f"{root}/{k}", glb, cast_shadow=False, receive_shadow=False)
        for k, (link, glb) in enumerate(visuals.items())
    }


def add_obstacle(client: viser.ClientHandle, name: str, o: Obstacle) -> None:
    """Add an obstacle."""
    scene = client.scene
    look: dict[str, Any] = {
        "color": OBSTACLE,
        "cast_shadow": False,
        "receive_shadow": False,
        "wxyz": quat_wxyz(o.T_world_obstacle),
        "position": o.T_world_obstacle[:3, 3],
    }
    if o.kind == "box":
        scene.add_box(name, dimensions=np.array(o.size), **look)
    elif o.kind == "cylinder":
        scene.add_cylinder(name, radius=o.size[0], height=o.size[1], radial_segments=48, **look)
    elif o.kind == "sphere":
        scene.add_icosphere(name, radius=o.size[0], **look)
    elif o.kind == "mesh":
        assert o.path is not None
        mesh = read_mesh(o.path, f"obstacle {o.name}")
        scene.add_mesh_simple(name, mesh.vertices, mesh.faces, side="double", flat_shading=True, **look)
    else:
        assert o.path is not None
        model = RobotModel(o.path)
        place(scene.add_frame(name, show_axes=False), o.T_world_obstacle)
        poses = model.forward(model.default_values())
        for link, node in add_links(client, name, o.path).items():
            place(node, poses[model.link_index(link)])


def add_floor(client: viser.ClientHandle, name: str, scene: Scene) -> None:
    """Add a faint grid under everything."""
    low = [robot.T_world_base[2, 3] for robot in scene.robots.values()]
    low += [o.T_world_obstacle[2, 3] - o.size[2] / 2 for o in scene.obstacles if o.kind == "box"]
    client.scene.add_grid(
        name,
        width=4.0,
        height=4.0,
        cell_size=0.1,
        section_size=0.5,
        cell_color=(225, 225, 225),
        section_color=(205, 205, 205),
        plane_color=(247, 248, 249),
        plane_opacity=1.0,
        shadow_opacity=0.0,
        position=(0.0, 0.0, min(low) - FLOOR_GAP),
    )


def viewpoint(scene: Scene, T_world_object: Array) -> tuple[Array, Array]:
    """Return where to look at and the horizontal direction (3,) to look from.

    Robots and object are seen from the side; of several such directions the first from which no
    box or cylinder hides the object.
    """
    bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
    axis = np.array([[0.0, 0.0, h, 1.0] for h in np.linspace(scene.profile.h_min, scene.profile.h_max, 5)])
    points = (axis @ T_world_object.T)[:, :3]
    middle = bases.mean(axis=0)
    ahead = (points[2] - middle) * [1.0, 1.0, 0.0]
    if len(bases) > 1 and np.linalg.norm(ahead) < 0.3:  # robots around the object
        ahead = (bases[-1] - bases[0]) * [1.0, 1.0, 0.0]
    start = np.arctan2(ahead[1], ahead[0]) if np.linalg.norm(ahead) > 1e-6 else 0.0
    look_at = 0.8 * points[2] + 0.2 * (middle + np.array([0.0, 0.0, 0.5]))
    directions = [np.array([np.cos(start + a), np.sin(start + a), 0.0]) for a in AZIMUTHS]
    eyes = [camera_position(look_at, d) for d in directions]
    hidden = [sum(_hides(o, p, eye) for o in scene.obstacles for p in points) for eye in eyes]
    return look_at, directions[int(np.argmin(hidden))]


def camera_position(look_at: Array, direction: Array, aspect: float = 1.0) -> Array:
    """Return where the camera stands that looks from a horizontal direction.

    Args:
        look_at: the point in the middle of the picture.
        direction: from there towards the camera, horizontally.
        aspect: width by height of the picture.
    """
    distance = VIEW_WIDTH / (2 * np.tan(FIELD_OF_VIEW / 2) * np.clip(aspect, 0.58, 1.1))
    rise = np.array([0.0, 0.0, np.sin(VIEW_HEIGHT)])
    return look_at + distance * (np.cos(VIEW_HEIGHT) * direction + rise)


def _hides(o: Obstacle, point: Array, eye: Array) -> bool:
    """Whether the bounding box of a box or cylinder cuts the line of sight to a point."""
    if o.kind == "box":
        half = np.array(o.size) / 2
    elif o.kind == "cylinder":
        half = np.array([o.size[0], o.size[0], o.size[1] / 2])
    else:
        return False
    to_local = np.linalg.inv(o.T_world_obstacle)
    start, end = (to_local @ [*p, 1.0] for p in (point, eye))
    step = end[:3] - start[:3]
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    near, far = np.sort([(-half - start[:3]) / step, (half - start[:3]) / step], axis=0)
    enter, leave = near.max(), far.min()
    return bool(leave > max(enter, 0.01) and enter < 1.0)
