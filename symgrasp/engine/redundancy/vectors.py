"""Angles and poses, as the search of the redundancy compares them. Compiled."""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT

__all__ = ["SAME_CURVE", "copy_pose", "largest_turn", "wrapped"]

SAME_CURVE = 0.7
"""Largest difference (rad) of joints of two configurations that are taken for ends of one smooth curve."""


@njit(**STRICT)
def wrapped(angle):
    """Return an angle (rad) less full turns, from -π to π."""
    if -math.pi <= angle < math.pi:  # the rule, and quicker
        return angle
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(**STRICT)
def largest_turn(q, other, enough):
    """Return the largest difference (rad) of two rows of joint values (n,), or one that is ``enough``."""
    most = 0.0
    for j in range(len(q)):
        most = max(most, abs(wrapped(other[j] - q[j])))
        if most >= enough:
            break
    return most


@njit(**STRICT)
def copy_pose(pose, out):
    """Copy a pose (12,)."""
    for i in range(12):
        out[i] = pose[i]
