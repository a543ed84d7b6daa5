"""A configuration of an arm together with the opening of its hand."""

from __future__ import annotations

from typing import NamedTuple

from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["ArmConfiguration"]


class ArmConfiguration(NamedTuple):
    """The joint values of an arm and the opening of its hand.

    Attributes:
        arm: the arm.
        q: joint values (n,) (rad).
        opening: distance between the finger pads (m).
    """

    arm: Arm
    q: Array
    opening: float
