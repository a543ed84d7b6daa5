"""The straight retreat of a hand from a grasp, against its approach, and the distances it is checked at."""

from __future__ import annotations

import numpy as np

from symgrasp.poses import Array, translation

__all__ = ["HAND_SPEED", "RETREAT_STEP", "RETREAT_TURN", "retreat_distances", "retreat_turns", "retreated"]

RETREAT_STEP = 0.01
"""Largest distance (m) between successive poses that are checked along a retreat."""

RETREAT_TURN = 0.5
"""Largest change of a joint (rad) in one such step; a larger one is a jump to another branch."""


HAND_SPEED = 0.1
"""Speed (m/s) of the hand along a retreat at which no joint may have to turn faster than it can."""


def retreat_distances(approach: float) -> Array:
    """Return the distances (s,) from the grasp (m) where a retreat of length ``approach`` (m) is checked."""
    steps = int(np.ceil(approach / RETREAT_STEP - 1e-9))
    return np.array([approach * (k + 1) / steps for k in range(steps)])


def retreat_turns(velocity: Array, approach: float) -> Array:
    """Return the largest changes (n,) (rad) of joints in a step of a retreat with the hand at `HAND_SPEED`.

    Args:
        velocity: (n,) their largest speeds (rad/s).
        approach: length (m) of the retreat.
    """
    steps = len(retreat_distances(approach))
    if not steps:
        return np.full(len(velocity), RETREAT_TURN)
    return np.minimum(RETREAT_TURN, velocity * (approach / steps / HAND_SPEED))


def retreated(T_base_tool: Array, distance: float) -> Array:
    """Return a tool pose (4, 4) moved back against its approach by a distance (m)."""
    return T_base_tool @ translation([0, 0, -distance])
