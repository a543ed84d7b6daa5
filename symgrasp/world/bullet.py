"""A scene in PyBullet: placing its robots and its object, and asking for collisions and distances."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import SceneError, SymgraspError
from symgrasp.meshes import depth_inside
from symgrasp.poses import Array, axis_frame, translation
from symgrasp.progress import Progress, at_start
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world.bodies import SceneBodies
from symgrasp.world.client import pybullet, xyzw
from symgrasp.world.collision import BodyName, Collision, NearBodies
from symgrasp.world.hand_pairs import own_pairs
from symgrasp.world.queries import Query, arm_queries, body_query, outer_queries, parked_queries
from symgrasp.world.self_pairs import checked_self_pairs
from symgrasp.world.shapes import Shape, link_shapes

__all__ = ["BulletWorld"]

LOWERED = 0.003
"""Distance (m) by which the object is lowered to find out whether something supports it."""

SUPPORTED_DEPTH = 0.0015
"""The object is supported when lowering it by `LOWERED` makes it sink deeper by more than this (m)."""

NORMAL_STEP = 1e-3
"""Distance (m) by which the object is moved to and fro to find in which direction it leaves an obstacle."""

MARGIN_REASONS = (Reason.SCENE_COLLISION, Reason.ROBOT_COLLISION)
"""Kinds of collision for which the scene's margin is a distance to keep."""


