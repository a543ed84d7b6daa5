"""Where a robot that is put into a scene stands: free of what is there, with the object in reach."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from symgrasp.errors import SceneError
from symgrasp.poses import Array, from_rotation, rotation_z
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.replacing import with_base
from symgrasp.scene.scene import Scene
from symgrasp.world.bullet import BulletWorld
from symgrasp.world.client import pybullet, xyzw
from symgrasp.world.opening import open_world
from symgrasp.world.shapes import MARGIN
from symgrasp.world.tasks import RESTING_DEPTH

__all__ = ["placed", "stands_free"]

TURNS = np.deg2rad([0, *(sign * turn for turn in range(15, 180, 15) for sign in (1, -1)), 180])
"""By how much the robot is moved around the object, in the order in which it is tried."""

STEPS = (1.0, 1.15, 1.3, 1.5, 1.75, 2.0, 0.85)
"""By which factor it is moved away from the object."""

STRETCHED = 0.9
"""Largest distance from the first joint to the object, as a share of the length of the arm."""

STANDING_DEPTH = RESTING_DEPTH + MARGIN
"""How deep (m) a robot's body may be inside another body and still count as standing on it, with what
PyBullet keeps around the hulls of links."""

STEEP = 0.5
"""Largest height of the first joint above or below it, as such a share, where the robot may stay standing."""


def placed(scene: Scene, name: str, old: Arm) -> Scene:
    """Return a scene in which a robot stands where its first arm is to the object as another arm was.

    The first joint is put in the same direction from the object of the first task, as far away in proportion
    to the length of the arm. The robot stands as high as the other did, unless its arm is too far above or
    below the object then; else its first joint is as high above the object, in proportion. Where it is inside
    of an obstacle, another robot or the object, it is moved around the object and away from it. What the arms
    move does not count, as their home is found later.

    Args:
        scene: the scene.
        name: of the robot to place.
        old: an arm that is well placed.

    Raises:
        SceneError: the robot is free at none of these places.
        UrdfError, MeshError: PyBullet cannot make a shape of the scene.
    """
    robot = scene.robots[name]
    arms = [arm for arm in scene.arms.values() if arm.robot is robot]
    with open_world(scene) as world:
        for T_world_base in _places(scene, arms[0], old):
            if _is_free(world, name, T_world_base, _body(robot, arms)):
                return with_base(scene, name, T_world_base)
    thing = scene.file.object.name
    expected = (
        f"a place free of obstacles with {thing} in reach of {arms[0].name}: make room, or open another scene"
    )
    raise SceneError(scene.source, "robots", name, expected)


def _body(robot: Robot, arms: Iterable[Arm]) -> frozenset[str]:
    """Return the links of a robot that its arms do not move; all of them if they move all."""
    moved = {k for arm in arms for k in arm.indices.tolist()}
    links = robot.model.colliding_links()
    body = [link for link in links if moved.isdisjoint(j.source for j in robot.model.chain(link))]
    return frozenset(body or links)


def stands_free(world: BulletWorld, name: str) -> bool:
    """Return whether a robot stands in no obstacle and no other robot.

    That is asked of the links that its arms do not move: the others are checked wherever an arm is.

    Args:
        world: a world.
        name: of the robot.
    """
    robot, bodies = world.scene.robots[name], world.bodies
    arms = [arm for arm in world.scene.arms.values() if arm.robot is robot]
    others = [body for other, body in bodies.robots.items() if other != name]
    return _is_outside(world, name, _body(robot, arms), [*bodies.obstacles, *others])


def _is_free(world: BulletWorld, name: str, T_world_base: Array, counted: frozenset[str]) -> bool:
    """Return whether none of some links of a robot is inside of anything, at a pose (4, 4) of its root."""
    bodies, body = world.bodies, world.bodies.robots[name]
    position, orientation = T_world_base[:3, 3].tolist(), xyzw(T_world_base)
    pybullet.resetBasePositionAndOrientation(body, position, orientation, physicsClientId=bodies.client)
    others = [other for other in bodies.robots.values() if other != body]
    return _is_outside(world, name, counted, [*bodies.obstacles, *bodies.object, *others])


def _is_outside(world: BulletWorld, name: str, counted: frozenset[str], others: Iterable[int]) -> bool:
    """Return whether none of some links of a robot is inside of any of some bodies."""
    bodies, body = world.bodies, world.bodies.robots[name]
    index = bodies.link_indices(name)
    checked = {index[link] for link in counted}
    # Fields of a point: 3 is the link of the robot, 8 is the distance, negative for penetration.
    return all(
        point[3] not in checked or point[8] > -STANDING_DEPTH
        for other in others
        for point in pybullet.getClosestPoints(body, other, 0.0, physicsClientId=bodies.client) or ()
    )


def _places(scene: Scene, new: Arm, old: Arm) -> Iterator[Array]:
    """Yield poses (4, 4) of the root link of a robot around the object, the best ones first."""
    profile, T_world_old = scene.profile, old.robot.T_world_base
    middle = [0.0, 0.0, 0.5 * (profile.h_min + profile.h_max), 1.0]
    point = (scene.task().T_world_object @ middle)[:3]
    upright, length = T_world_old[:3, :3], _length(new)
    away = length / _length(old) * (T_world_old[:3, 3] + upright @ old.P[0] - point)
    root = T_world_old[2, 3] + _bottom(old, upright) - _bottom(new, upright)
    standing = root + (upright @ new.P[0])[2] - point[2]
    for height in (away[2],) if abs(standing) > STEEP * length else (standing, away[2]):
        for turn in TURNS:
            for step in STEPS:
                rotation = rotation_z(turn)[:3, :3]
                offset = rotation @ [step * away[0], step * away[1], height]
                if np.linalg.norm(offset) < STRETCHED * length:
                    turned = rotation @ upright
                    yield from_rotation(turned, point + offset - turned @ new.P[0])


def _length(arm: Arm) -> float:
    """Return the length (m) of an arm: of all its links in a line."""
    return float(np.linalg.norm(arm.P[1:], axis=-1).sum())


def _bottom(arm: Arm, rotation: Array) -> float:
    """Return the height (m) of the lowest point of a robot's body above its root link, turned (3, 3)."""
    model, up = arm.robot.model, rotation[2]
    poses = dict(zip(model.link_names, model.forward(arm.robot.home), strict=True))
    heights = [
        up @ poses[link][:3, 3] + float((hull @ poses[link][:3, :3].T @ up).min())
        for link in _body(arm.robot, [arm])
        for hull in model.hulls(link)
    ]
    return min(heights, default=0.0)
