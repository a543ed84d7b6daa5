"""Which pairs of bodies are checked for collisions: for an arm that grasps, and for a parked robot."""

from __future__ import annotations

from typing import NamedTuple

from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.scene import Scene
from symgrasp.world.bodies import SceneBodies
from symgrasp.world.hand_pairs import own_pairs

__all__ = ["Query", "arm_queries", "body_query", "outer_queries", "parked_queries"]


class Query(NamedTuple):
    """One call of PyBullet's ``getClosestPoints``: for all links of two bodies, or for two links.

    Attributes:
        reason: the kind of collision that it finds.
        key: how `NearBodies` names the second body, or the pair of links.
        a: PyBullet's id of the first body.
        b: PyBullet's id of the second body.
        link_a: link index of the first body; None asks for all its links.
        link_b: link index of the second body; None asks for all its links.
        skip_a: link indices of the first body whose distances do not count.
    """

    reason: Reason
    key: str | frozenset[str]
    a: int
    b: int
    link_a: int | None = None
    link_b: int | None = None
    skip_a: frozenset[int] = frozenset()


def body_query(
    bodies: SceneBodies, reason: Reason, a: int, b: int, skip_a: frozenset[int] = frozenset()
) -> Query:
    """Return the query for all links of two bodies; see `Query` for the arguments."""
    return Query(reason, bodies.names[b], a, b, skip_a=skip_a)


def arm_queries(bodies: SceneBodies, scene: Scene, arm: Arm) -> list[Query]:
    """Return what is checked for an arm, in the order of the reasons.

    Its robot against itself, the object, the obstacles and the other robots. Touch links may touch the
    object; links that no joint moves are not checked against obstacles.
    """
    robot = arm.robot
    body = bodies.robots[robot.name]
    index = bodies.link_indices(robot.name)
    touch = frozenset(index[link] for link in arm.hand.touch_links if link in index)
    queries = [
        Query(Reason.SELF_COLLISION, frozenset((a, b)), body, body, index[a], index[b])
        for a, b in own_pairs(scene, robot.name)
    ]
    queries += [
        body_query(bodies, Reason.OBJECT_COLLISION, body, piece, skip_a=touch) for piece in bodies.object
    ]
    return queries + _with_obstacles(bodies, robot) + _other_robots(bodies, body)


def outer_queries(bodies: SceneBodies, scene: Scene) -> list[Query]:
    """Return what is checked between robots and all else but robots: the object, and the obstacles."""
    queries = [
        body_query(bodies, Reason.OBJECT_COLLISION, body, piece)
        for body in bodies.robots.values()
        for piece in bodies.object
    ]
    return queries + [q for robot in scene.robots.values() for q in _with_obstacles(bodies, robot)]


def parked_queries(bodies: SceneBodies, robot: str) -> list[Query]:
    """Return what is checked for a robot that is parked at home: the object, and the other robots."""
    body = bodies.robots[robot]
    queries = [body_query(bodies, Reason.OBJECT_COLLISION, body, piece) for piece in bodies.object]
    return queries + _other_robots(bodies, body)


def _with_obstacles(bodies: SceneBodies, robot: Robot) -> list[Query]:
    body, index = bodies.robots[robot.name], bodies.link_indices(robot.name)
    mount = frozenset(index[link] for link in robot.model.mount_links() if link in index)
    return [
        body_query(bodies, Reason.SCENE_COLLISION, body, obstacle, skip_a=mount)
        for obstacle in bodies.obstacles
    ]


def _other_robots(bodies: SceneBodies, body: int) -> list[Query]:
    others = [other for other in bodies.robots.values() if other != body]
    return [body_query(bodies, Reason.ROBOT_COLLISION, body, other) for other in others]
