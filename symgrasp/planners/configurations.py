"""Arm configurations that hold an object together without the robots meeting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from types import MappingProxyType

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.object.manifold import ROLLS
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import support_margins
from symgrasp.world import BulletWorld

__all__ = ["ConfigurationFinder", "witnesses"]


def witnesses(
    arms: Sequence[Arm], maps: Sequence[FeasibilityMap], cells: Sequence[Cell]
) -> list[ArmConfiguration]:
    """Return every arm at the witness of its cell, which must be feasible."""
    configurations = []
    for arm, m, cell in zip(arms, maps, cells, strict=True):
        witness = m.witness(cell)
        assert witness is not None  # planners choose feasible cells
        configurations.append(ArmConfiguration(arm, witness.q, witness.opening))
    return configurations


class ConfigurationFinder:
    """Finds configurations in which several arms hold their cells and nothing collides.

    Args:
        world: a world of the scene; the object is placed by `find`.
        arms: the arms.
        maps: one map an arm, in the same order, of one task.
        by_torso: arm → its maps at the samples of the torso that it shares with another arm of the task.
    """

    def __init__(
        self,
        world: BulletWorld,
        arms: Sequence[Arm],
        maps: Sequence[FeasibilityMap],
        by_torso: Mapping[str, Sequence[FeasibilityMap]] = MappingProxyType({}),
    ) -> None:
        self.world, self.arms, self.maps = world, arms, maps
        self._by_torso = by_torso
        self.body_checks = 0
        self._checker = cache(self._make_checker)
        self._free = cache(self._feasible)

    def maps_at(self, torso: Mapping[str, int]) -> list[FeasibilityMap]:
        """Return the maps of the arms, with the torso that some share at a sample.

        Args:
            torso: arm → sample, for those that share a torso.
        """
        return [
            self._by_torso[arm.name][torso[arm.name]] if arm.name in torso else m
            for arm, m in zip(self.arms, self.maps, strict=True)
        ]

    def find(
        self,
        cells: Sequence[Cell],
        torso: Mapping[str, int] = MappingProxyType({}),
        *,
        every: bool = True,
    ) -> list[ArmConfiguration] | None:
        """Return configurations, one an arm, that are free together, or None if there are none.

        Args:
            cells: a feasible cell for every arm.
            torso: arm → sample of its torso, for those that share one.
            every: try all combinations of feasible configurations, not the witnesses alone.
        """
        found = witnesses(self.arms, self.maps_at(torso), cells)
        if self.are_free_together(found):
            return found
        if every:
            choices = (
                self._free(k, cell, torso.get(arm.name))
                for k, (arm, cell) in enumerate(zip(self.arms, cells, strict=True))
            )
            for configurations in product(*choices):
                if self.are_free_together(configurations):
                    return list(configurations)
        return None

    def are_free_together(self, configurations: Sequence[ArmConfiguration]) -> bool:
        """Return whether nothing collides and no robot falls when every arm takes its configuration."""
        self.body_checks += 1
        self.world.set_object(self.maps[0].T_world_object)
        self.world.set_arms(configurations)
        margins = support_margins(self.world.scene, self.maps[0].T_world_object, configurations)
        return min(margins.values(), default=0.0) >= 0 and not self.world.collisions(self.arms)

    def _feasible(self, k: int, cell: Cell, torso: int | None) -> list[ArmConfiguration]:
        """Return every feasible configuration of an arm at a cell, the other robots at home."""
        arm, m = self.arms[k], self.maps[k]
        for robot in self.world.scene.robots:
            self.world.park(robot)
        self.world.set_object(m.T_world_object)
        h, theta = m.manifold.h[cell.row], m.manifold.theta[cell.column]
        radius = float(m.manifold.profile.radius(h))
        tool = arm.hand.tool_pose(m.T_world_object, h, theta, ROLLS[cell.roll], radius)
        opening = float(m.opening[cell.row])
        candidates = self._checker(k, torso).candidates(inverse(arm.robot.T_world_base) @ tool, opening)
        return [ArmConfiguration(arm, c.q, opening) for c in candidates if c.reason == Reason.FEASIBLE]

    def _make_checker(self, k: int, torso: int | None) -> CandidateChecker:
        settings = self.world.scene.settings
        arm = self.arms[k]
        ik = solver_for(arm, settings.redundancy, None if torso is None else [torso])
        holders = [own.name for own in self.arms]
        return CandidateChecker(self.world, arm, ik, settings.approach, holders=holders)
