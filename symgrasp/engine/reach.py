"""How far an arm reaches, whatever its joints: a bound that proves that tool poses are out of reach."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.collision.simplex import FAST
from symgrasp.compiling import njit
from symgrasp.poses import Array, inverse
from symgrasp.robot.robot import Arm

__all__ = ["Reach", "arm_reach", "beyond_reach", "reach_of"]

ROUNDS = 100
"""Rounds of least squares with new weights that make the reach of an arm short."""


class Reach(NamedTuple):
    """How far an arm takes a point of its wrist from a point of its shoulder.

    Attributes:
        shoulder: (3,) a point from which the arm takes a point of the wrist no further away than its length.
        wrist: (7,) middle, axis and radius (m) of the circle in the tool frame on which that point is: the
            last joint turns it.
        length: that distance (m).
    """

    shoulder: Array
    wrist: Array
    length: float


def reach_of(arm: Arm) -> Reach:
    """Return how far an arm reaches, with its shoulder in the frame of the robot's base."""
    model = arm.robot.model
    joints = [next(j for j in model.joints if j.name == name) for name in arm.joint_names]
    zero = model.forward(arm.robot_values(np.zeros(arm.dof)))
    frames = np.array([zero[j.child] for j in joints])
    axes = (frames[:, :3, :3] @ np.array([j.axis for j in joints])[..., None])[..., 0]
    shoulder, wrist, length = arm_reach(frames[:-1, :3, 3], axes[:-1])
    away, last = wrist - frames[-1, :3, 3], axes[-1]
    middle = frames[-1, :3, 3] + (away @ last) * last
    into = inverse(zero[model.link_index(arm.tool)])
    radius = float(np.linalg.norm(wrist - middle))
    return Reach(shoulder, np.array([*(into @ [*middle, 1.0])[:3], *into[:3, :3] @ last, radius]), length)


def arm_reach(origin: Array, axis: Array) -> tuple[Array, Array, float]:
    """Return how far an arm takes a point of its last axis from one of its first, whatever its joints.

    Between two axes that a link holds, all points keep their distance. So the length of a polygon with one
    corner on each axis is a bound; its corners are slid along the axes to make it short.

    Args:
        origin: (n, 3) points on the axes of the joints at zero.
        axis: (n, 3) their directions.

    Returns:
        The first corner (3,), the last one (3,), and the length (m).
    """
    n = len(origin)
    slide, weight = np.zeros(n), np.ones(n - 1)
    ends = np.eye(n - 1, n, k=1)[:, :, None] * axis - np.eye(n - 1, n)[:, :, None] * axis  # (n - 1, n, 3)
    offset = np.diff(origin, axis=0)
    for _ in range(ROUNDS):
        scaled = np.sqrt(weight)[:, None]
        rows = (scaled[:, None] * ends).transpose(0, 2, 1).reshape(-1, n)
        slide = np.linalg.lstsq(rows, -(scaled * offset).ravel(), rcond=None)[0]
        lengths = np.linalg.norm(offset + np.einsum("kjc,j->kc", ends, slide), axis=1)
        weight = 1.0 / np.maximum(lengths, 1e-9)
    corners = origin + slide[:, None] * axis
    return corners[0], corners[-1], float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


@njit(**FAST)
def beyond_reach(reach, T):
    """Return by how much (m) a tool pose (12,) is further away than the arm reaches; else not above 0.

    Returns:
        That, and the middle (3,) of the circle on which the wrist is.
    """
    w, a = reach.wrist, reach.shoulder
    x = T[0] * w[0] + T[1] * w[1] + T[2] * w[2] + T[9]
    y = T[3] * w[0] + T[4] * w[1] + T[5] * w[2] + T[10]
    z = T[6] * w[0] + T[7] * w[1] + T[8] * w[2] + T[11]
    d0, d1, d2 = x - a[0], y - a[1], z - a[2]
    along = (
        d0 * (T[0] * w[3] + T[1] * w[4] + T[2] * w[5])
        + d1 * (T[3] * w[3] + T[4] * w[4] + T[5] * w[5])
        + d2 * (T[6] * w[3] + T[7] * w[4] + T[8] * w[5])
    )
    across = math.sqrt(max(0.0, d0 * d0 + d1 * d1 + d2 * d2 - along * along)) - w[6]
    return math.sqrt(along * along + across * across) - reach.length, x, y, z
