"""Whether robots that could fall stand: the centre of mass above the area that their feet span.

A held object is a load. Where all hands that hold it are of one robot, it is a body of that robot, and its
weight acts at its own centre of mass. Where several robots hold it together, nobody knows how they share it:
each hand is taken to bear an equal part, which acts on the object's axis at the height of the grasp. On the
retreat from a grasp the hand is empty, and so is the robot.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array, inverse
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.scene import Scene

__all__ = ["Load", "load_of_hand", "support_edges", "support_margin", "support_margins"]


class Load(NamedTuple):
    """A weight that a robot carries.

    Attributes:
        mass: in kg.
        point: (..., 3) where it acts, in the world.
    """

    mass: float
    point: Array


def load_of_hand(
    scene: Scene, arm: Arm, holders: Sequence[str], T_world_object: Array, height: float | Array
) -> Load:
    """Return the load of an arm's robot that one hand accounts for.

    Args:
        scene: the scene.
        arm: the arm whose hand it is.
        holders: names of all arms that hold the object; the arm alone if it is not among them.
        T_world_object: poses (..., 4, 4) of the object.
        height: (...,) of the grasp on the object (m).
    """
    names = holders if arm.name in holders else (arm.name,)
    own = [name for name in names if scene.arm(name).robot.name == arm.robot.name]
    if len(own) == len(names):
        height, share = scene.profile.centre_of_mass, 1.0
    else:
        share = 1.0 / len(names)
    along = np.asarray(height)[..., None] * T_world_object[..., :3, 2]
    return Load(scene.object_mass * share, T_world_object[..., :3, 3] + along)


def support_margins(
    scene: Scene, T_world_object: Array, configurations: Iterable[tuple[Arm, Array, float]]
) -> dict[str, float]:
    """Return by how much robots stand that hold the object together; see `support_margin`.

    Args:
        scene: the scene.
        T_world_object: pose (4, 4) of the object.
        configurations: (arm, joint values (n,), opening (m)) of every arm that holds it; all other joints
            are at home.

    Returns:
        Name of the robot → margin (m), of the holding robots that could fall.
    """
    held = list(configurations)
    holders = [arm.name for arm, *_ in held]
    margins = {}
    for name, robot in scene.robots.items():
        own = [(arm, q, opening) for arm, q, opening in held if arm.robot.name == name]
        if robot.support is None or not own:
            continue
        values, loads = robot.home.copy(), []
        for arm, q, opening in own:
            moved = arm.robot_values(q, opening)
            values = np.where(moved != robot.home, moved, values)
            height = (inverse(T_world_object) @ arm.world_tool_pose(q))[2, 3]
            loads.append(load_of_hand(scene, arm, holders, T_world_object, float(height)))
        if len(own) == len(held):
            loads = loads[:1]  # the whole object, once
        margins[name] = float(support_margin(robot, values, loads))
    return margins


def support_margin(robot: Robot, values: Array, loads: Sequence[Load]) -> Array:
    """Return how far (...,) (m) the centre of mass is inside the edges of a robot's support.

    It is negative outside.

    Args:
        robot: a robot with a support.
        values: (..., N) values of all its joints.
        loads: what it carries.
    """
    mass, centre = robot.model.masses()
    links = robot.T_world_base @ robot.model.forward(values)
    points = np.einsum("...lij,lj->...li", links[..., :3, :3], centre) + links[..., :3, 3]
    total = mass.sum() + sum(load.mass for load in loads)
    middle = (mass @ points + sum(load.mass * load.point for load in loads)) / total
    edges = support_edges(robot)
    return (edges[:, 2] - middle[..., :2] @ edges[:, :2].T).min(axis=-1)


def support_edges(robot: Robot) -> Array:
    """Return the edges (k, 3) of a robot's support, none where it cannot fall.

    Each is a unit normal (2,) outwards and its offset c: inside, ``normal·p <= c``.
    """
    if robot.support is None:
        return np.empty((0, 3))
    along = np.roll(robot.support, -1, axis=0) - robot.support
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return np.column_stack([normal, (normal * robot.support).sum(axis=1)])
