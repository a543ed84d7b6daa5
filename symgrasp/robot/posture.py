"""How well a configuration suits an arm: how far from its joint limits, and from singular poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.poses import Array, rotation_about
from symgrasp.robot.robot import Arm

__all__ = ["conditioning", "ease", "limit_slack"]

EASY_SLACK = np.deg2rad(5.0)
"""Distance (rad) from joint limits from which on a configuration does not stand near one."""

EASY_CONDITIONING = 0.02
"""Conditioning from which on a configuration does not stand near a singular pose."""

LEAST = 0.05
"""Least ease: at a limit or in a singular pose a grasp is poor, but feasible."""


def limit_slack(arm: Arm, q: ArrayLike) -> Array:
    """Return how far (...) (rad) the joint nearest to a limit is from it, at most π; negative outside.

    Args:
        arm: the arm, whose torso does not count.
        q: joint values (..., n).
    """
    own = _own_joints(arm)
    q = np.asarray(q, dtype=float)[..., own]
    slack = np.minimum(q - arm.lower[own], arm.upper[own] - q)
    return np.minimum(slack.min(axis=-1), np.pi)


def conditioning(arm: Arm, q: ArrayLike) -> Array:
    """Return the smallest singular value (...) of the arm's Jacobian over the largest: 0 if singular.

    Rows of the Jacobian are angular velocity, and velocity of the tool over the length of the arm.

    Args:
        arm: the arm, whose torso does not count.
        q: joint values (..., n).
    """
    own = _own_joints(arm)
    q = np.asarray(q, dtype=float)[..., own]
    rotation = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
    position = np.zeros((*q.shape[:-1], 3))
    axes, points = [], []
    for k, axis in enumerate(arm.H[: q.shape[-1]]):
        axes.append(rotation @ axis)
        points.append(position)
        rotation = rotation @ rotation_about(axis, q[..., k])
        position = position + rotation @ arm.P[k + 1]
    length = np.linalg.norm(arm.P[1:], axis=-1).sum()
    columns = [
        np.concatenate([axis, np.cross(axis, position - point) / length], axis=-1)
        for axis, point in zip(axes, points, strict=True)
    ]
    values = np.linalg.svd(np.stack(columns, axis=-1), compute_uv=False)
    return values[..., -1] / values[..., 0]


def _own_joints(arm: Arm) -> slice:
    """Return where the arm's joints are among its values: after a torso, before pitch and azimuth."""
    return slice(arm.dof - len(arm.H), len(arm.joint_names))


def ease(arm: Arm, q: ArrayLike) -> Array:
    """Return how easily (...) an arm stands: 1 unless near a limit or a singular pose, less the nearer.

    Args:
        arm: the arm.
        q: joint values (..., n); NaN for none, of which the ease is 1.
    """
    q = np.asarray(q, dtype=float)
    found = np.ones(q.shape[:-1])
    some = np.isfinite(q).all(axis=-1)
    slack, condition = limit_slack(arm, q[some]), conditioning(arm, q[some])
    found[some] = np.clip(np.minimum(slack / EASY_SLACK, condition / EASY_CONDITIONING), LEAST, 1.0)
    return found
