"""The bodies around an arm as the exact engine sees them: those it does not move, and what all are called."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.engine.checks import HIT_BAND
from symgrasp.engine.geometry import ArmGeometry
from symgrasp.feasibility.cell import CLEARANCE_LIMIT
from symgrasp.feasibility.creation.map_draft import MapDraft
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.world import BodyName, BulletWorld, Collision

__all__ = ["FixedBodies", "PieceBodies", "SceneBodies"]


class FixedBodies(NamedTuple):
    """How close the bodies are that the arm does not move: the same for every candidate of a map.

    Attributes:
        gap: distance (m) that they have at least, at most what any configuration has.
        collision: their deepest collision, which every candidate shares; None where there is none.
    """

    gap: float
    collision: Collision | None


class PieceBodies(NamedTuple):
    """What the pieces of the engine's geometry are called in a map.

    Attributes:
        number: (P,) body of each piece in the map's list of names.
        reason: (P,) what a collision with the piece is called.
    """

    number: np.ndarray
    reason: np.ndarray


class SceneBodies:
    """The bodies around one arm, of a world of its scene.

    Args:
        world: the world; the hand is open as in the first row of maps.
        arm: the arm.
        geometry: its pieces.
    """

    def __init__(self, world: BulletWorld, arm: Arm, geometry: ArmGeometry) -> None:
        self._world, self._arm, self._geometry = world, arm, geometry
        # Pairs of which the arm moves neither, at their distances; those with the object differ map by map.
        self._reach = max(CLEARANCE_LIMIT, world.scene.settings.margin)
        pairs = world.pairs_within(arm, self._reach)
        self._fixed = [c for c in pairs if c.reason != Reason.OBJECT_COLLISION and self._is_fixed(c)]

    def fixed(self, most: float) -> FixedBodies:
        """Measure the bodies that the arm does not move, with the object where it is now.

        Args:
            most: distance (m) that any configuration has at most.
        """
        with_object = self._world.pairs_within(self._arm, self._reach, (self._world.scene.file.object.name,))
        gap, deepest = most, None
        for c in [*self._fixed, *filter(self._is_fixed, with_object)]:
            distance = self._reach - c.depth
            gap = min(gap, distance - HIT_BAND)
            depth = self._world.margin_for(c.reason) - distance
            if depth > 0 and (deepest is None or depth > deepest.depth):
                deepest = c._replace(depth=depth)
        return FixedBodies(max(gap, 0.0), deepest)

    def _is_fixed(self, c: Collision) -> bool:
        """Whether a pair involves the arm's robot, but no link that the arm moves."""
        name = self._arm.robot.name
        own = [body.link for body in (c.a, c.b) if body.body == name]
        return bool(own) and not self._geometry.moving_links.intersection(own)

    def pieces_of(self, draft: MapDraft) -> PieceBodies:
        """Name all pieces in a map."""
        names = self._geometry.names
        return PieceBodies(
            np.array([draft.body_index(str(name)) for name in names]),
            np.array([self._collision_reason(name) for name in names]),
        )

    def _collision_reason(self, hit: BodyName) -> Reason:
        """Return what the arm's collision with a body is called."""
        scene = self._world.scene
        if hit.body == self._arm.robot.name:
            return Reason.SELF_COLLISION
        if hit.body in scene.robots:
            return Reason.ROBOT_COLLISION
        return Reason.OBJECT_COLLISION if hit.body == scene.file.object.name else Reason.SCENE_COLLISION
