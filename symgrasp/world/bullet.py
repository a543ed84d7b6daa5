"""All bodies of a scene in PyBullet, and the questions about them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Self

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from symgrasp.errors import MeshError, SceneError, SymgraspError
from symgrasp.meshes import depth_inside, read_mesh
from symgrasp.poses import Array, axis_frame
from symgrasp.reason import Reason
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.world.client import link_names, load_urdf, pybullet, xyzw
from symgrasp.world.collision import Body, Collision, NearBodies
from symgrasp.world.self_pairs import checked_self_pairs
from symgrasp.world.shapes import Shape, link_shapes

__all__ = ["BulletWorld"]

MOST_TRIANGLES = 60_000
"""More than this PyBullet does not take in one mesh."""


_KEPT_AT_A_DISTANCE = (Reason.SCENE_COLLISION, Reason.ROBOT_COLLISION)


class _Query(NamedTuple):
    """One closest-points call: all links of two bodies, or two links; ``key`` is what `Near` calls it."""

    reason: Reason
    key: str | frozenset[str]
    a: int
    b: int
    link_a: int | None = None
    link_b: int | None = None
    skip_a: frozenset[int] = frozenset()
    skip_b: frozenset[int] = frozenset()


class BulletWorld:
    """All bodies of a scene in one PyBullet DIRECT client of its own; use it in a ``with`` block.

    Robots start at home; the object starts at the first task.

    Args:
        scene: the scene.

    Raises:
        UrdfError: PyBullet could not use all shapes of a URDF.
        MeshError: an obstacle's mesh is unusable.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.margin = scene.settings.margin
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise SymgraspError("PyBullet has no free physics client; close worlds you no longer need")
        try:
            self._links: dict[int, tuple[str, ...]] = {}  # body → names of links -1, 0, 1, …
            self._names: dict[int, str] = {}
            self._robots = {r.name: self._load_robot(r) for r in scene.robots.values()}
            self._solids: list[tuple[str, trimesh.Trimesh]] = []  # closed meshes, in the world
            self._obstacles = [self._load_obstacle(o) for o in scene.obstacles]
            self._object = self._load_object()
            self._joints = {name: self._movable(name) for name in self._robots}
            self._values: dict[str, Array] = {}  # joint values of each robot, as set last
            self._queries = {arm.name: self._arm_queries(arm) for arm in scene.arms.values()}
            self._parked_queries = {name: self._parked(name) for name in self._robots}
            self.set_object(scene.task().T_world_object)
            for name in self._robots:
                self.park(name)
        except pybullet.error as error:
            self.close()
            raise SceneError(scene.source, "bodies", str(error), "shapes that PyBullet can make") from error
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the physics client; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    # -- building ---------------------------------------------------------------------------

    def _register(self, body: int, name: str, links: Sequence[str]) -> int:
        self._names[body] = name
        self._links[body] = tuple(links)
        for link in range(-1, len(links) - 1):
            pybullet.changeDynamics(body, link, collisionMargin=0.0, physicsClientId=self._client)
        return body

    def _load_urdf(self, model: RobotModel, name: str, pose: Array) -> int:
        body = load_urdf(self._client, model, pose)
        return self._register(body, name, link_names(self._client, body))

    def _load_robot(self, robot: Robot) -> int:
        return self._load_urdf(robot.model, robot.name, robot.T_world_base)

    def _load_obstacle(self, o: Obstacle) -> int:
        if o.kind == "urdf":
            assert o.model is not None
            return self._load_urdf(o.model, o.name, o.T_world_obstacle)
        client = self._client
        if o.kind == "box":
            half = [0.5 * s for s in o.size]
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
        elif o.kind == "cylinder":
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_CYLINDER, radius=o.size[0], height=o.size[1], physicsClientId=client
            )
        elif o.kind == "sphere":
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_SPHERE, radius=o.size[0], physicsClientId=client
            )
        else:
            shape = self._mesh_shape(o)
        return self._body(shape, o.name, o.T_world_obstacle)

    def _mesh_shape(self, o: Obstacle) -> int:
        """Keep the true surface: hollow meshes stay hollow.

        An arm inside a closed mesh would go unnoticed by its surface alone, but an arm hangs
        together and on its base, so some moving link crosses the surface. The object does not, so
        for closed meshes it is asked whether they hold its middle.
        """
        assert o.path is not None
        mesh = read_mesh(o.path, f"obstacle {o.name}")
        if len(mesh.faces) > MOST_TRIANGLES:
            expected = f"at most {MOST_TRIANGLES} triangles; simplify the mesh"
            raise MeshError(o.path, f"obstacle {o.name}", f"{len(mesh.faces)} triangles", expected)
        solid = mesh.copy()
        solid.merge_vertices()  # STL repeats every corner
        if solid.is_watertight:
            solid.apply_transform(o.T_world_obstacle)
            self._solids.append((o.name, solid))
        return pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=mesh.vertices.tolist(),
            indices=mesh.faces.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=self._client,
        )

    def _body(self, shape: int, name: str, pose: Array) -> int:
        if shape < 0:
            raise SymgraspError(f"PyBullet cannot make the shape of {name!r}")
        body = pybullet.createMultiBody(
            0.0,
            shape,
            basePosition=pose[:3, 3].tolist(),
            baseOrientation=xyzw(pose),
            physicsClientId=self._client,
        )
        return self._register(body, name, [""])

    def _load_object(self) -> list[int]:
        bodies = []
        for vertices in self.scene.profile.convex_pieces():
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=vertices.tolist(), physicsClientId=self._client
            )
            bodies.append(self._body(shape, self.scene.file.object.name, np.eye(4)))
        return bodies

    def _movable(self, robot: str) -> list[tuple[int, int, float, float]]:
        """Return (PyBullet joint, index into the robot's values, ratio, offset) of all moving joints."""
        index = {link: i - 1 for i, link in enumerate(self._links[self._robots[robot]])}
        model = self.scene.robots[robot].model
        return [
            (index[model.link_names[j.child]], j.source, j.ratio, j.offset)
            for j in model.joints
            if j.source >= 0
        ]

    def _arm_queries(self, arm: Arm) -> list[_Query]:
        """List what is checked for an arm, in the order of the reasons."""
        robot = arm.robot
        body = self._robots[robot.name]
        index = {link: i - 1 for i, link in enumerate(self._links[body])}
        mount = frozenset(index[link] for link in robot.model.mount_links())
        touch = frozenset(index[link] for link in arm.hand.touch_links)
        queries = [
            _Query(Reason.SELF_COLLISION, frozenset((a, b)), body, body, index[a], index[b])
            for a, b in checked_self_pairs(robot.model)
        ]
        queries += [self._query(Reason.OBJECT_COLLISION, body, p, skip_a=touch) for p in self._object]
        queries += [self._query(Reason.SCENE_COLLISION, body, o, skip_a=mount) for o in self._obstacles]
        others = [other for other in self._robots.values() if other != body]
        return queries + [self._query(Reason.ROBOT_COLLISION, body, other) for other in others]

    def _query(self, reason: Reason, a: int, b: int, skip_a: frozenset[int] = frozenset()) -> _Query:
        """Return the query for all links of two bodies."""
        return _Query(reason, self._names[b], a, b, skip_a=skip_a)

    def _parked(self, name: str) -> list[_Query]:
        """List what is checked for a robot that holds nothing: the object, and the other robots."""
        body = self._robots[name]
        queries = [self._query(Reason.OBJECT_COLLISION, body, piece) for piece in self._object]
        others = [other for other in self._robots.values() if other != body]
        return queries + [self._query(Reason.ROBOT_COLLISION, body, other) for other in others]

    # -- state ------------------------------------------------------------------------------

    def set_object(self, T_world_object: ArrayLike) -> None:
        """Place the object by its origin and axis; its spin about the axis does not matter."""
        pose = self._object_pose = axis_frame(T_world_object)
        for body in self._object:
            pybullet.resetBasePositionAndOrientation(
                body, pose[:3, 3].tolist(), xyzw(pose), physicsClientId=self._client
            )

    def set_arm(self, arm: Arm, q: ArrayLike, opening: float) -> None:
        """Put an arm at joint values (n,) with its hand open by ``opening`` (m), the robot's rest at home."""
        self._set(arm.robot.name, arm.robot_values(q, opening))

    def set_arms(self, configurations: Iterable[tuple[Arm, ArrayLike, float]]) -> None:
        """Put several arms at (arm, joint values, opening), and everything else at home."""
        values = {name: robot.home.copy() for name, robot in self.scene.robots.items()}
        for arm, q, opening in configurations:
            robot = values[arm.robot.name]
            moved = arm.robot_values(q, opening)
            changed = moved != arm.robot.home
            robot[changed] = moved[changed]
        for name, joints in values.items():
            self._set(name, joints)

    def park(self, robot: str) -> None:
        """Put a robot at home."""
        self._set(robot, self.scene.robots[robot].home)

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Leave robots, object and margin as they were before the ``with`` block."""
        values, pose, margin = dict(self._values), self._object_pose, self.margin
        try:
            yield
        finally:
            self.margin = margin
            self.set_object(pose)
            for robot, joints in values.items():
                self._set(robot, joints)

    def _set(self, robot: str, values: Array) -> None:
        self._values[robot] = values
        joints = self._joints[robot]
        pybullet.resetJointStatesMultiDof(
            self._robots[robot],
            [j for j, *_ in joints],
            [[ratio * float(values[source]) + offset] for _, source, ratio, offset in joints],
            physicsClientId=self._client,
        )

    def link_pose(self, robot: str, link: str) -> Array:
        """Return the pose (4, 4) of a robot's link in the world, as PyBullet has it."""
        body = self._robots[robot]
        index = self._links[body].index(link) - 1
        if index < 0:
            return self.scene.robots[robot].T_world_base
        state = pybullet.getLinkState(
            body, index, computeForwardKinematics=True, physicsClientId=self._client
        )
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(pybullet.getMatrixFromQuaternion(state[5]), (3, 3))
        pose[:3, 3] = state[4]
        return pose

    # -- shapes -----------------------------------------------------------------------------

    def shapes(self, name: str) -> dict[str, list[Shape]]:
        """Return the convex shapes of each link of a robot, or of an obstacle that is a URDF."""
        body = next(body for body, own in self._names.items() if own == name)
        links = enumerate(self._links[body], start=-1)
        return {link: shapes for index, link in links if (shapes := link_shapes(self._client, body, index))}

    # -- questions --------------------------------------------------------------------------

    def first_collision(self, arm: Arm, near: NearBodies | None = None) -> Collision | None:
        """Return the deepest collision of the first stage at which the arm collides, or None.

        Stages in order: with its own robot, the object, obstacles, other robots. Links that no
        joint moves are not checked against obstacles; the hand's touch links may touch the object.

        Args:
            arm: the arm.
            near: what could be in the way; everything if None.
        """
        stage: list[Collision] = []
        for query in self._queries[arm.name]:
            if near is not None and query.key not in near:
                continue
            if stage and query.reason != stage[0].reason:
                break
            stage += self._ask(query)
        return max(stage, key=lambda c: c.depth, default=None)

    def arm_collisions(self, arm: Arm) -> list[Collision]:
        """Return all collisions of an arm: by stage in the order of `first_collision`, then deepest first.

        Each pair of bodies comes once, so the first one is that of `first_collision`.
        """
        found = _deepest(c for query in self._queries[arm.name] for c in self._ask(query))
        return sorted(found, key=lambda c: c.reason)

    def collisions(self, arms: Sequence[Arm]) -> list[Collision]:
        """Return all collisions of several arms at once, deepest first.

        Of a robot with several arms, the touch links of all of them may touch the object. Robots
        without any of these arms are taken to be parked, and must be free of the object as well.
        """
        touch = {(a.robot.name, link) for a in arms for link in a.hand.touch_links}
        found = [
            c
            for arm in arms
            for query in self._queries[arm.name]
            for c in self._ask(query)
            if not (c.reason == Reason.OBJECT_COLLISION and c.a in touch)
        ]
        busy = {arm.robot.name for arm in arms}
        for name, queries in self._parked_queries.items():
            if name not in busy:
                found += [c for query in queries for c in self._ask(query)]
        return _deepest(found)

    def object_contacts(self, margin: float = 0.0) -> list[Collision]:
        """Return the obstacles that the object is inside of, or within ``margin`` (m) of, deepest first."""
        found = [
            c
            for piece in self._object
            for obstacle in self._obstacles
            for c in self._ask(self._query(Reason.SCENE_COLLISION, piece, obstacle), margin)
        ]
        found += self._engulfed()
        return sorted(found, key=lambda c: -c.depth)

    def object_in_robots(self, holders: Sequence[str]) -> list[Collision]:
        """Return the links of other robots than the ``holders`` that the object is inside of."""
        return [
            c._replace(a=c.b, b=c.a)
            for name, queries in self._parked_queries.items()
            if name not in holders
            for query in queries
            if query.reason == Reason.OBJECT_COLLISION
            for c in self._ask(query)
        ]

    def _engulfed(self) -> list[Collision]:
        """Return the closed meshes that hold the object's middle: their surface alone would not tell."""
        profile = self.scene.profile
        middle = self._object_pose @ [0.0, 0.0, 0.5 * (profile.h_min + profile.h_max), 1.0]
        found = []
        for name, mesh in self._solids:
            depth = depth_inside(mesh, middle[:3])
            if depth > 0:
                names = (Body(self.scene.file.object.name, ""), Body(name, ""))
                found.append(Collision(Reason.SCENE_COLLISION, *names, depth))
        return found

    def rests(self, T_world_object: ArrayLike) -> bool:
        """Whether the object stands on something at a pose: lowered by 3 mm, it would sink into it."""
        pose = np.array(T_world_object, dtype=float)
        self.set_object(pose)
        before = max((c.depth for c in self.object_contacts()), default=0.0)
        pose[2, 3] -= 0.003
        self.set_object(pose)
        after = max((c.depth for c in self.object_contacts()), default=0.0)
        self.set_object(T_world_object)
        return after > before + 0.0015

    def clearance(self, arm: Arm, limit: float) -> float:
        """Return the smallest distance (m) of all pairs that are checked for an arm, at most ``limit``."""
        return min((limit - c.depth for c in self.near(arm, limit)), default=limit)

    def near(self, arm: Arm, distance: float, among: NearBodies | None = None) -> list[Collision]:
        """Return the pairs checked for an arm that are closer than a distance (m), as if it were a margin.

        Args:
            arm: the arm.
            distance: how close.
            among: what is asked about; everything if None.
        """
        queries = (q for q in self._queries[arm.name] if among is None or q.key in among)
        return [c for query in queries for c in self._ask(query, distance)]

    def margin_for(self, reason: Reason) -> float:
        """Return the distance (m) that bodies must keep, by the kind of collision.

        A margin is kept from what the arm must not touch; the hand is close to the object by design,
        and some links are always close to each other.
        """
        return self.margin if reason in _KEPT_AT_A_DISTANCE else 0.0

    def _ask(self, query: _Query, margin: float | None = None) -> list[Collision]:
        if margin is None:
            margin = self.margin_for(query.reason)
        links = () if query.link_a is None else (query.link_a, query.link_b)
        points = pybullet.getClosestPoints(query.a, query.b, margin, *links, physicsClientId=self._client)
        return [
            Collision(
                query.reason, self._body_name(query.a, p[3]), self._body_name(query.b, p[4]), margin - p[8]
            )
            for p in points or ()
            if p[8] < margin and p[3] not in query.skip_a and p[4] not in query.skip_b
        ]

    def _body_name(self, body: int, link: int) -> Body:
        return Body(self._names[body], self._links[body][link + 1])


def _deepest(found: Iterable[Collision]) -> list[Collision]:
    """Return the deepest collision of each pair of bodies, deepest first."""
    deepest: dict[object, Collision] = {}
    for c in sorted(found, key=lambda c: -c.depth):
        deepest.setdefault((frozenset((c.a, c.b)), c.reason), c)
    return list(deepest.values())
