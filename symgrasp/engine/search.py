"""The compiled search of the cells of a map for the best free candidate, and for what blocks the others.

The pieces fixed to the tool (the hand, the last link) are placed by the tool pose alone. If they
collide, the cell has no free candidate; if not, their clearance bounds that of every candidate, and so does
that of links which hardly move to each other (see `symgrasp.engine.clearance_bound`). The search of a cell
ends at the first candidate that comes near these bounds, see `CLEARANCE_TOLERANCE`. Against each other and
against the object, which is round, the distances of the pieces fixed to the tool do not depend on the angle
θ: one check serves a whole row.

The result of a cell depends on its tool pose alone, not on the other cells.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from queue import SimpleQueue

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.collision.tree import Tree
from symgrasp.compiling import ENTRY, is_compiled, njit
from symgrasp.engine.balance import stands
from symgrasp.engine.checks import FREE_BAND, HIT_BAND, UNDECIDED, check_arm, check_row
from symgrasp.engine.kinematics import MovingPieces, Scratch, place_arm, place_hand
from symgrasp.engine.retreat_search import arm_retreats, copy_row, moved_along, tool_clearance, tool_retreats
from symgrasp.engine.search_types import (
    BLOCKED,
    FEASIBLE,
    HIT,
    LIMITS,
    RETREAT_UNDECIDED,
    UNBALANCED,
    UNDECIDED_KEPT,
    UNREACHABLE,
    Balance,
    BranchScratch,
    RowChecks,
    SearchInput,
    SearchResult,
    new_branches,
)
from symgrasp.engine.threads import in_parallel
from symgrasp.ik.branches import branches_at
from symgrasp.ik.chain import Chain
from symgrasp.ik.vectors import STRICT

__all__ = [
    "BLOCKED",
    "CLEARANCE_TOLERANCE",
    "FEASIBLE",
    "HIT",
    "LIMITS",
    "UNBALANCED",
    "UNDECIDED_KEPT",
    "UNREACHABLE",
    "Balance",
    "SearchInput",
    "SearchResult",
    "is_search_compiled",
    "search",
]


CLEARANCE_TOLERANCE = 2e-3
"""No candidate of a cell has a clearance that is larger than the best one's by more than this (m)."""


def search(
    chain: Chain,
    moving: MovingPieces,
    pieces: PackedPieces,
    tree: Tree,
    scratches: Sequence[Scratch],
    inputs: SearchInput,
    balance: Balance,
    joints: int,
) -> SearchResult:
    """Search cells on all cores.

    Args:
        chain: the arm's geometry for the inverse kinematics.
        moving: the pieces that the arm moves.
        pieces: all P pieces.
        tree: the boxes of the static pieces.
        scratches: the poses of all pieces and the boxes around them, for each thread that is to run; those of
            moving ones do not matter.
        inputs: the cells and what applies to all of them.
        balance: what decides whether the robot stands.
        joints: number n of joints.
    """
    m = len(inputs.T_base_tool)
    runs, steps = len(inputs.row), 1 + len(inputs.retreat)
    rows = RowChecks(
        gap=np.empty((runs, steps)),
        hit=np.full((runs, steps, 2), -1, dtype=np.int64),
        depth=np.full((runs, steps), np.nan),
    )
    result = SearchResult(
        status=np.zeros(m, dtype=np.uint8),
        pair=np.full((m, 2), -1, dtype=np.int32),
        depth=np.full(m, np.nan),
        q=np.full((m, joints), np.nan),
        solution=np.full((m, 2), -1, dtype=np.int16),
        clearance=np.full(m, np.nan),
        undecided_count=np.zeros(m, dtype=np.int32),
        undecided_q=np.empty((m, UNDECIDED_KEPT, joints)),
        undecided_solution=np.empty((m, UNDECIDED_KEPT, 2), dtype=np.int16),
        proven=np.zeros(m, dtype=bool),
        rows=rows,
    )
    idle: SimpleQueue[tuple[Scratch, BranchScratch]] = SimpleQueue()
    for scratch in scratches:
        idle.put((scratch, new_branches(chain, joints, steps - 1, len(moving.frame))))

    # The compiled code fills arrays made here: a Ctrl-C while numba wraps up results would crash.
    def search_part(part: int, wants_rows: bool) -> None:
        own = idle.get()
        try:
            _search_part(chain, moving, pieces, tree, *own, inputs, balance, rows, result, part, wants_rows)
        finally:
            idle.put(own)

    search_part(0, wants_rows=True)  # here, where Ctrl-C can interrupt its compiling
    in_parallel(partial(search_part, wants_rows=True), range(1, inputs.parts))
    in_parallel(partial(search_part, wants_rows=False), range(inputs.parts))
    return result


def is_search_compiled() -> bool:
    """Whether `search` runs at once on this machine, with nothing to compile."""
    return is_compiled(_search_part)


