"""Whether a robot stands with its arm at a candidate. Compiled."""

from __future__ import annotations

import numpy as np

from symgrasp.collision.simplex import FAST
from symgrasp.compiling import njit
from symgrasp.engine.search_types import Balance
from symgrasp.poses import Array
from symgrasp.robot.joint import Joint
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import Load, support_edges

__all__ = ["balance_of", "falls", "loaded", "stands"]


def balance_of(arm: Arm, joints: list[Joint], openings: Array) -> Balance:
    """Return what decides whether an arm's robot stands; the load is left to the map.

    Args:
        arm: the arm.
        joints: its joints, from base to tool.
        openings: (rows,) opening (m) of the hand at each row of the grid.
    """
    model, robot = arm.robot.model, arm.robot
    between, hand = np.zeros((arm.dof, 4)), np.zeros((len(openings), 4))
    if robot.support is None:  # then no weight matters
        return Balance(support_edges(robot), np.zeros(4), between, hand, np.zeros((len(openings), 4)))
    mass, centre = model.masses()
    names = [joint.name for joint in joints]
    last = np.array(
        [
            max((names.index(j.name) for j in model.chain(link) if j.name in names), default=-1)
            for link in model.link_names
        ]
    )
    zero = model.forward(arm.robot_values(np.zeros(arm.dof)))
    points = _points(zero, centre)
    for k, joint in enumerate(joints[:-1]):
        frame = zero[joint.child]
        own = (points[last == k] - frame[:3, 3]) @ frame[:3, :3]
        between[k] = _weight(mass[last == k], own)
    world = points @ robot.T_world_base[:3, :3].T + robot.T_world_base[:3, 3]
    held = last == arm.dof - 1
    different, kind = np.unique(openings, return_inverse=True)
    values = np.array([arm.robot_values(arm.home, float(opening)) for opening in different])
    weights = np.zeros((len(different), 4))
    for k, poses in enumerate(model.forward(values)):
        tool = poses[model.link_index(arm.tool)]
        own = (_points(poses, centre)[held] - tool[:3, 3]) @ tool[:3, :3]
        weights[k] = _weight(mass[held], own)
    hand = weights[kind]
    fixed = _weight(mass[last < 0], world[last < 0])
    return Balance(support_edges(robot), fixed, between, hand, np.zeros((len(openings), 4)))


def loaded(balance: Balance, loads: list[Load]) -> Balance:
    """Return it with the load (rows,) of each row."""
    rows = [[load.mass, *(load.mass * load.point)] for load in loads]
    return balance._replace(load=np.array(rows, dtype=float).reshape(-1, 4))


def _points(poses: Array, centre: Array) -> Array:
    return np.einsum("lij,lj->li", poses[:, :3, :3], centre) + poses[:, :3, 3]


def _weight(mass: Array, points: Array) -> Array:
    """Return the weight (4,) of masses (n,) at points (n, 3)."""
    return np.concatenate([[mass.sum()], mass @ points])


@njit(**FAST)
def stands(balance, frames, T_world_base, T, row, holds):
    """Whether the centre of mass is inside the support, or there is none; see `falls`."""
    return falls(balance, frames, T_world_base, T, row, holds)[0] < 0


@njit(**FAST)
def falls(balance, frames, T_world_base, T, row, holds):
    """Return the edge of the support that the centre of mass is furthest beyond, and by how much (m).

    The edge is -1 where it is inside, or where there is no support.

    Args:
        balance: see `Balance`.
        frames: (n, 12) joint frames in the world, as `place_arm` writes them.
        T_world_base: (4, 4) pose of the robot's base.
        T: (4, 4) tool pose in the base.
        row: row of the grasp.
        holds: whether it bears the load.
    """
    hand = balance.hand[row]
    mass, x, y = balance.fixed[0] + hand[0], balance.fixed[1], balance.fixed[2]
    if holds:
        load = balance.load[row]
        mass, x, y = mass + load[0], x + load[1], y + load[2]
    for k in range(len(balance.joints) - 1):
        w = balance.joints[k]
        mass += w[0]
        f = frames[k]
        x += f[0] * w[1] + f[1] * w[2] + f[2] * w[3] + f[9] * w[0]
        y += f[3] * w[1] + f[4] * w[2] + f[5] * w[3] + f[10] * w[0]
    for i in range(3):  # the tool's weight in the base, then in the world
        moment = T[i, 0] * hand[1] + T[i, 1] * hand[2] + T[i, 2] * hand[3] + T[i, 3] * hand[0]
        x += T_world_base[0, i] * moment
        y += T_world_base[1, i] * moment
    x += T_world_base[0, 3] * hand[0]
    y += T_world_base[1, 3] * hand[0]
    edge, furthest = -1, 0.0
    for k in range(len(balance.edges)):
        normal_x, normal_y, offset = balance.edges[k, 0], balance.edges[k, 1], balance.edges[k, 2]
        moment = normal_x * x + normal_y * y
        if moment > offset * mass:
            beyond = (moment - offset * mass) / mass
            if edge < 0 or beyond > furthest:
                edge, furthest = k, beyond
    return edge, furthest
