"""The straight retreat of a hand from a grasp, against its approach, and the distances it is checked at."""

from __future__ import annotations

import numpy as np

from symgrasp.poses import Array, translation

__all__ = ["RETREAT_STEP", "RETREAT_TURN", "retreat_distances", "retreated"]

RETREAT_STEP = 0.01
"""Largest distance (m) between successive poses that are checked along a retreat."""

RETREAT_TURN = 0.5
"""Largest change of a joint (rad) in one such step; a larger one is a jump to another branch."""


def retreat_distances(approach: float) -> Array:
    """Return the distances (s,) from the grasp (m) where a retreat of length ``approach`` (m) is checked."""
    steps = int(np.ceil(approach / RETREAT_STEP - 1e-9))
    return np.array([approach * (k + 1) / steps for k in range(steps)])


def retreated(T_base_tool: Array, distance: float) -> Array:
    """Return a tool pose (4, 4) moved back against its approach by a distance (m)."""
    return T_base_tool @ translation([0, 0, -distance])
