"""Input and result of the search that covers the redundancy, and the arrays that it works on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.engine.redundancy.undecided import Undecided
from symgrasp.ik.at_phi import Locked
from symgrasp.ik.chain import Chain
from symgrasp.ik.spans import HALVES, MOST_SPANS, Spans, new_spans
from symgrasp.poses import Array

__all__ = [
    "FALLS",
    "GONE",
    "HITS",
    "MOST_UNDECIDED",
    "OUTSIDE",
    "SKIPPED",
    "SLOTS",
    "STOPS",
    "TOUCHES",
    "UNSURE",
    "CoverInput",
    "CoverResult",
    "Nodes",
    "new_nodes",
]

GONE, OUTSIDE, HITS, FALLS, STOPS, TOUCHES, UNSURE, SKIPPED = range(8)
"""States of a branch at a value of φ: it does not exist, is outside the limits, collides, the robot falls, no
branch leads on along the retreat, pieces overlap by less than PyBullet may be off, only PyBullet can decide
for another reason, or it is excluded all around there."""

MOST_UNDECIDED = 512
"""Largest number of undecided candidates of a cell that are listed."""

SLOTS = 32
"""Values of the redundancy that are kept at a time: both ends of a part that is halved again and again."""

PLANNED = 2 + 5 * HALVES * MOST_SPANS + 64
"""Values of the redundancy with which the search of a cell begins, at most."""


class CoverInput(NamedTuple):
    """What to cover.

    Attributes:
        cells: (c,) the cells, as indices into those of the search.
        locked: the locked joint.
        inner: bodies inside the pieces, see `inner_pieces`.
        step: width (rad) of parts of the range of φ to begin with, at most.
    """

    cells: np.ndarray
    locked: Locked
    inner: tuple[PackedPieces, ...]
    step: float


class CoverResult(NamedTuple):
    """What was found for each of c cells.

    Attributes:
        found: (c,) whether a free configuration was found.
        q: (c, n) its joint values.
        phi: (c,) its redundancy (rad).
        branch: (c,) its branch.
        clearance: (c,) lower bound of its clearance (m).
        proven: (c,) whether it is proven that there is none.
        left: (c,) width (rad) of the widest part of the range that was neither excluded nor halved, or of
            whose middle PyBullet is not asked; pieces that overlap all along a part exclude it, whatever
            PyBullet says.
        visited: (c,) number of values of the redundancy at which candidates were checked.
        undecided: the candidates that only PyBullet can decide, `MOST_UNDECIDED` at most.
        overlapping: those of them whose pieces overlap, although PyBullet may not say so; as many.
    """

    found: np.ndarray
    q: Array
    phi: Array
    branch: np.ndarray
    clearance: Array
    proven: np.ndarray
    left: Array
    visited: np.ndarray
    undecided: Undecided
    overlapping: Undecided


class Nodes(NamedTuple):
    """Candidates at some values of the redundancy, B branches each.

    Attributes:
        chain: the arm, with a geometry (1, m) that is overwritten.
        phi: (SLOTS,) the values (rad).
        q: (SLOTS, B, n) joint values.
        state: (SLOTS, B) what is the matter with a branch.
        step: (SLOTS, B) where: 0 at the grasp, then the steps of the retreat from 1.
        missing: (SLOTS, B) see `symgrasp.ik.branches.Memory`.
        there: (SLOTS, B, n) joint values at that step, if it is not the grasp; where no branch leads on,
            those at the step before.
        onward: (SLOTS, B, B, n) joint values of all branches at the step to which none leads on.
        absent: (SLOTS, B, B) which of them do not exist.
        lacking: (SLOTS, B, B) what is missing of them, see `symgrasp.ik.branches.Memory`.
        pair: (SLOTS, B, 2) the pieces of which the first hits the second; or the edge of the support over
            which the robot falls, and whether it bears the load.
        pose: (SLOTS, B, 2, 12) poses of the pieces.
        depth: (SLOTS, B) how deep (m) they collide at least, as far as it is known; or how far (m) the
            centre of mass is beyond the edge.
        level: (SLOTS, B) number of the bodies inside the pieces from which it is known.
        excluded: (SLOTS, B) which branches are excluded on the part that ends at a slot.
        stack: (SLOTS,) slots of the ends of parts.
        used: (SLOTS,) which slots are taken.
        reached: (1,) whether a branch existed at any of the values so far.
        spans: where branches reach the pose.
        planned: (PLANNED,) values of φ (rad) with which the search begins.
        end: (2, 12) poses of a pair of pieces at the other end of a part.
        placed: (2, 12) where the pieces of a pair were before it was looked at.
        half: (n,) joint values half way, or where Newton's method is.
        way: (n,) the way on from there.
        unlocked: (n,) that no joint is locked.
        middle: (12,) pose of a piece there.
    """

    chain: Chain
    phi: Array
    q: Array
    state: np.ndarray
    step: np.ndarray
    there: Array
    onward: Array
    absent: np.ndarray
    lacking: Array
    missing: Array
    pair: np.ndarray
    pose: Array
    depth: Array
    level: np.ndarray
    excluded: np.ndarray
    stack: np.ndarray
    used: np.ndarray
    reached: np.ndarray
    spans: Spans
    planned: Array
    end: Array
    placed: Array
    half: Array
    way: Array
    unlocked: np.ndarray
    middle: Array


def new_nodes(chain: Chain, locked: Locked, branches: int, joints: int) -> Nodes:
    """Return arrays for an arm with a locked joint and that many branches and joints."""
    return Nodes(
        chain=chain._replace(geometry=chain.geometry[:1].copy()),
        phi=np.empty(SLOTS),
        q=np.empty((SLOTS, branches, joints)),
        state=np.empty((SLOTS, branches), dtype=np.int8),
        step=np.zeros((SLOTS, branches), dtype=np.int64),
        there=np.empty((SLOTS, branches, joints)),
        onward=np.empty((SLOTS, branches, branches, joints)),
        absent=np.empty((SLOTS, branches, branches), dtype=bool),
        lacking=np.empty((SLOTS, branches, branches)),
        missing=np.empty((SLOTS, branches)),
        pair=np.empty((SLOTS, branches, 2), dtype=np.int64),
        pose=np.empty((SLOTS, branches, 2, 12)),
        depth=np.empty((SLOTS, branches)),
        level=np.empty((SLOTS, branches), dtype=np.int64),
        excluded=np.zeros((SLOTS, branches), dtype=bool),
        stack=np.empty(SLOTS, dtype=np.int64),
        used=np.zeros(SLOTS, dtype=bool),
        reached=np.zeros(1, dtype=bool),
        spans=new_spans(locked),
        planned=np.empty(PLANNED),
        end=np.empty((2, 12)),
        placed=np.empty((2, 12)),
        half=np.empty(joints),
        way=np.empty(joints),
        unlocked=np.zeros(joints, dtype=bool),
        middle=np.empty(12),
    )