@njit(**ENTRY)
def _search_part(
    chain, moving, pieces, tree, scratch, branches, inputs, balance, rows, result, part, wants_rows
):
    """Write the row checks of one part; or with these its cells.

    Parts are interleaved, so that each has its share of easy and of hard cells.

    Args:
        scratch: `Scratch` of this thread alone.
        branches: `BranchScratch` of this thread alone.
        rows: receives the row checks, of all parts before the first cell is searched.
        result: receives what is found.
        part: index of the part.
        wants_rows: whether it is the row checks that are wanted.
    """
    m, runs = len(inputs.T_base_tool), len(inputs.row)
    if wants_rows:
        for run in range(part, runs, inputs.parts):
            _check_rows(moving, pieces, scratch, inputs, run, m // runs, branches.T, rows)
    else:
        for cell in range(part, m, inputs.parts):
            _search_cell(chain, moving, pieces, tree, scratch, branches, inputs, balance, rows, cell, result)


@njit(**STRICT)
def _check_rows(moving, pieces, scratch, inputs, run, length, T, rows):
    """Write the row checks of one run, at the grasp and at every step of the retreat; T is scratch (4, 4)."""
    for step in range(1 + len(inputs.retreat)):
        moved_along(inputs.T_base_tool[run * length], inputs.retreat[step - 1] if step else 0.0, T)
        place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
        rows.gap[run, step] = check_row(moving, pieces, scratch, inputs.clearance)
        if rows.gap[run, step] == -math.inf:
            rows.hit[run, step, 0], rows.hit[run, step, 1] = scratch.hit[0], scratch.hit[1]
            rows.depth[run, step] = scratch.depth[0]


@njit(**STRICT)
def _search_cell(chain, moving, pieces, tree, scratch, branches, inputs, balance, rows, cell, result):
    """Search one cell and write its result."""
    if inputs.beyond[cell]:
        result.proven[cell] = True
        return
    T = inputs.T_base_tool[cell]
    run = cell * len(inputs.row) // len(inputs.T_base_tool)
    q, exists, inside = branches.q[0], branches.exists[0], branches.inside[0]
    hand = math.nan  # clearance of the pieces fixed to the tool; NaN until a candidate needs it
    best = -math.inf
    elbow_reaches = retreat_known = False
    tool = FEASIBLE
    for k in inputs.sample_order:
        elbow_reaches |= branches_at(chain, k, T, True, q, exists, inside, branches.memory)
        for b in range(len(inside)):
            if not inside[b]:
                continue
            if len(balance.edges):
                place_arm(moving, pieces, scratch, q[b])
                if not stands(balance, scratch.frames, inputs.T_world_base, T, inputs.row[run], True):
                    if math.isnan(hand):
                        result.status[cell] = UNBALANCED
                    continue
            if math.isnan(hand):
                result.status[cell] = HIT
                hand = tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, T)
                if hand == -math.inf:
                    _name_pair(scratch, result, cell)
                    result.proven[cell] = True
                    return
                scratch.hit[2] = -1
            place_arm(moving, pieces, scratch, q[b])
            wanted = best + CLEARANCE_TOLERANCE
            gap = check_arm(moving, pieces, tree, scratch, inputs.margin, hand, wanted, HIT_BAND)
            if gap == -math.inf:
                if result.pair[cell, 0] < 0 and result.status[cell] == HIT:
                    _name_pair(scratch, result, cell)
                continue
            if gap != UNDECIDED and len(inputs.retreat):
                if not retreat_known:
                    retreat_known = True
                    tool = tool_retreats(moving, pieces, tree, scratch, branches, inputs, rows, run, T)
                furthest = arm_retreats(
                    chain, moving, pieces, tree, scratch, branches, inputs, balance, run, T, k, b, tool
                )  # fmt: skip
                place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
                if furthest == BLOCKED:
                    if result.status[cell] == HIT:
                        result.status[cell] = BLOCKED
                        _name_pair(scratch, result, cell)
                    if tool == BLOCKED:  # which all candidates are then
                        result.undecided_count[cell] = 0
                        result.proven[cell] = True
                        return
                    continue
                if furthest == RETREAT_UNDECIDED:
                    gap = UNDECIDED
            if gap == UNDECIDED:
                _list_undecided(result, cell, q[b], k, b)
            elif gap > best:
                best = gap
                copy_row(q[b], result.q[cell])
                result.solution[cell, 0], result.solution[cell, 1] = k, b
        if best > -math.inf and best >= hand - CLEARANCE_TOLERANCE:
            break
    if best > -math.inf:
        result.status[cell] = FEASIBLE
        result.clearance[cell] = max(0.0, best - FREE_BAND)
    elif (
        result.status[cell] == UNREACHABLE
        and elbow_reaches
        and _reaches(chain, T, q, exists, inside, branches.memory)
    ):
        result.status[cell] = LIMITS


@njit(**STRICT)
def _name_pair(scratch, result, cell):
    """Record the pair found colliding last as what blocks a cell."""
    result.pair[cell, 0], result.pair[cell, 1] = scratch.hit[0], scratch.hit[1]
    result.depth[cell] = scratch.depth[0]


@njit(**STRICT)
def _list_undecided(result, cell, q, k, b):
    """Record an undecided candidate of a cell, with its redundancy sample k and branch b."""
    kept = result.undecided_count[cell]
    result.undecided_count[cell] += 1
    if kept < UNDECIDED_KEPT:
        copy_row(q, result.undecided_q[cell, kept])
        result.undecided_solution[cell, kept, 0], result.undecided_solution[cell, kept, 1] = k, b


@njit(**STRICT)
def _reaches(chain, T, q, exists, inside, memory):
    """Whether any branch reaches a pose, inside the limits or not."""
    for k in range(len(chain.geometry)):
        branches_at(chain, k, T, False, q, exists, inside, memory)
        for b in range(len(exists)):
            if exists[b]:
                return True
    return False
