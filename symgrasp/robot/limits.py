"""When a joint value is inside its limits."""

from __future__ import annotations

import numpy as np

from symgrasp.poses import Array

__all__ = ["LIMIT_TOLERANCE", "moved_onto_limits", "values_inside"]

LIMIT_TOLERANCE = 1e-9
"""How far (rad or m) beyond a limit a joint value counts as being at it: a configuration that stands exactly
at a limit comes out of the inverse kinematics a few roundings to either side. It is moved onto the limit."""


def values_inside(q: Array, lower: Array, upper: Array) -> np.ndarray:
    """Whether values (..., n) are inside limits (n,), or beyond them by at most `LIMIT_TOLERANCE`."""
    return (q >= lower - LIMIT_TOLERANCE) & (q <= upper + LIMIT_TOLERANCE)


def moved_onto_limits(q: Array, lower: Array, upper: Array, others: Array) -> Array:
    """Return values (..., n): those of q where it is inside limits (n,), moved onto them; else the others."""
    return np.where(values_inside(q, lower, upper), np.clip(q, lower, upper), others)
