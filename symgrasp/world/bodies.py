"""Loading the bodies of a scene into a PyBullet client: robots, obstacles and the object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symgrasp.errors import MeshError, SymgraspError, referred_to
from symgrasp.meshes.flat_faces import few_triangles
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.robot.link_shapes import CollisionShape
from symgrasp.robot.model import RobotModel
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.world.client import link_names, load_urdf, pybullet, xyzw
from symgrasp.world.collision import BodyName

if TYPE_CHECKING:
    import trimesh

__all__ = ["MovableJoint", "SceneBodies"]

MOST_TRIANGLES, MOST_VERTICES = 60_000, 130_000
"""PyBullet does not accept more triangles or vertices than this in one mesh."""


class MovableJoint(NamedTuple):
    """A joint of a robot in PyBullet; its value is ``ratio · values[source] + offset``.

    Attributes:
        joint: PyBullet's index of the joint.
        source: index into the joint values of the robot's model.
        ratio: 1 unless the joint mimics another.
        offset: 0 unless the joint mimics another.
    """

    joint: int
    source: int
    ratio: float
    offset: float


class SceneBodies:
    """The bodies of a scene in a PyBullet client.

    Obstacles and the object have no collision margin. Links keep the one around their hulls, see
    `symgrasp.world.shapes.MARGIN`: it covers what PyBullet rounds off when it makes a hull.

    Args:
        client: PyBullet's id of the physics client to load them into.
        scene: the scene.
        progress: called with 0 after every link, robot and shape; may raise `Cancelled`.

    Raises:
        UrdfError: PyBullet could not use all shapes of a URDF.
        MeshError: an obstacle's mesh is unusable.
        SymgraspError: PyBullet cannot make a shape.

    Attributes:
        client: PyBullet's id of the physics client.
        links: body id → names of its links -1, 0, 1, … in PyBullet's order.
        names: body id → name in the scene.
        robots: name → body id.
        joints: name of a robot → its movable joints.
        obstacles: body ids of the obstacles, one for each of their shapes.
        object: body ids of the object's convex pieces.
        closed_meshes: (name, mesh in world coordinates) of every closed mesh of an obstacle.
    """

    def __init__(self, client: int, scene: Scene, progress: Progress | None = None) -> None:
        self.client, self._progress = client, progress
        self.links: dict[int, tuple[str, ...]] = {}
        self.names: dict[int, str] = {}
        self.robots = {
            r.name: self._load_urdf(r.model, r.name, r.T_world_base) for r in scene.robots.values()
        }
        self.joints = {name: self._movable_joints(name, robot.model) for name, robot in scene.robots.items()}
        self.closed_meshes: list[tuple[BodyName, trimesh.Trimesh]] = []
        self.obstacles = [
            self._load_shape(o, link, shape) for o in scene.obstacles for link, shape in o.shapes()
        ]
        self.object = self._load_object(scene)

    def body_name(self, body: int, link: int) -> BodyName:
        """Return the name of a link, given PyBullet's body id and link index (-1 for the base)."""
        return BodyName(self.names[body], self.links[body][link + 1])

    def link_indices(self, robot: str) -> dict[str, int]:
        """Return link name → PyBullet's link index (-1 for the base) of a robot.

        It has those that have shapes, or carry some through a joint.
        """
        return {link: i - 1 for i, link in enumerate(self.links[self.robots[robot]])}

    def _register(self, body: int, name: str, links: Sequence[str]) -> int:
        self.names[body] = name
        self.links[body] = tuple(links)
        if self._progress:
            self._progress(0.0)
        return body

    def _load_urdf(self, model: RobotModel, name: str, pose: Array) -> int:
        for link in model.colliding_links():
            model.hulls(link)  # which are made now, once for every mesh on a machine
            if self._progress:
                self._progress(0.0)
        body = load_urdf(self.client, model, pose)
        return self._register(body, name, link_names(self.client, body))

    def _movable_joints(self, name: str, model: RobotModel) -> list[MovableJoint]:
        index = self.link_indices(name)  # PyBullet gives a joint the index of its child link
        return [
            MovableJoint(index[model.link_names[j.child]], j.source, j.ratio, j.offset)
            for j in model.joints
            if j.source >= 0 and model.link_names[j.child] in index
        ]

    def _load_shape(self, o: Obstacle, link: str, shape: CollisionShape) -> int:
        """Load a shape of an obstacle as a body of its own."""
        client, pose = self.client, o.T_world_obstacle @ shape.pose
        if shape.kind == "box":
            half = [0.5 * s for s in shape.size]
            made = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
        elif shape.kind == "cylinder":
            radius, height = shape.size
            made = pybullet.createCollisionShape(
                pybullet.GEOM_CYLINDER, radius=radius, height=height, physicsClientId=client
            )
        elif shape.kind == "sphere":
            made = pybullet.createCollisionShape(
                pybullet.GEOM_SPHERE, radius=shape.size[0], physicsClientId=client
            )
        else:
            made = self._mesh_shape(o, link, shape, pose)
        return self._create_body(made, BodyName(o.name, link), pose)

    def _mesh_shape(self, o: Obstacle, link: str, shape: CollisionShape, pose: Array) -> int:
        """Create the collision shape of a mesh from its surface, not its convex hull: hollows stay hollow.

        PyBullet takes longer the more triangles there are, so flat parts have as few as they need.

        Distances to a surface do not tell that something lies inside it. For an arm this does not
        matter, because its links form a chain from its base outwards, and one of them crosses the surface.
        For the object it does, so closed meshes are kept in `closed_meshes`.
        """
        mesh = o.mesh(link, shape)
        mesh.merge_vertices()  # STL repeats every corner
        if len(mesh.faces) > MOST_TRIANGLES or len(mesh.vertices) > MOST_VERTICES:
            value = f"{len(mesh.faces)} triangles between {len(mesh.vertices)} vertices"
            expected = f"at most {MOST_TRIANGLES} between {MOST_VERTICES}; simplify the mesh"
            with referred_to(*o.reference):
                raise MeshError(shape.path, f"link {link}" if link else "mesh", value, expected)
        if mesh.is_watertight:
            self.closed_meshes.append((BodyName(o.name, link), mesh.copy().apply_transform(pose)))
        vertices, triangles = few_triangles(mesh)
        return pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=triangles.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=self.client,
        )

    def _create_body(self, shape: int, name: BodyName, pose: Array) -> int:
        if shape < 0:
            raise SymgraspError(f"PyBullet cannot make the shape of {name}")
        body = pybullet.createMultiBody(
            0.0,
            shape,
            basePosition=pose[:3, 3].tolist(),
            baseOrientation=xyzw(pose),
            physicsClientId=self.client,
        )
        pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=self.client)
        return self._register(body, name.body, [name.link])

    def _load_object(self, scene: Scene) -> list[int]:
        bodies = []
        for vertices in scene.profile.convex_pieces():
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=vertices.tolist(), physicsClientId=self.client
            )
            bodies.append(self._create_body(shape, BodyName(scene.file.object.name, ""), np.eye(4)))
        return bodies
