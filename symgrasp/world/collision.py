"""Bodies by name, and pairs of them that are too close."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from symgrasp.reason import Reason

__all__ = ["Body", "Collision", "NearBodies"]


class Body(NamedTuple):
    """A link of a robot, or a whole obstacle or object (with an empty or inner link name)."""

    body: str
    link: str

    def __str__(self) -> str:
        return f"{self.body}/{self.link}" if self.link else self.body


class Collision(NamedTuple):
    """Two bodies that are closer than they may be.

    Attributes:
        reason: the kind of collision, seen from the arm.
        a: the link of the robot.
        b: what it hits.
        depth: how much closer (m) than allowed; the penetration where the margin is zero.
    """

    reason: Reason
    a: Body
    b: Body
    depth: float


NearBodies = Collection[str | frozenset[str]]
"""What could be in the way of an arm: bodies by their names, and pairs of the robot's own links."""