class BulletWorld:
    """All bodies of a scene in a PyBullet DIRECT client of their own; use it in a ``with`` block.

    Robots start at home; the object starts at the pose of the first task.

    Args:
        scene: the scene.
        progress: called with 0 after every body and arm, and while pairs of links are sampled; may raise
            `Cancelled`.

    Raises:
        UrdfError: PyBullet could not use all shapes of a URDF.
        MeshError: an obstacle's mesh is unusable.
        SceneError: PyBullet cannot make another shape.
        SymgraspError: PyBullet has no free physics client.

    Attributes:
        scene: the scene.
        margin: distance (m) to keep from obstacles and other robots; the scene's at first.
        bodies: the bodies in PyBullet.
    """

    def __init__(self, scene: Scene, progress: Progress | None = None) -> None:
        self.scene = scene
        self.margin = scene.settings.margin
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise SymgraspError("PyBullet has no free physics client; close worlds you no longer need")
        try:
            self.bodies = SceneBodies(self._client, scene, progress)
            self._values: dict[str, Array] = {}  # joint values of each robot, as set last
            self._queries: dict[str, list[Query]] = {}
            for robot in scene.robots.values():  # once for every robot on a machine, which takes a second
                checked_self_pairs(robot.model, at_start(progress))
            for arm in scene.arms.values():
                self._queries[arm.name] = arm_queries(self.bodies, scene, arm)
                if progress:
                    progress(0.0)
            tell = at_start(progress) or (lambda _: None)
            self._parked_queries = {name: parked_queries(self.bodies, name) for name in scene.robots}
            self._outer_queries = outer_queries(self.bodies, scene)
            tell(0.0)
            self.set_object(scene.task().T_world_object)
            for name in scene.robots:
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

    # -- state ------------------------------------------------------------------------------

    def set_object(self, T_world_object: ArrayLike) -> None:
        """Place the object at a pose (4, 4), of which only origin and z axis count: it is symmetric."""
        pose = self._object_pose = axis_frame(T_world_object)
        for body in self.bodies.object:
            pybullet.resetBasePositionAndOrientation(
                body, pose[:3, 3].tolist(), xyzw(pose), physicsClientId=self._client
            )

    @property
    def object_pose(self) -> Array:
        """Pose (4, 4) of the object, with no turn about its axis."""
        return self._object_pose

    def set_arm(self, arm: Arm, q: ArrayLike, opening: float) -> None:
        """Set an arm to q (n,), its hand to an opening (m), and its robot's other joints to home."""
        self._set(arm.robot.name, arm.robot_values(q, opening))

    def set_arms(self, configurations: Iterable[tuple[Arm, ArrayLike, float]]) -> None:
        """Set several arms to (arm, joint values (n,), opening (m)), and all other joints to home."""
        values = {name: robot.home.copy() for name, robot in self.scene.robots.items()}
        for arm, q, opening in configurations:
            robot = values[arm.robot.name]
            moved = arm.robot_values(q, opening)
            changed = moved != self.scene.robots[arm.robot.name].home
            robot[changed] = moved[changed]
        for name, joints in values.items():
            self._set(name, joints)

    def park(self, robot: str) -> None:
        """Set all joints of a robot, given by name, to home."""
        self._set(robot, self.scene.robots[robot].home)

    def set_robot(self, robot: str, values: Array) -> None:
        """Set all joints of a robot, given by name, to values (N,) of its model's joints."""
        self._set(robot, values)

    @contextmanager
    def preserving_state(self) -> Iterator[None]:
        """Restore robots, object and margin at the end of the ``with`` block."""
        values, pose, margin = dict(self._values), self._object_pose, self.margin
        try:
            yield
        finally:
            self.margin = margin
            self.set_object(pose)
            for robot, joints in values.items():
                self._set(robot, joints)

    def _set(self, robot: str, values: Array) -> None:
        before, self._values[robot] = self._values.get(robot), values.copy()
        joints = self.bodies.joints[robot]
        if before is not None:  # PyBullet takes its time for each
            joints = [j for j in joints if values[j.source] != before[j.source]]
            if not joints:
                return
        pybullet.resetJointStatesMultiDof(
            self.bodies.robots[robot],
            [j.joint for j in joints],
            [[j.ratio * float(values[j.source]) + j.offset] for j in joints],
            physicsClientId=self._client,
        )

    # -- shapes -----------------------------------------------------------------------------

    def shapes(self, name: str) -> dict[str, list[Shape]]:
        """Return the convex shapes of each link of a robot."""
        body = self.bodies.robots[name]
        links = enumerate(self.bodies.links[body], start=-1)
        return {link: shapes for index, link in links if (shapes := link_shapes(self._client, body, index))}

    # -- collisions and distances ------------------------------------------------------------

    def first_collision(
        self, arm: Arm, among: NearBodies | None = None, links: Collection[str] | None = None
    ) -> Collision | None:
        """Return the deepest collision of the first stage at which the arm collides, or None.

        The stages, in the order of `Reason`: its own robot, the object, the obstacles, other robots.
        Links that no joint moves are not checked against obstacles; the hand's touch links may touch
        the object.

        Args:
            arm: the arm.
            among: what to check against; everything if None.
            links: links of the arm's robot to check against other bodies; all of them if None.
        """
        index = self.bodies.link_indices(arm.robot.name)
        stage: list[Collision] = []
        for query in self._queries[arm.name]:
            if among is not None and query.key not in among:
                continue
            if stage and query.reason != stage[0].reason:
                break
            if links is None or query.link_a is not None:
                stage += self._collisions(query)
            else:  # PyBullet measures all links otherwise, however far they are
                for link in links:
                    stage += self._collisions(query._replace(link_a=index[link]))
        return max(stage, key=lambda c: c.depth, default=None)

    def arm_collisions(self, arm: Arm, among: NearBodies | None = None) -> list[Collision]:
        """Return all collisions of an arm, by stage in the order of `first_collision`, then deepest first.

        Each pair of bodies appears once; the first entry is what `first_collision` returns.

        Args:
            arm: the arm.
            among: what to check against; everything if None.
        """
        queries = (q for q in self._queries[arm.name] if among is None or q.key in among)
        found = _deepest(c for query in queries for c in self._collisions(query))
        return sorted(found, key=lambda c: c.reason)

    def collisions(self, arms: Sequence[Arm]) -> list[Collision]:
        """Return all collisions of several arms at once, deepest first.

        The touch links of all these arms may touch the object, also where a robot has several. Robots with
        none of these arms are checked as parked: against the object and other robots.
        """
        touch = _touch_links(arms)
        found = [
            c
            for arm in arms
            for query in self._queries[arm.name]
            for c in self._collisions(query)
            if not _touches(c, touch)
        ]
        grasping = {arm.robot.name for arm in arms}
        for name, queries in self._parked_queries.items():
            if name not in grasping:
                found += [c for query in queries for c in self._collisions(query)]
        return _deepest(found)

    def robot_collides(self, robot: str, arms: Sequence[Arm]) -> bool:
        """Whether a robot collides with itself, the object or an obstacle.

        Together with `robots_meet` for all pairs of robots, this says whether there are any `collisions`.

        Args:
            robot: its name; where none of the arms is its own, it is parked.
            arms: all arms that hold the object, whose touch links may touch it.
        """
        touch = _touch_links(arms)
        own = [query for arm in arms if arm.robot.name == robot for query in self._queries[arm.name]]
        return any(
            not _touches(c, touch)
            for query in own or self._parked_queries[robot]
            if query.reason != Reason.ROBOT_COLLISION
            for c in self._collisions(query)
        )

    def robots_meet(self, a: str, b: str) -> bool:
        """Whether two robots, given by name, collide with each other, measured from either."""
        return any(
            self._collisions(query)
            for name, other in ((a, b), (b, a))
            for query in self._parked_queries[name]
            if query.reason == Reason.ROBOT_COLLISION and query.key == other
        )

    def object_contacts(self, margin: float = 0.0) -> list[Collision]:
        """Return the obstacles that the object is inside of, or within a margin (m) of, deepest first."""
        found = [
            c
            for piece in self.bodies.object
            for obstacle in self.bodies.obstacles
            for c in self._collisions(
                body_query(self.bodies, Reason.SCENE_COLLISION, piece, obstacle), margin
            )
        ]
        found += self._closed_meshes_around_object()
        return sorted(found, key=lambda c: -c.depth)

    def object_normals(self, margin: float) -> dict[BodyName, Array]:
        """Return obstacle → unit vector (3,) out of it to the object, of those within a margin (m) of it.

        It is the gradient of their distance, by differences: the normal that PyBullet itself states is
        meaningless where two bodies touch.
        """
        pose, reach = self._object_pose, margin + NORMAL_STEP
        near = self._object_distances(margin)
        gradient = {name: np.zeros(3) for name in near}
        for k, sign in itertools.product(range(3), (1, -1)):
            self.set_object(translation(sign * NORMAL_STEP * np.eye(3)[k]) @ pose)
            distances = self._object_distances(reach)
            for name, total in gradient.items():
                total[k] += sign * distances.get(name, reach)
        self.set_object(pose)
        return {name: total / max(float(np.linalg.norm(total)), 1e-9) for name, total in gradient.items()}

    def _object_distances(self, margin: float) -> dict[BodyName, float]:
        """Return obstacle → its signed distance (m) from the object, of those within a margin (m) of it."""
        found: dict[BodyName, float] = {}
        for piece in self.bodies.object:
            for obstacle in self.bodies.obstacles:
                points = pybullet.getClosestPoints(piece, obstacle, margin, physicsClientId=self._client)
                for p in points or ():  # 4 is the link of the obstacle, 8 the distance
                    name = self.bodies.body_name(obstacle, p[4])
                    found[name] = min(found.get(name, margin), p[8])
        return found

    def object_in_robots(self, holders: Sequence[str]) -> list[Collision]:
        """Return the links that the object is inside of, of all robots but those named as holders."""
        return [
            c._replace(a=c.b, b=c.a)
            for name, queries in self._parked_queries.items()
            if name not in holders
            for query in queries
            if query.reason == Reason.OBJECT_COLLISION
            for c in self._collisions(query)
        ]

    def _closed_meshes_around_object(self) -> list[Collision]:
        """Return the closed meshes around the middle of the object: PyBullet has their surfaces only."""
        profile = self.scene.profile
        middle = self._object_pose @ [0.0, 0.0, 0.5 * (profile.h_min + profile.h_max), 1.0]
        found = []
        for name, mesh in self.bodies.closed_meshes:
            depth = depth_inside(mesh, middle[:3])
            if depth > 0:
                thing = BodyName(self.scene.file.object.name, "")
                found.append(Collision(Reason.SCENE_COLLISION, thing, name, depth))
        return found

    def object_rests(self, T_world_object: ArrayLike) -> bool:
        """Whether an obstacle supports the object at a pose (4, 4): lowered a little, it would sink into it.

        The object stays at that pose.
        """
        pose = np.array(T_world_object, dtype=float)
        self.set_object(pose)
        before = max((c.depth for c in self.object_contacts()), default=0.0)
        pose[2, 3] -= LOWERED
        self.set_object(pose)
        after = max((c.depth for c in self.object_contacts()), default=0.0)
        self.set_object(T_world_object)
        return after > before + SUPPORTED_DEPTH

    def clearance(self, arm: Arm, limit: float, holders: Sequence[Arm] = ()) -> float:
        """Return the smallest distance (m) of the pairs checked for an arm.

        Args:
            arm: the arm.
            limit: the largest distance (m) that is returned.
            holders: the arms that hold the object, whose touch links may touch it.
        """
        touch = _touch_links(holders)
        pairs = (c for c in self.pairs_within(arm, limit) if not _touches(c, touch))
        return min((limit - c.depth for c in pairs), default=limit)

    def pairs_within(self, arm: Arm, distance: float, among: NearBodies | None = None) -> list[Collision]:
        """Return the pairs checked for an arm that are closer than a distance.

        Args:
            arm: the arm.
            distance: the distance (m); the depths of the result are relative to it.
            among: what to check against; everything if None.
        """
        queries = (q for q in self._queries[arm.name] if among is None or q.key in among)
        return [c for query in queries for c in self._collisions(query, distance)]

    def margin_for(self, reason: Reason) -> float:
        """Return the distance (m) that bodies must keep, by the kind of collision.

        It is zero to the object, which the hand is close to by design, and within a robot, where some
        links are always close to each other.
        """
        return self.margin if reason in MARGIN_REASONS else 0.0

    def link_pairs(self) -> Iterator[tuple[BodyName, BodyName]]:
        """Yield the pairs of links, of one robot or of two, that must not collide."""
        for name, other in itertools.combinations_with_replacement(self.bodies.robots, 2):
            links = (self.bodies.link_indices(robot) for robot in (name, other))
            pairs = own_pairs(self.scene, name) if name == other else itertools.product(*links)
            for a, b in pairs:
                yield BodyName(name, a), BodyName(other, b)

    def all_pairs_within(
        self, distance: float, links: Iterable[tuple[BodyName, BodyName]], touching: Sequence[Arm] = ()
    ) -> list[Collision]:
        """Return the pairs of bodies that are closer than a distance: robots to all else, and some links.

        Args:
            distance: the distance (m); the depths of the result are relative to it.
            links: those of `link_pairs` that are measured; `near_links` finds which can be so close.
            touching: the arms whose touch links may touch the object.
        """
        touch = _touch_links(touching)
        queries = [*self._outer_queries, *(self._link_query(a, b) for a, b in links)]
        return [c for q in queries for c in self._collisions(q, distance) if not _touches(c, touch)]

    def _link_query(self, a: BodyName, b: BodyName) -> Query:
        own, other = (self.bodies.link_indices(name.body)[name.link] for name in (a, b))
        reason = Reason.SELF_COLLISION if a.body == b.body else Reason.ROBOT_COLLISION
        return Query(reason, b.body, self.bodies.robots[a.body], self.bodies.robots[b.body], own, other)

    def _collisions(self, query: Query, margin: float | None = None) -> list[Collision]:
        """Return the pairs of a query that are closer than a margin (m), by default that of its reason."""
        if margin is None:
            margin = self.margin_for(query.reason)
        links = [link for link in (query.link_a, query.link_b) if link is not None]
        points = pybullet.getClosestPoints(query.a, query.b, margin, *links, physicsClientId=self._client)
        name = self.bodies.body_name
        # Fields of a point: 3 and 4 are the links of a and b, 8 is the distance, negative for penetration.
        return [
            Collision(query.reason, name(query.a, p[3]), name(query.b, p[4]), margin - p[8])
            for p in points or ()
            if p[8] < margin and p[3] not in query.skip_a
        ]


def _touch_links(arms: Iterable[Arm]) -> set[tuple[str, str]]:
    """Return the links of arms that may touch the object, with their robots."""
    return {(arm.robot.name, link) for arm in arms for link in arm.hand.touch_links}


def _touches(c: Collision, touch: set[tuple[str, str]]) -> bool:
    """Whether a collision is that of a link that may touch the object with the object."""
    return c.reason == Reason.OBJECT_COLLISION and c.a in touch


def _deepest(found: Iterable[Collision]) -> list[Collision]:
    """Return the deepest collision of each pair of bodies, deepest first."""
    deepest: dict[object, Collision] = {}
    for c in sorted(found, key=lambda c: -c.depth):
        deepest.setdefault((frozenset((c.a, c.b)), c.reason), c)
    return list(deepest.values())
