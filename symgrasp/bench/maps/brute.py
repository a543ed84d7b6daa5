"""Brute force with Pinocchio and Coal: the candidates of a cell are checked in turn until one is free.

Needs the extra ``bench`` (``pip install 'symgrasp[bench]'``); importing this module fails without it.
"""

from __future__ import annotations

from typing import Any

import coal  # pyright: ignore[reportMissingImports]
import numpy as np
import pinocchio  # pyright: ignore[reportMissingImports]

from symgrasp.files import temporary_folder
from symgrasp.ik import Solver
from symgrasp.poses import Array, axis_frame
from symgrasp.robot.link_shapes import CollisionShape
from symgrasp.robot.robot import Arm
from symgrasp.world import BulletWorld, Shape, own_pairs
from symgrasp.world.urdf import collision_urdf

__all__ = ["BruteForce"]


class BruteForce:
    """Collision checks of an arm in Pinocchio and Coal: the robot moves, everything else is static.

    Uses the shapes and pairs that PyBullet has. In scenes with meshes it leaves out the rounding of the
    links, a millimetre or less, because Coal cannot measure distances of rounded shapes from triangles;
    `keep` makes up for that, at some cost.

    Args:
        world: a world of the scene.
        arm: the arm.
        ik: its inverse kinematics, the same as for the other methods.
        T_world_object: object pose (4, 4).
    """

    def __init__(self, world: BulletWorld, arm: Arm, ik: Solver, T_world_object: Array) -> None:
        self.arm, self.ik = arm, ik
        self._rounding = not any(
            shape.kind == "mesh" for o in world.scene.obstacles for _, shape in o.shapes()
        )
        robot = arm.robot
        with temporary_folder() as folder:
            self._model = pinocchio.buildModelFromXML(collision_urdf(robot.model, folder).decode())
        self._data = self._model.createData()
        self._left_out: dict[int, float] = {}  # of shapes, the rounding (m) that they lack
        self._geometry = pinocchio.GeometryModel()
        own = self._add_robot(world)
        static = self._add_static(world, T_world_object)
        self._add_pairs(world, own, static)
        self._geometry_data = self._geometry.createData()
        for request in self._geometry_data.collisionRequests:
            request.security_margin = 0.0
        self._joints = [j for j in robot.model.joints if j.source >= 0]

    def keep(self, distance: float) -> None:
        """Count what is closer than a distance (m) as touching, of links with their rounding."""
        requests, pairs = self._geometry_data.collisionRequests, self._geometry.collisionPairs
        for request, pair in zip(requests, pairs, strict=True):
            rounding = self._left_out.get(pair.first, 0.0) + self._left_out.get(pair.second, 0.0)
            request.security_margin = distance + rounding

    @property
    def pairs(self) -> int:
        """Number of pairs of shapes that each configuration is checked for."""
        return len(self._geometry.collisionPairs)

    def feasible(self, T_base_tool: Array, opening: float) -> bool:
        """Whether any candidate of a tool pose (4, 4) is inside the limits and free."""
        solutions = self.ik.solve(T_base_tool)
        return any(self.free(q, opening) for q in solutions.q[solutions.inside])

    def free(self, q: Array, opening: float) -> bool:
        """Whether the arm at joint values (n,) with its hand open by ``opening`` (m) touches nothing."""
        values = self.arm.robot_values(q, opening)
        configuration = pinocchio.neutral(self._model)
        for joint in self._joints:
            moved = self._model.joints[self._model.getJointId(joint.name)]
            value = joint.ratio * values[joint.source] + joint.offset
            if moved.nq == 2:  # Pinocchio stores a continuous joint as cosine and sine
                configuration[moved.idx_q : moved.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                configuration[moved.idx_q] = value
        return not pinocchio.computeCollisions(
            self._model, self._data, self._geometry, self._geometry_data, configuration, True
        )

    def _add(self, name: str, joint: int, pose: Array, shape: Any) -> int:
        placement = pinocchio.SE3(np.ascontiguousarray(pose[:3, :3]), pose[:3, 3].copy())
        return self._geometry.addGeometryObject(
            pinocchio.GeometryObject(f"{name} {self._geometry.ngeoms}", joint, placement, shape)
        )

    def _add_rounded(self, name: str, joint: int, pose: Array, shape: Shape) -> int:
        hull = _hull(shape.vertices)
        if self._rounding:
            hull.setSweptSphereRadius(float(shape.rounding))
        added = self._add(name, joint, pose, hull)
        if not self._rounding:
            self._left_out[added] = float(shape.rounding)
        return added

    def _add_robot(self, world: BulletWorld) -> dict[str, list[int]]:
        own: dict[str, list[int]] = {}
        for link, shapes in world.shapes(self.arm.robot.name).items():
            frame = self._model.frames[self._model.getFrameId(link)]
            own[link] = [
                self._add_rounded(link, frame.parentJoint, frame.placement.homogeneous, shape)
                for shape in shapes
            ]
        return own

    def _add_static(self, world: BulletWorld, T_world_object: Array) -> dict[str, list[int]]:
        """Add the object, the obstacles and the other robots, in the frame of the robot's base."""
        scene, robot = world.scene, self.arm.robot
        T_base_world = np.linalg.inv(robot.T_world_base)
        add = lambda name, pose, shape: self._add(name, 0, T_base_world @ pose, shape)  # noqa: E731
        add_rounded = lambda name, pose, shape: self._add_rounded(name, 0, T_base_world @ pose, shape)  # noqa: E731
        axis = axis_frame(T_world_object)
        static = {"object": [add("object", axis, _hull(v)) for v in scene.profile.convex_pieces()]}
        static["rest"] = [
            add(o.name, o.T_world_obstacle @ shape.pose, _exact(shape, f"obstacle {o.name}"))
            for o in scene.obstacles
            for _, shape in o.shapes()
        ]
        for name, other in scene.robots.items():
            if name != robot.name:
                links = other.T_world_base @ other.model.forward(other.home)
                static["rest"] += [
                    add_rounded(name, links[other.model.link_index(link)], shape)
                    for link, shapes in world.shapes(name).items()
                    for shape in shapes
                ]
        return static

    def _add_pairs(self, world: BulletWorld, own: dict[str, list[int]], static: dict[str, list[int]]) -> None:
        arm, scene_links = self.arm, set(own) - set(self.arm.robot.model.mount_links())
        links = own_pairs(world.scene, arm.robot.name)
        pairs = [(a, b) for x, y in links for a in own[x] for b in own[y]]
        pairs += [
            (a, b)
            for link in own
            if link not in arm.hand.touch_links
            for a in own[link]
            for b in static["object"]
        ]
        pairs += [(a, b) for link in scene_links for a in own[link] for b in static["rest"]]
        for a, b in pairs:
            self._geometry.addCollisionPair(pinocchio.CollisionPair(a, b))


def _exact(shape: CollisionShape, field: str) -> Any:
    """Return a shape of an obstacle as Coal has it."""
    if shape.kind == "box":
        return coal.Box(*shape.size)
    if shape.kind == "cylinder":
        return coal.Cylinder(*shape.size)
    if shape.kind == "sphere":
        return coal.Sphere(shape.size[0])
    mesh = shape.mesh(field)
    return _triangles(mesh.vertices, mesh.faces)


def _points(vertices: Array) -> Any:
    points = coal.StdVec_Vec3s()
    points.extend([np.array(v, dtype=float) for v in vertices])
    return points


def _hull(vertices: Array) -> Any:
    return coal.ConvexBase.convexHull(_points(vertices), True, "Qt")


def _triangles(vertices: Array, faces: np.ndarray) -> Any:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*map(int, face)) for face in faces])
    mesh.addSubModel(_points(vertices), triangles)
    mesh.endModel()
    return mesh
