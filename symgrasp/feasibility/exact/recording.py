"""Writes what the compiled search found into the draft of a map."""

from __future__ import annotations

import numpy as np

from symgrasp.engine import search
from symgrasp.engine.redundancy.cover_types import CoverResult
from symgrasp.feasibility.creation.map_draft import MapDraft
from symgrasp.feasibility.exact.scene_bodies import FixedBodies, PieceBodies
from symgrasp.reason import Reason

__all__ = ["record_cover", "record_search"]


def record_search(
    draft: MapDraft,
    bodies: PieceBodies,
    found: search.SearchResult,
    cells: tuple[np.ndarray, ...],
    fixed: FixedBodies,
) -> None:
    """Write down what the search found for m cells, before PyBullet decides the open ones.

    Args:
        draft: the map.
        bodies: what its pieces are called.
        found: for each of m cells.
        cells: rolls, rows and columns (m,) of these cells.
        fixed: the bodies that the arm does not move: where they collide, they are what spoils a cell.
    """

    def those(chosen: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(part[chosen] for part in cells)

    status = found.status
    draft.reason[cells] = np.where(status == search.LIMITS, Reason.JOINT_LIMITS, draft.no_candidate)
    draft.reason[those(status == search.UNBALANCED)] = Reason.OUT_OF_BALANCE
    feasible = status == search.FEASIBLE
    sample, branch = found.solution[feasible].T
    draft.record_feasible(those(feasible), found.q[feasible], sample, branch, found.clearance[feasible])
    blocked = status == search.BLOCKED
    hit = (status == search.HIT) | blocked
    named = hit & (found.pair[:, 0] >= 0)
    draft.reason[those(named)] = bodies.reason[found.pair[named, 1]]
    draft.record_pairs(those(named), bodies.number[found.pair[named]], found.depth[named])
    draft.reason[those(blocked)] = Reason.APPROACH_BLOCKED
    if fixed.collision is not None:
        for cell in zip(*those(hit), strict=True):
            draft.record_failure(cell, fixed.collision.reason, fixed.collision)


def record_cover(draft: MapDraft, covered: CoverResult, cells: tuple[np.ndarray, ...]) -> None:
    """Write what the search of all of the redundancy found for cells: rolls, rows and columns, (c,) each."""
    free = covered.found
    draft.record_feasible(
        tuple(part[free] for part in cells),
        covered.q[free],
        draft.add_phi(covered.phi[free]),
        covered.branch[free],
        covered.clearance[free],
    )
    draft.proven[tuple(part[covered.proven] for part in cells)] = True
    draft.resolution = max(draft.resolution, float(covered.left.max(initial=0.0)))
