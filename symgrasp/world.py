"""Collisions in PyBullet: the only module that knows it.

Every question is put as "which links are closer than a distance", which Bullet answers from the
poses alone; its contact cache, which remembers earlier configurations, is not used. Collision
margins are set to zero, so distances are those of the shapes themselves.
"""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from symgrasp.errors import MeshError, SceneError, SymgraspError, UrdfError
from symgrasp.meshes import depth_inside, read_mesh
from symgrasp.poses import Array, axis_frame, from_position_quat, quat_wxyz, wxyz_to_xyzw, xyzw_to_wxyz
from symgrasp.reason import Reason
from symgrasp.robot import Arm, Robot
from symgrasp.robot_model import RobotModel
from symgrasp.scene import Scene
from symgrasp.scene_build import Obstacle


@contextmanager
def _silenced() -> Iterator[None]:
    """Send what C code prints, on either stream, to nowhere."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    saved = [(stream, os.dup(stream)) for stream in (1, 2)]
    try:
        with Path(os.devnull).open("w") as null:
            for stream, _ in saved:
                os.dup2(null.fileno(), stream)
        yield
    finally:
        flush(None)
        for stream, copy in saved:
            os.dup2(copy, stream)
            os.close(copy)


with _silenced():  # it prints its build time
    import pybullet

__all__ = ["Body", "BulletWorld", "Collision", "Near", "Shape", "check_tasks", "checked_self_pairs"]

RESTING_DEPTH = 1e-3
"""How deep (m) an object may sink into what it stands on and still count as resting."""

MOST_TRIANGLES = 60_000
"""More than this PyBullet does not take in one mesh."""

SELF_SAMPLES = 2000
"""Random configurations that tell which links of a robot always or never collide."""

NEVER_GAP = 0.02
"""Links that come closer than this (m) in some sample are always checked, collided or not."""

WALL_GAP = 0.5
"""Distance (m) from which the rounding of a link is measured."""

LINK_MARGIN = 1e-3
"""Bullet rounds the shapes of links by this (m); what is set for a compound does not reach its parts."""


class Body(NamedTuple):
    """A link of a robot, or a whole obstacle or object (with an empty or inner link name)."""

    body: str
    link: str

    def __str__(self) -> str:
        return f"{self.body}/{self.link}" if self.link else self.body


class Collision(NamedTuple):
    """Two bodies that are closer than they may be.

    Attributes:
        reason: the kind of collision, seen from the arm.
        a: the link of the robot.
        b: what it hits.
        depth: how much closer (m) than allowed; the penetration where the margin is zero.
    """

    reason: Reason
    a: Body
    b: Body
    depth: float


class Shape(NamedTuple):
    """A convex collision shape as PyBullet has it: a hull, blown up by a ball.

    Attributes:
        vertices: (n, 3) corners of the hull in the link frame.
        rounding: radius (m) of the ball.
        slack: by how much (m) the true shape may fall short of this one; inf where the parts of a
            link cannot be told apart and this is the hull of them all.
    """

    vertices: Array
    rounding: float
    slack: float


Near = Collection[str | frozenset[str]]
"""What could be in the way of an arm: bodies by their names, and pairs of the robot's own links."""

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
        body = _load_urdf(self._client, model, pose)
        joints = range(pybullet.getNumJoints(body, self._client))
        infos = [pybullet.getJointInfo(body, j, self._client) for j in joints]
        links = [pybullet.getBodyInfo(body, self._client)[0].decode(), *(i[12].decode() for i in infos)]
        return self._register(body, name, links)

    def _load_robot(self, robot: Robot) -> int:
        return self._load_urdf(robot.model, robot.name, robot.T_world_base)

    def _load_obstacle(self, o: Obstacle) -> int:
        if o.kind == "urdf":
            assert o.path is not None
            return self._load_urdf(RobotModel(o.path), o.name, o.T_world_obstacle)
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
            baseOrientation=_xyzw(pose),
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
                body, pose[:3, 3].tolist(), _xyzw(pose), physicsClientId=self._client
            )

    def set_arm(self, arm: Arm, q: ArrayLike, opening: float) -> None:
        """Put an arm at joint values (n,) with its hand open by ``opening`` (m), the robot's rest at home."""
        self._set(arm.robot.name, arm.robot_values(q, opening))

    def set_arms(self, postures: Iterable[tuple[Arm, ArrayLike, float]]) -> None:
        """Put several arms at (arm, joint values, opening), and everything else at home."""
        values = {name: robot.home.copy() for name, robot in self.scene.robots.items()}
        for arm, q, opening in postures:
            robot = values[arm.robot.name]
            moved = arm.robot_values(q, opening)
            changed = moved != arm.robot.home
            robot[changed] = moved[changed]
        for name, joints in values.items():
            self._set(name, joints)

    def park(self, robot: str) -> None:
        """Put a robot at home."""
        self._set(robot, self.scene.robots[robot].home)

    def set_robot(self, robot: str, values: ArrayLike) -> None:
        """Put all joints (n,) of a robot, in the order of its model's ``joint_names``."""
        self._set(robot, np.array(values, dtype=float))

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
        return {link: shapes for index, link in links if (shapes := self._link_shapes(body, index))}

    def _link_shapes(self, body: int, link: int) -> list[Shape]:
        data = pybullet.getCollisionShapeData(body, link, physicsClientId=self._client)
        if not data:
            return []
        info = pybullet.getDynamicsInfo(body, link, physicsClientId=self._client)
        centre = _pose(info[3], info[4])  # Bullet's link frames sit at the centres of mass
        shapes = [_primitive(kind, size, centre @ _pose(at, turn)) for _, _, kind, size, _, at, turn in data]
        if any(shapes):
            hulls = [self._mesh(body, link, k) for k, shape in enumerate(shapes) if shape is None]
            rounding, slack = LINK_MARGIN, LINK_MARGIN
        else:
            hulls, every = [self._mesh(body, link, k) for k in range(len(data))], self._mesh(body, link, -1)
            apart = len(every) == sum(map(len, hulls))
            hulls = hulls if apart else [every]
            rounding, slack = self._rounding(body, link, every), 0.0 if apart else np.inf
        hulled = [Shape(v @ centre[:3, :3].T + centre[:3, 3], rounding, slack) for v in hulls if len(v)]
        return [shape for shape in shapes if shape] + hulled

    def _mesh(self, body: int, link: int, index: int) -> Array:
        _, vertices = pybullet.getMeshData(
            body, link, collisionShapeIndex=index, physicsClientId=self._client
        )
        return np.reshape(np.array(vertices, dtype=float), (-1, 3))

    def _rounding(self, body: int, link: int, vertices: Array) -> float:
        """Measure by how much Bullet blows up the hull of vertices: against a wall above the link."""
        client = self._client
        if link < 0:
            position, orientation = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        else:
            position, orientation = pybullet.getLinkState(
                body, link, computeForwardKinematics=True, physicsClientId=client
            )[:2]
        pose = _pose(position, orientation)
        top = (vertices @ pose[2, :3]).max() + pose[2, 3]
        half = 2.0
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[half] * 3, physicsClientId=client
        )
        above = [pose[0, 3], pose[1, 3], top + WALL_GAP + half]
        wall = pybullet.createMultiBody(0.0, shape, basePosition=above, physicsClientId=client)
        pybullet.changeDynamics(wall, -1, collisionMargin=0.0, physicsClientId=client)
        found = pybullet.getClosestPoints(body, wall, 1.0, link, -1, physicsClientId=client)
        pybullet.removeBody(wall, physicsClientId=client)
        return max(0.0, float(WALL_GAP - min(p[8] for p in found)))

    # -- questions --------------------------------------------------------------------------

    def first_collision(self, arm: Arm, near: Near | None = None) -> Collision | None:
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

    def near(self, arm: Arm, distance: float, among: Near | None = None) -> list[Collision]:
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


