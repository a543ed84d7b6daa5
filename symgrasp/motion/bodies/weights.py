"""What the joints that move weigh, with what they hold, for robots that can fall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.motion.bodies.joints import MovingJoints
from symgrasp.motion.bodies.linkage import Balance
from symgrasp.motion.bodies.state import State
from symgrasp.poses import Array, from_rotation, inverse
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.balance import load_of_hand, support_edges
from symgrasp.scene.scene import Scene

__all__ = ["balance_of"]


def balance_of(
    scene: Scene, state: State, moving: MovingJoints, held_by: Sequence[Arm], without: Sequence[Arm]
) -> Balance:
    """Return what keeps the robots that move on their feet.

    Args:
        scene: the scene.
        state: where everything is that does not move.
        moving: the joints that move.
        held_by: the arms that hold the object; what loads they bear, see `symgrasp.scene.balance`.
        without: arms that move too and are looked at later, and with them the balance of their robots.
    """
    count = len(moving.joints)
    later = {arm.robot.name for arm in without}
    falling = [r for r in moving.robots.values() if r.support is not None and r.name not in later]
    weight, sway, masses, edges, owner = np.zeros((count, 4)), np.zeros(count), [], [], []
    number = np.full(count, -1, dtype=np.int64)
    for r, robot in enumerate(falling):
        bodies = _bodies(scene, state, moving, robot, held_by)
        total = sum(mass for mass, *_ in bodies)
        still = np.zeros(3)
        for mass, j, point in bodies:
            if j < 0:
                still += mass * point
            else:
                weight[j] += [mass, *(mass * point)]
                sway += mass / total * moving.levers(j, point[None])
        number[[k for k, (own, _) in enumerate(moving.joints) if own is robot]] = r
        own = support_edges(robot)
        own[:, 2] -= own[:, :2] @ still[:2] / total
        edges.append(own)
        owner += [r] * len(own)
        masses.append(total)
    return Balance(
        weight=weight,
        robot=number,
        sway=sway,
        mass=np.array(masses, dtype=float),
        edge=np.concatenate(edges) if edges else np.empty((0, 3)),
        edge_robot=np.array(owner, dtype=np.int64),
    )


def _bodies(
    scene: Scene, state: State, moving: MovingJoints, robot: Robot, held_by: Sequence[Arm]
) -> list[tuple[float, int, Array]]:
    """Return mass (kg), carrying joint and centre of mass (3,) of all links and loads of a robot.

    The centre is in the frame of the joint, in the world where the joint is -1.
    """
    found = []
    links = robot.T_world_base @ robot.model.forward(state.values[robot.name])
    for link, pose, mass, centre in zip(robot.model.link_names, links, *robot.model.masses(), strict=True):
        j = moving.carrier(robot, link)
        frame = pose if j < 0 else moving.link_in_joint(j, link)
        found.append((float(mass), j, frame[:3, :3] @ centre + frame[:3, 3]))
    own = [arm for arm in held_by if arm.robot is robot]
    for arm in own[:1] if len(own) == len(held_by) else own:  # alone, it carries the whole object once
        height = float((inverse(state.T_world_object) @ state.tool(arm))[2, 3])
        load = load_of_hand(scene, arm, [a.name for a in held_by], state.T_world_object, height)
        j = moving.carrier(robot, arm.tool)
        place = from_rotation(np.eye(3), load.point)
        found.append((load.mass, j, (place if j < 0 else moving.now_in_joint(j, place))[:3, 3]))
    return found
