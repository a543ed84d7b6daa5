"""The arrays of a feasibility map while it is being computed."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import Solver
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.poses import Array
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.world import Collision

__all__ = ["Index", "MapDraft", "without_candidates"]

Index = tuple[int, ...] | tuple[np.ndarray, ...]
"""One cell (roll, row, column), or m cells as three integer arrays (m,)."""


def without_candidates(ik: Solver) -> Reason:
    """Return the reason of a cell without a candidate: out of reach, or not found by a search."""
    return Reason.UNREACHABLE if ik.complete else Reason.NOT_FOUND


class MapDraft:
    """A map that is filled cell by cell; every cell starts as one without a candidate.

    Args:
        arm: the arm.
        manifold: the grid.
        opening: (H,) opening of the hand (m) at each height.
        ik: its inverse kinematics.

    Attributes:
        manifold: the grid.
        opening: (H,) opening of the hand (m) at each height.
        no_candidate: the reason of a cell without a candidate, see `without_candidates`.
        reason: (R, H, A) uint8 of `Reason`.
        proven: (R, H, A) bool, see `FeasibilityMap`.
        resolution: see `FeasibilityMap`.
    """

    def __init__(self, arm: Arm, manifold: Manifold, opening: Array, ik: Solver) -> None:
        shape = (len(ROLLS), manifold.heights, manifold.angles)
        self.manifold, self.opening = manifold, opening
        self._arm, self._phi = arm, ik.phi
        self.no_candidate = without_candidates(ik)
        self.reason = np.full(shape, self.no_candidate, dtype=np.uint8)
        self.proven, self.resolution = np.zeros(shape, dtype=bool), 0.0
        self._q = np.full((*shape, arm.dof), np.nan)
        self._sample = np.full(shape, -1, dtype=np.int32)
        self._branch = np.full(shape, -1, dtype=np.int16)
        self._clearance = np.full(shape, np.nan)
        self._pair = np.full((*shape, 2), -1, dtype=np.int16)
        self._depth = np.full(shape, np.nan)
        self._bodies: dict[str, int] = {}

    def body_index(self, name: str) -> int:
        """Return the index of a body in the map's list of names; a new name is added."""
        return self._bodies.setdefault(name, len(self._bodies))

    def add_phi(self, phi: Array) -> np.ndarray:
        """Add values (k,) of the redundancy (rad) to the samples; return what their indices (k,) are."""
        first = len(self._phi)
        self._phi = np.append(self._phi, phi)
        return np.arange(first, len(self._phi))

    def record_feasible(
        self,
        cells: Index,
        q: Array,
        sample: int | np.ndarray,
        branch: int | np.ndarray,
        clearance: float | Array = 0.0,
    ) -> None:
        """Record that cells are feasible, with the configurations that prove it.

        Args:
            cells: one cell, or m cells.
            q: (n,) or (m, n) joint values.
            sample: their redundancy samples.
            branch: their branches of the closed form.
            clearance: distance (m) that bodies which must not touch have at least.
        """
        self.reason[cells] = Reason.FEASIBLE
        self._q[cells], self._sample[cells], self._branch[cells] = q, sample, branch
        self._clearance[cells] = clearance
        self._pair[cells], self._depth[cells] = -1, np.nan

    def record_pairs(self, cells: Index, pair: np.ndarray, depth: Array) -> None:
        """Record which bodies spoil m cells.

        Args:
            cells: the cells.
            pair: (m, 2) bodies by `body_index`; the first hits the second.
            depth: (m,) how much closer (m) than allowed they are.
        """
        self._pair[cells], self._depth[cells] = pair, depth

    def record_failure(self, cell: Index, reason: Reason, collision: Collision | None) -> None:
        """Record why a cell is infeasible, with the two bodies where a collision is the reason."""
        self.reason[cell] = reason
        self._pair[cell], self._depth[cell] = -1, np.nan
        if collision:
            self._pair[cell] = [self.body_index(str(body)) for body in (collision.a, collision.b)]
            self._depth[cell] = collision.depth

    def finish(self, scene: str, task: Task) -> FeasibilityMap:
        """Return the map of a task in a scene of that name; what is recorded later does not change it."""
        return FeasibilityMap(
            scene=scene,
            arm=self._arm.name,
            task=task.name,
            T_world_object=task.T_world_object,
            manifold=self.manifold,
            reason=self.reason.copy(),
            q=self._q.copy(),
            sample=self._sample.copy(),
            branch=self._branch.copy(),
            clearance=self._clearance.copy(),
            phi=self._phi,
            opening=self.opening,
            bodies=tuple(self._bodies),
            pair=self._pair.copy(),
            depth=self._depth.copy(),
            proven=self.proven & (self.reason != Reason.FEASIBLE),
            resolution=self.resolution,
        )