def check_tasks(scene: Scene) -> None:
    """Check that the object is clear of all obstacles in every task; resting contact is fine.

    Raises:
        SceneError: it is not; names both bodies and the depth.
    """
    with BulletWorld(scene) as world:
        for i, task in enumerate(scene.tasks.values()):
            world.set_object(task.T_world_object)
            holders = [scene.arm(name).robot.name for name in task.arms]
            contacts = [*world.object_contacts(), *world.object_in_robots(holders)]
            for c in sorted(contacts, key=lambda c: -c.depth)[:1]:
                if c.depth > RESTING_DEPTH:
                    raise SceneError(
                        scene.source,
                        f"tasks[{i}].pose",
                        task.name,
                        f"a pose outside of every other body; {c.a} is {1e3 * c.depth:.1f} mm inside {c.b}",
                    )


def _deepest(found: Iterable[Collision]) -> list[Collision]:
    """Return the deepest collision of each pair of bodies, deepest first."""
    deepest: dict[object, Collision] = {}
    for c in sorted(found, key=lambda c: -c.depth):
        deepest.setdefault((frozenset((c.a, c.b)), c.reason), c)
    return list(deepest.values())


def _pose(position: Sequence[float], xyzw: Sequence[float]) -> Array:
    return from_position_quat(position, xyzw_to_wxyz(xyzw))


