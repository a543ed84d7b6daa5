"""Scenes as bodies for the ray tracer: robots, obstacles, and the object with its map on it."""

from __future__ import annotations

import io
from collections.abc import Callable, Collection, Sequence

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from trimesh.visual import TextureVisuals

from app.render.palette import INK, rgb
from app.scene3d.backdrop import OBSTACLES
from app.scene3d.visual_meshes import link_visuals
from docs.figures.render import Body
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.meshes import joined
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.plan.plan import Hold, PlanTask
from symgrasp.poses import Array, inverse
from symgrasp.reason import Reason
from symgrasp.robot.link_shapes import shape_mesh
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Robot
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene

__all__ = [
    "SurfacePaint",
    "cells_paint",
    "floor",
    "map_colors",
    "object_body",
    "obstacles",
    "robot",
    "robots",
    "with_seam",
]

SurfacePaint = Callable[[Array, Array], Array]
"""Heights and angles (n,) in the object's frame → sRGB colours (n, 3), 0 to 1."""

CREASE = 0.6
"""Faces that meet at more than this (rad) keep their edge."""

SEAM = 0.004
"""Width (m) of the line at θ = 0."""

REASONS = np.array([rgb(reason.color) for reason in Reason]) / 255
LINE = 0.09
"""Width of the lines between cells, against the smaller side of a cell."""


def robot(the_robot: Robot, values: ArrayLike, links: Collection[str] | None = None) -> list[Body]:
    """Return a robot at joint values (n,), or some of its links."""
    poses = the_robot.T_world_base @ the_robot.model.forward(values)
    return _links(the_robot.model, poses, links)


def robots(scene: Scene, task: PlanTask | None, links: Collection[str] | None = None) -> list[Body]:
    """Return all robots as a task of a plan has them; those that hold nothing are at home."""
    bodies: list[Body] = []
    for name, one in scene.robots.items():
        holds = [hold for hold in task.holds if hold.robot == name] if task else []
        bodies += robot(one, _values(one, holds), links)
    return bodies


def _values(the_robot: Robot, holds: Sequence[Hold]) -> Array:
    values = np.array(the_robot.home)
    for hold in holds:
        for name, value in {**hold.joints, **hold.hand_joints}.items():
            values[the_robot.model.joint_names.index(name)] = value
    return values


def _links(model: RobotModel, poses: Array, links: Collection[str] | None = None) -> list[Body]:
    bodies = []
    for link, glb in link_visuals(model.urdf).items():
        if links is None or link in links:
            parts = trimesh.load_scene(io.BytesIO(glb), file_type="glb", process=False)
            for mesh in parts.dump():
                assert isinstance(mesh, trimesh.Trimesh)
                assert isinstance(mesh.visual, TextureVisuals)
                color = np.asarray(mesh.visual.material.main_color[:3]) / 255
                bodies.append(_body(mesh, poses[model.link_index(link)], color))
    return bodies


def obstacles(scene: Scene, without: Collection[str] = ()) -> list[Body]:
    """Return a scene's obstacles, coloured as on the page."""
    bodies: list[Body] = []
    for k, obstacle in enumerate(scene.obstacles):
        if obstacle.name not in without:
            bodies += _obstacle(obstacle, np.array(OBSTACLES[k % len(OBSTACLES)]) / 255)
    return bodies


def _obstacle(o: Obstacle, color: Array) -> list[Body]:
    if o.model is not None:
        return _links(o.model, o.T_world_obstacle @ o.model.forward(o.model.default_values()))
    if o.kind == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=4, radius=o.size[0])
    else:
        mesh = joined([shape_mesh(shape, f"obstacle {o.name}", sides=96) for _, shape in o.shapes()])
    return [_body(_creased(mesh), o.T_world_obstacle, color)]


def object_body(profile: Profile, T_world_object: Array, paint: SurfacePaint) -> Body:
    """Return the object at a pose (4, 4), painted by height and angle."""
    to_object = inverse(T_world_object)

    def color(points: Array) -> Array:
        local = points @ to_object[:3, :3].T + to_object[:3, 3]
        h = np.clip(local[:, 2], profile.h_min, profile.h_max)
        return paint(h, np.arctan2(local[:, 1], local[:, 0]))

    return _body(_creased(profile.mesh(facets=192)), T_world_object, color)


def cells_paint(grid: Manifold, colors: np.ndarray) -> SurfacePaint:
    """Return the paint that gives each cell its sRGB colour, with lines between the cells.

    Args:
        grid: the cells.
        colors: (k·H, k·A, 3), k times as fine as the cells.
    """
    fine = len(colors) // grid.heights

    def paint(h: Array, theta: Array) -> Array:
        row = (h - grid.profile.h_min) / grid.dh
        column = np.mod(theta - grid.theta_start, 2 * np.pi) / grid.dtheta
        i = np.minimum((fine * row).astype(int), len(colors) - 1)
        j = (fine * column).astype(int) % colors.shape[1]
        arc = np.maximum(grid.profile.radius(h) * grid.dtheta, 1e-9)
        width = LINE * np.minimum(grid.dh, arc)
        edge = np.minimum(_to_edge(row) * grid.dh, _to_edge(column) * arc)
        return np.where((edge < width / 2)[:, None], 0.72, 1.0) * colors[i, j]

    return paint


def with_seam(paint: SurfacePaint, profile: Profile) -> SurfacePaint:
    """Return a paint with a dark line along θ = 0, which shows how the object is turned."""

    def seamed(h: Array, theta: Array) -> Array:
        on_seam = np.abs(theta) * profile.radius(h) < SEAM / 2
        return np.where(on_seam[:, None], np.array(rgb(INK)) / 255, paint(h, theta))

    return seamed


def map_colors(m: FeasibilityMap, roll: int | None = None) -> np.ndarray:
    """Return the colours (H, A, 3) of a map: of one roll, or of the better of both."""
    reason = m.reason.max(axis=0) if roll is None else m.reason[roll]
    return REASONS[reason]


def floor(z: float) -> Body:
    """Return white paper at a height (m), on which only shadows are seen."""
    mesh = trimesh.creation.box(extents=(40, 40, 0.01))
    mesh.apply_translation((0, 0, z - 0.005))
    normals = np.repeat(mesh.face_normals[:, None], 3, axis=1)
    return Body(mesh.triangles, normals, np.ones(3), floor=True)


def _to_edge(cells: Array) -> Array:
    share = np.mod(cells, 1.0)
    return np.minimum(share, 1 - share)


def _creased(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.graph.smooth_shade(mesh, angle=CREASE)


def _body(mesh: trimesh.Trimesh, pose: Array, color: Array | Callable[[Array], Array]) -> Body:
    turn = pose[:3, :3].T
    corners = mesh.vertices[mesh.faces] @ turn + pose[:3, 3]
    return Body(corners, mesh.vertex_normals[mesh.faces] @ turn, color)
