"""Candidates that certificates leave open: PyBullet decides them, by the functions of the reference."""

from __future__ import annotations

import numpy as np

from symgrasp.engine.broad_phase import mark_near
from symgrasp.engine.checks import FREE_BAND
from symgrasp.engine.geometry import ArmGeometry
from symgrasp.engine.kinematics import Scratch
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.creation.map_draft import MapDraft
from symgrasp.ik import Solver
from symgrasp.poses import Array
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.world import BulletWorld, Collision, NearBodies

__all__ = ["OpenCandidates"]


class OpenCandidates:
    """Checks open candidates of an arm in PyBullet, against the bodies near enough to collide.

    Args:
        world: a world of the arm's scene.
        arm: the arm.
        geometry: its pieces.
        scratch: where they are; the object's are where it is in the world.
        opening: (H,) opening (m) of the hand in each row of a map.

    Attributes:
        holders: names of all arms that hold the object.
    """

    def __init__(
        self, world: BulletWorld, arm: Arm, geometry: ArmGeometry, scratch: Scratch, opening: Array
    ) -> None:
        self.holders: tuple[str, ...] = (arm.name,)
        self._world, self._name, self._opening = world, arm.robot.name, opening
        self._geometry, self._scratch = geometry, scratch
        self._T_world_base = np.ascontiguousarray(arm.robot.T_world_base)

    def decide(
        self,
        draft: MapDraft,
        cell: tuple[int, ...],
        T_base_tool: Array,
        ik: Solver,
        listed: list[tuple[Array, int, int]],
        phi: Array | None = None,
    ) -> bool:
        """Check the candidates of a cell until one is free, and record what becomes of the cell.

        Args:
            draft: the map.
            cell: the cell.
            T_base_tool: its tool pose (4, 4).
            ik: the solver of the candidates.
            listed: joint values, sample of that solver, and branch of each.
            phi: the samples of that solver (rad), where it is not the map's.

        Returns:
            Whether all candidates of the cell collide, listed or not.
        """
        checker = self._checker(ik, cell[1])
        before: Collision | None = None
        for q, sample, branch in listed:
            reason, collision, *_ = checker.check(T_base_tool, q, sample, float(self._opening[cell[1]]))
            if reason == Reason.FEASIBLE:
                if phi is not None:
                    sample = int(draft.add_phi(phi[sample : sample + 1])[0])
                draft.record_feasible(cell, q, sample, branch)
                return False
            if reason > draft.reason[cell]:
                draft.record_failure(cell, reason, collision)
            if collision and self._with_tool(collision):
                if before and _same(before, collision):
                    return True  # like that, because the tool pose alone decides it
                before = collision
        return False

    def is_free(self, T_base_tool: Array, row: int, ik: Solver, q: Array, sample: int) -> bool:
        """Whether a candidate is free: its tool pose (4, 4), row, solver, joint values (n,) and sample."""
        result = self._checker(ik, row).check(T_base_tool, q, sample, float(self._opening[row]))
        return result.reason == Reason.FEASIBLE

    def _checker(self, ik: Solver, row: int) -> CandidateChecker:
        near = lambda q, T: self._near(q, T, row)  # noqa: E731
        approach = self._world.scene.settings.approach
        return CandidateChecker(self._world, ik.arm, ik, approach, near, self.holders)

    def _near(self, q: Array, T_base_tool: Array, row: int) -> tuple[NearBodies, list[str]]:
        """Return what is near the arm at joint values (n,), and its links that are; the rest is free."""
        geometry, scratch = self._geometry, self._scratch
        near = np.zeros(len(geometry.names), dtype=bool)
        pairs = np.zeros(len(geometry.pairs), dtype=bool)
        reach = self._world.margin + FREE_BAND
        mark_near(
            geometry.moving_in(row), geometry.pieces, geometry.tree, scratch, self._T_world_base,
            T_base_tool, row, q, reach, near, pairs,
        )  # fmt: skip
        moving = len(geometry.moving.frame)
        marked = [(int(k), geometry.names[k]) for k in np.flatnonzero(near)]
        bodies = {name.body for k, name in marked if k >= moving}
        links = {name.link for k, name in marked if k < moving}
        return bodies | {geometry.pairs[k] for k in np.flatnonzero(pairs)}, sorted(links)

    def _with_tool(self, collision: Collision) -> bool:
        """Whether the tool pose alone decides a collision: no link but those fixed to the tool moves."""
        own = [body.link for body in (collision.a, collision.b) if body.body == self._name]
        return self._geometry.tool_links.issuperset(
            link for link in own if link in self._geometry.moving_links
        )


def _same(a: Collision, b: Collision) -> bool:
    return (a.a, a.b) == (b.a, b.b) and min(a.depth, b.depth) > 1e-6 and abs(a.depth - b.depth) < 1e-7