def _primitive(kind: int, size: Sequence[float], pose: Array) -> Shape | None:
    """Return the shape of a box, ball or capsule, and None for a hull."""
    if kind == pybullet.GEOM_BOX:
        # Rounded inwards: edges and corners fall short of the box by less than their diagonal.
        corners, rounding, slack = np.array(list(np.ndindex(2, 2, 2))) - 0.5, 0.0, LINK_MARGIN
        corners = corners * size
    elif kind == pybullet.GEOM_SPHERE:
        corners, rounding, slack = np.zeros((1, 3)), float(size[0]), 0.0
    elif kind == pybullet.GEOM_CAPSULE:
        corners, rounding, slack = np.array([[0, 0, -0.5 * size[0]], [0, 0, 0.5 * size[0]]]), size[1], 0.0
    else:
        return None
    return Shape(corners @ pose[:3, :3].T + pose[:3, 3], rounding, slack)


def _xyzw(pose: Array) -> list[float]:
    return wxyz_to_xyzw(quat_wxyz(pose)).tolist()


def _load_urdf(client: int, model: RobotModel, pose: Array) -> int:
    """Load the collision shapes of a URDF, and see that every one of them arrived."""
    with tempfile.NamedTemporaryFile(suffix=".urdf") as file:
        file.write(model.collision_urdf())
        file.flush()
        try:
            body = pybullet.loadURDF(
                file.name,
                basePosition=pose[:3, 3].tolist(),
                baseOrientation=_xyzw(pose),
                useFixedBase=True,
                physicsClientId=client,
            )
        except pybullet.error as error:
            raise UrdfError(model.path, "urdf", str(error), "a URDF that PyBullet can load") from error
    for i, link in enumerate(_link_names(client, body)):
        shapes = pybullet.getCollisionShapeData(body, i - 1, physicsClientId=client)
        if model.has_shape(link) and not shapes:
            raise UrdfError(model.path, f"link {link}: collision", None, "a shape that PyBullet can load")
    return body


def _link_names(client: int, body: int) -> list[str]:
    joints = range(pybullet.getNumJoints(body, client))
    base = pybullet.getBodyInfo(body, client)[0].decode()
    return [base, *(pybullet.getJointInfo(body, j, client)[12].decode() for j in joints)]


@lru_cache(maxsize=32)
def checked_self_pairs(model: RobotModel) -> tuple[tuple[str, str], ...]:
    """Return the pairs of a robot's links that can collide, but need not.

    Left out are neighbours, pairs that overlap in every one of many random configurations (a
    flange and the hand on it), and pairs that stay well apart in all of them.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = _load_urdf(client, model, np.eye(4))
        index = {link: i - 1 for i, link in enumerate(_link_names(client, body))}
        for link in index.values():
            pybullet.changeDynamics(body, link, collisionMargin=0.0, physicsClientId=client)
        solid = model.colliding_links()
        neighbours = model.neighbours()
        pairs = [
            (a, b) for i, a in enumerate(solid) for b in solid[i + 1 :] if frozenset((a, b)) not in neighbours
        ]
        moving = [(index[model.link_names[j.child]], j) for j in model.joints if j.source >= 0]
        lower = np.where(np.isfinite(model.lower), model.lower, -np.pi)
        upper = np.where(np.isfinite(model.upper), model.upper, np.pi)
        samples = np.random.default_rng(0).uniform(lower, upper, (SELF_SAMPLES, len(lower)))
        always = dict.fromkeys(pairs, True)
        near = dict.fromkeys(pairs, False)
        for q in samples:
            pybullet.resetJointStatesMultiDof(
                body,
                [j for j, _ in moving],
                [[j.ratio * q[j.source] + j.offset] for _, j in moving],
                physicsClientId=client,
            )
            for a, b in pairs:
                if near[a, b] and not always[a, b]:
                    continue
                points = pybullet.getClosestPoints(
                    body, body, NEVER_GAP, index[a], index[b], physicsClientId=client
                )
                near[a, b] |= bool(points)
                always[a, b] &= any(p[8] < 0 for p in points)
        return tuple(pair for pair in pairs if near[pair] and not always[pair])
    finally:
        pybullet.disconnect(client)
