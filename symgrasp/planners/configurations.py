"""Arm configurations that hold an object together without the robots meeting."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.object.manifold import ROLLS, grasp_to_tool
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.robot.robot import Arm
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
    """

    def __init__(self, world: BulletWorld, arms: Sequence[Arm], maps: Sequence[FeasibilityMap]) -> None:
        self.world, self.arms, self.maps = world, arms, maps
        self.body_checks = 0
        self._checker = cache(self._make_checker)
        self._free = cache(self._feasible)

    def witnesses(self, cells: Sequence[Cell]) -> list[ArmConfiguration]:
        """Return every arm at the witness of its cell."""
        return witnesses(self.arms, self.maps, cells)

    def find(self, cells: Sequence[Cell], *, every: bool = True) -> list[ArmConfiguration] | None:
        """Return configurations, one an arm, that are free together, or None if there are none.

        Args:
            cells: a feasible cell for every arm.
            every: try all combinations of feasible configurations, not the witnesses alone.
        """
        if self.are_free_together(self.witnesses(cells)):
            return self.witnesses(cells)
        if every:
            for configurations in product(*(self._free(k, cell) for k, cell in enumerate(cells))):
                if self.are_free_together(configurations):
                    return list(configurations)
        return None

    def are_free_together(self, configurations: Sequence[ArmConfiguration]) -> bool:
        """Return whether nothing collides when every arm takes its configuration."""
        self.body_checks += 1
        self.world.set_object(self.maps[0].T_world_object)
        self.world.set_arms(configurations)
        return not self.world.collisions(self.arms)

    def _feasible(self, k: int, cell: Cell) -> list[ArmConfiguration]:
        """Return every feasible configuration of an arm at a cell, the other robots at home."""
        arm, m = self.arms[k], self.maps[k]
        for robot in self.world.scene.robots:
            self.world.park(robot)
        self.world.set_object(m.T_world_object)
        h, theta = m.manifold.h[cell.row], m.manifold.theta[cell.column]
        standoff = arm.hand.standoff(float(m.manifold.profile.radius(h)))
        tool = grasp_to_tool(m.T_world_object, h, theta, ROLLS[cell.roll], standoff)
        opening = float(m.opening[cell.row])
        candidates = self._checker(k).candidates(inverse(arm.robot.T_world_base) @ tool, opening)
        return [ArmConfiguration(arm, c.q, opening) for c in candidates if c.reason == Reason.FEASIBLE]

    def _make_checker(self, k: int) -> CandidateChecker:
        settings = self.world.scene.settings
        arm = self.arms[k]
        return CandidateChecker(self.world, arm, solver_for(arm, settings.redundancy), settings.approach)
