"""An arm at joint values, with its hand open so far."""

from __future__ import annotations

from typing import NamedTuple

from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["ArmConfiguration"]


class ArmConfiguration(NamedTuple):
    """An arm at joint values (n,) with its hand open by ``opening`` (m)."""

    arm: Arm
    q: Array
    opening: float
