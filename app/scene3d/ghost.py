"""The ghost arm: a candidate that fails, and the bodies that it hits. Read off the state, no browser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from symgrasp.meshes import read_mesh
from symgrasp.poses import Array
from symgrasp.reason import Reason
from symgrasp.robot.model import RobotModel
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName

from ..render.playback import playback_frame
from ..state.state import State

__all__ = ["Ghost", "body_mesh", "ghost", "link_mesh"]

SWELL = 0.0015
"""How much (m) larger what is hit is drawn, so that its red lies over its own surface."""


@dataclass(frozen=True, eq=False)
class Ghost:
    """A robot where it cannot be.

    Attributes:
        robot: its name.
        values: (n,) values of all its joints.
        hits: the bodies that are closer to each other than they may be, its own links among them.
    """

    robot: str
    values: Array
    hits: frozenset[BodyName]

    def links(self) -> frozenset[str]:
        """Return its own links that hit something."""
        return frozenset(body.link for body in self.hits if body.body == self.robot)

    def others(self) -> frozenset[BodyName]:
        """Return the other bodies that are hit."""
        return frozenset(body for body in self.hits if body.body != self.robot)


def ghost(state: State) -> Ghost | None:
    """Return the ghost to show: of the shown candidate of the picked cell, if that fails."""
    shown_candidate = state.shown_candidate
    if shown_candidate is None or state.explanation is None or shown_candidate.reason == Reason.FEASIBLE:
        return None
    if state.shown_task or playback_frame(state) or state.climb_step:  # the arms show something else
        return None
    arm = state.scene.arm(state.arm)
    hits = frozenset(body for c in shown_candidate.collisions for body in (c.a, c.b))
    return Ghost(arm.robot.name, arm.robot_values(shown_candidate.ended, state.explanation.opening), hits)


def link_mesh(model: RobotModel, link: str) -> trimesh.Trimesh:
    """Return the collision shapes of a link, in its frame: what the planner sees of it."""
    return _joined([trimesh.convex.convex_hull(points) for points in model.hulls(link)])


def body_mesh(scene: Scene, body: BodyName, T_world_object: Array) -> tuple[trimesh.Trimesh, Array]:
    """Return the shape of a body that is hit, a little swollen, and its pose (4, 4).

    Args:
        scene: the scene.
        body: an obstacle, the object, or a link of a robot that is parked.
        T_world_object: where the object is.
    """
    if body.body in scene.robots:
        robot = scene.robots[body.body]
        links = robot.model.forward(robot.home)
        pose = robot.T_world_base @ links[robot.model.link_index(body.link)]
        return _swollen(link_mesh(robot.model, body.link)), pose
    for obstacle in scene.obstacles:
        if obstacle.name == body.body:
            return _swollen(_obstacle_mesh(obstacle)), obstacle.T_world_obstacle
    return _swollen(scene.profile.mesh()), T_world_object


def _obstacle_mesh(o: Obstacle) -> trimesh.Trimesh:
    if o.kind == "box":
        return trimesh.creation.box(extents=o.size)
    if o.kind == "cylinder":
        return trimesh.creation.cylinder(radius=o.size[0], height=o.size[1], sections=48)
    if o.kind == "sphere":
        return trimesh.creation.icosphere(radius=o.size[0])
    assert o.path is not None
    if o.kind == "mesh":
        mesh = read_mesh(o.path, f"obstacle {o.name}")
        return trimesh.Trimesh(mesh.vertices, mesh.faces)
    model = RobotModel(o.path)
    poses = model.forward(model.default_values())
    parts = [
        link_mesh(model, link).apply_transform(poses[model.link_index(link)])
        for link in model.colliding_links()
    ]
    return _joined(parts)


def _joined(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return trimesh.Trimesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces), process=False)


def _swollen(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    normals = np.asarray(mesh.vertex_normals)
    return trimesh.Trimesh(mesh.vertices + SWELL * normals, mesh.faces, process=False)
