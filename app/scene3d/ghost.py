"""The ghost: the robot at a candidate that fails, with what collides, or at a cell that is pointed at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from symgrasp.meshes import joined
from symgrasp.poses import Array
from symgrasp.reason import Reason
from symgrasp.robot.link_shapes import shape_mesh
from symgrasp.robot.model import RobotModel
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName

from ..state.state import State

__all__ = ["Ghost", "body_mesh", "ghost", "link_mesh"]

INFLATION = 0.0015
"""Distance (m) by which meshes of colliding bodies are offset outwards, to hide the body's own surface."""


@dataclass(frozen=True, eq=False)
class Ghost:
    """A robot in a configuration that fails, or that is only previewed.

    Attributes:
        robot: its name.
        values: (n,) values of all its joints, in rad or m.
        hits: the bodies that collide or are too close, links of the robot itself among them.
    """

    robot: str
    values: Array
    hits: frozenset[BodyName]

    def links(self) -> frozenset[str]:
        """Return the names of the robot's own links that collide."""
        return frozenset(body.link for body in self.hits if body.body == self.robot)

    def others(self) -> frozenset[BodyName]:
        """Return the colliding bodies that are not links of the robot."""
        return frozenset(body for body in self.hits if body.body != self.robot)


def ghost(state: State) -> Ghost | None:
    """Return the ghost of the grasp that is pointed at, else of the candidate that is shown.

    None where that is feasible, and thus what the arm itself shows, or where the arms show something else.
    """
    return _preview(state) or _failing(state)


def _preview(state: State) -> Ghost | None:
    """Return the ghost of the feasible grasp that is pointed at, unless it is the picked one."""
    cell = state.map_view.hovered
    if cell is None or not state.is_current or state.result is None or cell == state.base_cell:
        return None
    grid = state.result.map.manifold
    if cell.row >= grid.heights or cell.column >= grid.angles:  # of an earlier map
        return None
    witness = state.result.map.witness(cell)
    if witness is None:
        return None
    arm = state.scene.arm(state.arm)
    return Ghost(arm.robot.name, arm.robot_values(witness.q, witness.opening), frozenset())


def _failing(state: State) -> Ghost | None:
    candidate = state.shown_candidate
    if candidate is None or state.explanation is None or candidate.reason == Reason.FEASIBLE:
        return None
    if state.shown_task or state.climb_step:  # the arms show something else
        return None
    arm = state.scene.arm(state.arm)
    hits = frozenset(body for c in candidate.collisions for body in (c.a, c.b))
    return Ghost(arm.robot.name, arm.robot_values(candidate.ended, state.explanation.opening), hits)


def link_mesh(model: RobotModel, link: str) -> trimesh.Trimesh:
    """Return the convex collision shapes of a link as one mesh, in the link frame."""
    return joined([trimesh.convex.convex_hull(points) for points in model.hulls(link)])


def body_mesh(scene: Scene, body: BodyName, T_world_object: Array) -> tuple[trimesh.Trimesh, Array]:
    """Return the mesh of a colliding body, offset outwards by `INFLATION`, and its pose (4, 4) in the world.

    Args:
        scene: the scene.
        body: an obstacle, the object, or a link of a robot at home.
        T_world_object: pose (4, 4) of the object.
    """
    if body.body in scene.robots:
        robot = scene.robots[body.body]
        links = robot.model.forward(robot.home)
        pose = robot.T_world_base @ links[robot.model.link_index(body.link)]
        return _inflated(link_mesh(robot.model, body.link)), pose
    for obstacle in scene.obstacles:
        if obstacle.name == body.body:
            return _inflated(_obstacle_mesh(obstacle, body)), obstacle.T_world_obstacle
    return _inflated(scene.profile.mesh()), T_world_object


def _obstacle_mesh(o: Obstacle, body: BodyName) -> trimesh.Trimesh:
    """Return the shapes of an obstacle, or of one link of it, in the obstacle's frame."""
    shapes = [shape for link, shape in o.shapes() if link == body.link]
    return joined([shape_mesh(shape, f"obstacle {body}") for shape in shapes])


def _inflated(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    normals = np.asarray(mesh.vertex_normals)
    return trimesh.Trimesh(mesh.vertices + INFLATION * normals, mesh.faces, process=False)
