"""Arms as a URDF describes them whose angles are rounded."""

from __future__ import annotations

import copy
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from symgrasp.robot.robot import Arm

__all__ = ["rounded"]


def rounded(arm: Arm, digits: int, rng: np.random.Generator) -> Arm:
    """Return an arm whose URDF gives the roll, pitch and yaw between its joints to so many decimals.

    Args:
        arm: the arm; its axes and offsets are those of the frames of its joints, at zero.
        digits: decimals.
        rng: chooses where the x axes of the frames point, which a URDF is free to.
    """
    frames = [np.eye(3)]
    for axis in arm.H:
        x = np.cross(axis, rng.normal(size=3))
        x /= np.linalg.norm(x)
        frames.append(np.column_stack([x, np.cross(axis, x), axis]))
    frames.append(arm.R0)
    H, P, at = [], [arm.P[0]], np.eye(3)
    for k, (before, after) in enumerate(pairwise(frames)):
        rpy = np.round(Rotation.from_matrix(before.T @ after).as_euler("xyz"), digits)
        at = at @ Rotation.from_euler("xyz", rpy).as_matrix()
        if k < len(arm.H):
            H.append(at[:, 2])
            P.append(at @ after.T @ arm.P[k + 1])
    found = copy.copy(arm)
    found.H, found.P, found.R0 = np.array(H), np.array(P), at
    return found
