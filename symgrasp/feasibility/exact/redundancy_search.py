"""The search of all of an arm's redundancy: for cells at whose samples nothing is free, and for windows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial

import numpy as np

from symgrasp.collision.inner_pieces import inner_pieces
from symgrasp.collision.pieces import PackedPieces
from symgrasp.engine import search
from symgrasp.engine.geometry import ArmGeometry
from symgrasp.engine.kinematics import Scratch
from symgrasp.engine.reach import Reach, reach_of
from symgrasp.engine.redundancy.cover import cover
from symgrasp.engine.redundancy.cover_types import CoverInput, CoverResult
from symgrasp.engine.redundancy.out_of_reach import out_of_reach
from symgrasp.engine.redundancy.windows import windows
from symgrasp.engine.search_types import RowChecks
from symgrasp.feasibility.cell import Window
from symgrasp.feasibility.creation.map_draft import MapDraft
from symgrasp.feasibility.exact.batches import Batch
from symgrasp.feasibility.exact.open_candidates import OpenCandidates
from symgrasp.feasibility.exact.settling import settled, with_witness
from symgrasp.ik.at_phi import Locked
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm

__all__ = ["RedundancySearch"]

STEP = 0.75
"""Width (rad) of the parts of the range of the redundancy with which the search begins, at most."""

MOST_OVERLAPPING = 32
"""Candidates of a cell at most that PyBullet is asked for between the samples although their pieces overlap,
by so little that it may call them free. There are hundreds where a link all but touches a body all along."""

MOST_AT_ONCE = 32
"""Candidates that PyBullet checks between two pauses, at most."""


class RedundancySearch:
    """Searches all of the redundancy of one arm.

    Args:
        arm: the arm.
        geometry: its pieces.
        open_candidates: what PyBullet decides.
    """

    def __init__(self, arm: Arm, geometry: ArmGeometry, open_candidates: OpenCandidates) -> None:
        self._arm, self._geometry, self._open = arm, geometry, open_candidates

    @cached_property
    def _reach(self) -> Reach:
        return reach_of(self._arm)

    @cached_property
    def _inner(self) -> tuple[PackedPieces, ...]:
        return inner_pieces(self._geometry.pieces)

    def out_of_reach(self, batch: Batch, locked: Locked, tools: Array) -> np.ndarray:
        """Return which tool poses (m, 4, 4) are proven to be out of reach, whatever the redundancy is."""
        return out_of_reach(batch.compiled.chain, locked, self._reach, tools)

    def cover(
        self,
        rows: RowChecks,
        which: np.ndarray,
        locked: Locked,
        inputs: search.SearchInput,
        batch: Batch,
        scratches: Sequence[Scratch],
    ) -> CoverResult:
        """Search for free configurations of cells, see `symgrasp.engine.redundancy.cover`.

        Args:
            rows: what the search of samples found out about its rows.
            which: (c,) the cells, as indices into those of that search.
            locked: the joint that is the redundancy.
            inputs, batch, scratches: of that search.
        """
        geometry = self._geometry
        return cover(
            batch.compiled.chain,
            batch.moving,
            geometry.pieces,
            geometry.tree,
            scratches,
            inputs,
            geometry.balance,
            rows,
            self._covered(which, locked),
            self._arm.dof,
        )

    def decide(
        self,
        draft: MapDraft,
        covered: CoverResult,
        T_base_tool: Array,
        batch: Batch,
        cells: tuple[np.ndarray, ...],
    ) -> Iterator[None]:
        """Let PyBullet check what `cover` left open; pause after some candidates.

        Args:
            draft: the map, in which it is written.
            covered: what was found for c cells.
            T_base_tool: (c, 4, 4) their tool poses.
            batch: of the search.
            cells: their rolls, rows and columns, (c,) each.
        """
        for k in np.flatnonzero(~covered.found & (covered.undecided.number + covered.overlapping.number > 0)):
            cell = tuple(int(part[k]) for part in cells)
            if draft.reason[cell] == Reason.FEASIBLE:
                continue
            every, branches = _asked(covered, int(k))
            for first in range(0, len(every), MOST_AT_ONCE):
                phi, branch = (part[first : first + MOST_AT_ONCE] for part in (every, branches))
                ik = batch.compiled.at(phi)
                s = ik.solve(T_base_tool[k])
                these = np.flatnonzero((s.branch == branch[s.sample]) & s.inside)
                listed = [(s.q[j], int(s.sample[j]), int(s.branch[j])) for j in these]
                by_tool = self._open.decide(draft, cell, T_base_tool[k], ik, listed, phi)
                yield
                if by_tool or draft.reason[cell] == Reason.FEASIBLE:
                    break

    def windows(
        self,
        inputs: search.SearchInput,
        batch: Batch,
        locked: Locked,
        scratches: Sequence[Scratch],
        witnesses: Sequence[tuple[int, float] | None],
        *,
        settle: bool,
        progress: Progress | None = None,
    ) -> Iterator[tuple[Window, ...]]:
        """Yield the windows of cells, see `symgrasp.engine.redundancy.windows`.

        Args:
            inputs: the cells, each a run of its own.
            batch: their inverse kinematics and pieces.
            locked: the joint that is the redundancy.
            scratches: of the threads.
            witnesses: branch and φ (rad) of the witness of each cell, None of cells without.
            settle: whether PyBullet decides what pieces that all but touch leave open, at the ends of
                windows; else only where nothing else is free.
            progress: called with the finished share, also before every question to PyBullet, of which a cell
                may need many; may raise `Cancelled`.
        """
        geometry, tools = self._geometry, inputs.T_base_tool
        parts = batch.compiled.chain, batch.moving, geometry.pieces, geometry.tree, scratches, inputs
        rows = search.search(*parts, geometry.balance, self._arm.dof).rows
        covered = self._covered(np.arange(len(tools)), locked)
        own = windows(*parts, geometry.balance, rows, covered, self._arm.dof)
        for k in range(len(tools)):
            n = int(own.found[k])
            columns = own.branch[k, :n], *own.ends[k, :n].T, own.whole[k, :n]
            listed = [Window(*row) for row in zip(*(c.tolist() for c in columns), strict=True)]
            if settle or not listed:
                phi, branch = own.undecided.of(k)
                left = [*zip(branch.tolist(), phi.tolist(), strict=True), *filter(None, [witnesses[k]])]
                tell = progress and partial(progress, k / len(tools))
                is_free = partial(self._is_free, batch, tools[k], int(inputs.row[k]), tell)
                found = settled(listed, left, is_free, (locked.lower, locked.upper))
            else:
                found = tuple(sorted(listed))
            yield with_witness(found, witnesses[k])

    def _covered(self, which: np.ndarray, locked: Locked) -> CoverInput:
        return CoverInput(which, locked, self._inner, STEP)

    def _is_free(
        self,
        batch: Batch,
        T_base_tool: Array,
        row: int,
        tell: Callable[[], None] | None,
        branch: int,
        phi: float,
    ) -> bool:
        """Whether a branch is free at a value of φ (rad), as PyBullet says; tells the progress first."""
        if tell:
            tell()
        ik = batch.compiled.at(np.array([phi]))
        s = ik.solve(T_base_tool)
        these = np.flatnonzero((s.branch == branch) & s.inside)
        return any(self._open.is_free(T_base_tool, row, ik, s.q[j], int(s.sample[j])) for j in these)


def _asked(covered: CoverResult, k: int) -> tuple[Array, np.ndarray]:
    """Return the redundancy (rad) and the branch of the candidates of cell k that PyBullet decides."""
    phi, branch = covered.undecided.of(k)
    some, other = covered.overlapping.of(k)
    if len(some) > MOST_OVERLAPPING:
        evenly = np.lexsort((some, other))[np.linspace(0, len(some) - 1, MOST_OVERLAPPING).astype(int)]
        some, other = some[evenly], other[evenly]
    return np.concatenate([phi, some]), np.concatenate([branch, other])
