"""When a joint value is inside its limits."""

from __future__ import annotations

__all__ = ["LIMIT_TOLERANCE"]

LIMIT_TOLERANCE = 1e-9
"""How far (rad or m) beyond a limit a joint value counts as being at it: a configuration that stands exactly
at a limit comes out of the inverse kinematics a few roundings to either side. It is moved onto the limit."""
