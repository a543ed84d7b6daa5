"""Names of bodies, and collisions: pairs of bodies that are too close."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from symgrasp.reason import Reason

__all__ = ["BodyName", "Collision", "NearBodies"]


class BodyName(NamedTuple):
    """The name of a link of a robot, or of an obstacle or the object.

    Attributes:
        body: name of the robot, obstacle or object in the scene.
        link: name of the link; empty for the object and for obstacles that are not URDFs.
    """

    body: str
    link: str

    def __str__(self) -> str:
        return f"{self.body}/{self.link}" if self.link else self.body


class Collision(NamedTuple):
    """Two bodies that are closer than they may be.

    Attributes:
        reason: the kind of collision, as seen by the arm.
        a: a link of the arm's robot, or the object where that is what was checked.
        b: what it collides with.
        depth: how much closer (m) they are than the margin; the penetration where that is zero.
    """

    reason: Reason
    a: BodyName
    b: BodyName
    depth: float


NearBodies = Collection[str | frozenset[str]]
"""What to check an arm against (the result of a broad phase): names of bodies, and pairs of link names of
its own robot."""
