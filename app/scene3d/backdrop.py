"""The static part of the 3D view: obstacles, floor and lights."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import viser

from symgrasp.meshes import joined
from symgrasp.poses import quat_wxyz
from symgrasp.robot.link_shapes import shape_mesh
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene

from ..choices.scene_assets import Visuals
from .nodes import add_links, set_pose
from .viewpoint import Viewpoint

__all__ = ["add_floor", "add_lights", "add_obstacle"]

OBSTACLES = ((202, 199, 193), (164, 173, 184), (190, 172, 150), (170, 180, 160))
"""Colours (sRGB) of the obstacles in turn, paler than those of the map."""

FLOOR = ((247, 248, 249), (225, 225, 225), (205, 205, 205))
DARK_FLOOR = ((38, 40, 44), (52, 55, 60), (70, 74, 80))
"""Colours (sRGB) of the floor, its lines, and every fifth line."""

FLOOR_GAP = 0.002
"""Distance (m) of the floor below the lowest base, so that neither hides the other."""


def add_obstacle(client: viser.ClientHandle, name: str, o: Obstacle, index: int, visuals: Visuals) -> None:
    """Add an obstacle.

    Args:
        client: the browser.
        name: path of its node.
        o: the obstacle.
        index: its index in the scene, which chooses its colour.
        visuals: see `app.scene3d.nodes.add_links`.
    """
    scene = client.scene
    options: dict[str, Any] = {
        "color": OBSTACLES[index % len(OBSTACLES)],
        "cast_shadow": False,
        "receive_shadow": False,
        "wxyz": quat_wxyz(o.T_world_obstacle),
        "position": o.T_world_obstacle[:3, 3],
    }
    if o.kind == "box":
        scene.add_box(name, dimensions=np.array(o.size), **options)
    elif o.kind == "cylinder":
        scene.add_cylinder(name, radius=o.size[0], height=o.size[1], radial_segments=48, **options)
    elif o.kind == "sphere":
        scene.add_icosphere(name, radius=o.size[0], **options)
    else:
        seen: Collection[str] = ()
        if o.model is not None:
            model = o.model
            set_pose(scene.add_frame(f"{name}/links", show_axes=False), o.T_world_obstacle)
            seen = add_links(client, f"{name}/links", model, model.default_values(), visuals)
        bare = [shape_mesh(shape, f"obstacle {o.name}") for link, shape in o.shapes() if link not in seen]
        if bare:  # what cannot be seen otherwise
            mesh = joined(bare)
            scene.add_mesh_simple(
                f"{name}/shape", mesh.vertices, mesh.faces, side="double", flat_shading=True, **options
            )


def add_floor(client: viser.ClientHandle, name: str, scene: Scene, *, dark: bool) -> None:
    """Add a faint grid below robots and boxes, in place of an earlier one of that name."""
    plane, cell, section = DARK_FLOOR if dark else FLOOR
    low = [robot.T_world_base[2, 3] for robot in scene.robots.values()]
    low += [o.T_world_obstacle[2, 3] - o.size[2] / 2 for o in scene.obstacles if o.kind == "box"]
    client.scene.add_grid(
        name,
        width=4.0,
        height=4.0,
        cell_size=0.1,
        section_size=0.5,
        cell_color=cell,
        section_color=section,
        plane_color=plane,
        plane_opacity=1.0,
        shadow_opacity=0.0,
        position=(0.0, 0.0, min(low) - FLOOR_GAP),
    )


def add_lights(client: viser.ClientHandle, name: str, view: Viewpoint) -> None:
    """Add even lights: colours match the legend, with just enough shading to recognize shapes."""
    scene = client.scene
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map(None)
    scene.add_light_ambient(f"{name}/ambient", intensity=1.5)
    key = view.direction - 0.7 * view.right + np.array([0.0, 0.0, 1.0])
    fill = view.direction + 1.5 * view.right + np.array([0.0, 0.0, 0.3])
    scene.add_light_directional(f"{name}/key", intensity=1.8, position=tuple(key))
    scene.add_light_directional(f"{name}/fill", intensity=0.5, position=tuple(fill))
