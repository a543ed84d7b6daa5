"""Inverse kinematics by damped least squares from many starts: slow, no proof, but for any arm.

It shares nothing with `symgrasp.ik`, whose answers are checked with it.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from symgrasp.poses import Array, rotation_about
from symgrasp.robot.robot import Arm

__all__ = ["REACHED", "STARTS", "reach"]

STARTS, STEPS = 48, 100
"""Starts of the search, and most steps of each."""

REACHED = 1e-9
"""Largest error (m and rad) of the tool where a pose is reached."""

INSIDE = 1e-6
"""How far (rad) inside the limits the search stays: what it reaches is no matter of rounding."""


def reach(arm: Arm, T_base_tool: Array, rng: np.random.Generator) -> Array | None:
    """Look for joint values (n,) inside the limits at a pose (4, 4); None where no start leads there.

    Levenberg-Marquardt with a damping that vanishes with the error. A joint that a step would take out of its
    limits stays where it is, and the others make the step.

    Args:
        arm: the arm, without a torso.
        T_base_tool: the pose.
        rng: draws the starts.
    """
    lower = np.maximum(arm.lower, -2 * np.pi) + INSIDE
    upper = np.minimum(arm.upper, 2 * np.pi) - INSIDE
    q = rng.uniform(lower, upper, (STARTS, arm.dof))
    for _ in range(STEPS):
        J, twist = _linearised(arm, q, T_base_tool)
        error = np.linalg.norm(twist, axis=1)
        if (error < REACHED).any():
            return q[int(error.argmin())]
        step = _step(J, twist)
        beyond = (q + step < lower) | (q + step > upper)
        step = _step(J * ~beyond[:, None, :], twist)
        q = np.clip(q + step, lower, upper)
    return None


def _linearised(arm: Arm, q: Array, T: Array) -> tuple[Array, Array]:
    """Return Jacobians (m, 6, n) and missing twists (m, 6) of joint values (m, n), in the base frame."""
    rotation = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    position = np.broadcast_to(arm.P[0], (len(q), 3))
    axes, points = [], []
    for k, axis in enumerate(arm.H):
        axes.append(rotation @ axis)
        points.append(position)
        rotation = rotation @ rotation_about(axis, q[:, k])
        position = position + rotation @ arm.P[k + 1]
    w = np.stack(axes, axis=-1)
    v = np.cross(w, position[:, :, None] - np.stack(points, axis=-1), axis=1)
    missing = T[:3, :3] @ np.swapaxes(rotation @ arm.R0, 1, 2)
    twist = np.concatenate([T[:3, 3] - position, Rotation.from_matrix(missing).as_rotvec()], axis=1)
    return np.concatenate([v, w], axis=1), twist


def _step(J: Array, twist: Array) -> Array:
    """Return the damped least-squares steps (m, n)."""
    damping = 1e-12 + 1e-2 * np.minimum((twist**2).sum(axis=1), 1.0)
    inner = J @ np.swapaxes(J, 1, 2) + damping[:, None, None] * np.eye(6)
    return np.einsum("mij,mi->mj", J, np.linalg.solve(inner, twist[..., None])[..., 0])
