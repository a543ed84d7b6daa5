"""The search of the cells of a map, compiled: which candidate of a cell is free, and what spoils the rest.

Bodies fixed to the tool (the hand, the last link) are placed by the tool pose alone. What they hit
ends the cell, and no candidate has a larger clearance than they have, so the first one that has as
much is best. Against each other and against the object, which is round, their distances are the same
all around: one check serves a whole row.

Whatever is found for a cell depends on its tool pose alone, not on its neighbours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from symgrasp.compiling import njit
from symgrasp.engine.checks import (
    FREE_BAND,
    UNDECIDED,
    MovingBodies,
    check_arm,
    check_hand,
    check_round,
    new_scratch,
    place_arm,
    place_hand,
)
from symgrasp.engine.solids import Solids
from symgrasp.engine.tree import Tree
from symgrasp.ik.branches import BRANCHES, STRICT, branches_at
from symgrasp.ik.chain import Chain
from symgrasp.ik.retreat import RETREAT_TURN
from symgrasp.poses import Array

__all__ = [
    "BLOCKED",
    "FEASIBLE",
    "HIT",
    "LIMITS",
    "OPEN_KEPT",
    "UNREACHABLE",
    "SearchInput",
    "SearchResult",
    "search",
]

OPEN_KEPT = 32
"""Undecided candidates of a cell that are listed; where there are more, all must be gone through."""

UNREACHABLE, LIMITS, HIT, BLOCKED, OPEN, FEASIBLE = 0, 1, 2, 3, 4, 5
"""What became of a cell: BLOCKED on the retreat. Of a candidate: OPEN means PyBullet must decide."""


class SearchInput(NamedTuple):
    """What is asked. Cells come in runs: all those of one row and roll, r runs of the same length.

    Attributes:
        order: (K,) redundancy samples, most promising first.
        T_world_base: (4, 4).
        T_base_tool: (m, 4, 4) tool poses of the cells.
        row: (r,) row of each run.
        retreat: (s,) displacements (m) along the approach that must be free as well, in order.
        margin: distance (m) to keep from what stands still.
        clearance: clearances (m) from this on are all the same.
        blocked: whether what stands still collides already, whatever the arm does.
        parts: number of parts to split the cells into.
    """

    order: np.ndarray
    T_world_base: Array
    T_base_tool: Array
    row: np.ndarray
    retreat: Array
    margin: float
    clearance: float
    blocked: bool
    parts: int


class SearchResult(NamedTuple):
    """What was found, for each of m cells.

    Attributes:
        status: (m,) one of the values above, never OPEN: where it is not FEASIBLE and candidates are
            undecided, it is that of the others.
        pair: (m, 2) pieces of which the first hits the second, -1 where none is known.
        depth: (m,) how much closer (m) than allowed they are at least.
        q: (m, n) of the best candidate.
        pick: (m, 2) its redundancy sample and branch.
        clearance: (m,) its clearance (m) at least.
        open_count: (m,) number of undecided candidates.
        open_q: (m, OPEN_KEPT, n) the first of them.
        open_pick: (m, OPEN_KEPT, 2) their redundancy samples and branches.
    """

    status: np.ndarray
    pair: np.ndarray
    depth: Array
    q: Array
    pick: np.ndarray
    clearance: Array
    open_count: np.ndarray
    open_q: Array
    open_pick: np.ndarray


class _Around(NamedTuple):
    """What is the same all around the object, for each run at the grasp and at each step of the retreat.

    Attributes:
        gap: (r, 1 + s) clearance (m), UNDECIDED, or -inf.
        hit: (r, 1 + s, 2) the pair that collides.
        depth: (r, 1 + s) how much closer (m) than allowed they are at least.
    """

    gap: Array
    hit: np.ndarray
    depth: Array


class _Branches(NamedTuple):
    """Scratch for `branches_at`, at the grasp and on the retreat; where the retreat is, and its tool pose."""

    q: Array
    exists: np.ndarray
    inside: np.ndarray
    at: Array
    T: Array


def search(
    chain: Chain, body: MovingBodies, solids: Solids, tree: Tree, pose: Array, goals: SearchInput, joints: int
) -> SearchResult:
    """Search cells, on all cores.

    Args:
        chain: the arm's geometry for the inverse kinematics.
        body: what moves.
        solids: all pieces.
        tree: those that stand still.
        pose: (P, 12) of all pieces; those of moving ones do not matter.
        goals: what is asked.
        joints: number of joints n.
    """
    m = len(goals.T_base_tool)
    found = SearchResult(
        status=np.zeros(m, dtype=np.uint8),
        pair=np.full((m, 2), -1, dtype=np.int32),
        depth=np.full(m, np.nan),
        q=np.full((m, joints), np.nan),
        pick=np.full((m, 2), -1, dtype=np.int16),
        clearance=np.full(m, np.nan),
        open_count=np.zeros(m, dtype=np.int32),
        open_q=np.empty((m, OPEN_KEPT, joints)),
        open_pick=np.empty((m, OPEN_KEPT, 2), dtype=np.int16),
    )
    # Nothing is returned from compiled code: a Ctrl-C while numba wraps up results crashes the process.
    _search(chain, body, solids, tree, pose, goals, found)
    return found


@njit(cache=True, error_model="numpy", parallel=True, nogil=True)
def _search(chain, body, solids, tree, pose, goals, found):
    m, n, runs, steps = len(goals.T_base_tool), chain.limits.shape[1], len(goals.row), 1 + len(goals.retreat)
    around = _Around(
        np.empty((runs, steps)), np.full((runs, steps, 2), -1, dtype=np.int64), np.full((runs, steps), np.nan)
    )
    for part in prange(goals.parts):
        scratch = new_scratch(pose, solids, n)
        T = np.empty((4, 4))
        for run in range(part, runs, goals.parts):
            _go_around(body, solids, scratch, goals, run, m // runs, T, around)
    for part in prange(goals.parts):
        scratch = new_scratch(pose, solids, n)
        branches = _Branches(
            np.empty((2, BRANCHES, n)),
            np.empty((2, BRANCHES), dtype=np.bool_),
            np.empty((2, BRANCHES), dtype=np.bool_),
            np.empty(n),
            np.empty((4, 4)),
        )
        # Dealt out like cards, so that every part has its share of easy and of hard cells.
        for cell in range(part, m, goals.parts):
            _cell(chain, body, solids, tree, scratch, branches, goals, around, cell, found)


@njit(**STRICT)
def _go_around(body, solids, scratch, goals, run, length, T, around):
    for step in range(1 + len(goals.retreat)):
        _step(goals.T_base_tool[run * length], goals.retreat[step - 1] if step else 0.0, T)
        place_hand(body, solids, scratch, goals.T_world_base, T, goals.row[run])
        around.gap[run, step] = check_round(body, solids, scratch, goals.clearance)
        if around.gap[run, step] == -math.inf:
            around.hit[run, step, 0], around.hit[run, step, 1] = scratch.hit[0], scratch.hit[1]
            around.depth[run, step] = scratch.depth[0]


@njit(**STRICT)
def _step(T, distance, out):
    """Move a tool pose along its approach."""
    for i in range(3):
        for j in range(3):
            out[i, j] = T[i, j]
        out[i, 3] = T[i, 2] * distance + T[i, 3]


@njit(**STRICT)
def _cell(chain, body, solids, tree, scratch, branches, goals, around, cell, found):
    """Search one cell."""
    T = goals.T_base_tool[cell]
    run = cell * len(goals.row) // len(goals.T_base_tool)
    q, exists, inside = branches.q[0], branches.exists[0], branches.inside[0]
    hand = math.nan  # the clearance of what is fixed to the tool, once it is needed
    best = -math.inf
    swings = steps_known = steps_free = False
    for k in goals.order:
        swings |= branches_at(
            chain.geometry, chain.joint, chain.limits, chain.forward, k, T, True, q, exists, inside
        )
        for b in range(BRANCHES):
            if not inside[b]:
                continue
            if math.isnan(hand):
                found.status[cell] = HIT
                hand = _hand(body, solids, tree, scratch, goals, around, run, 0, T)
                if hand == -math.inf:
                    _name(scratch, found, cell)
                    return
                scratch.hit[2] = -1
            place_arm(body, solids, scratch, q[b])
            gap = check_arm(body, solids, tree, scratch, goals.margin, hand, best)
            if gap == -math.inf:
                if found.pair[cell, 0] < 0 and found.status[cell] == HIT:
                    _name(scratch, found, cell)
                continue
            if gap != UNDECIDED and len(goals.retreat):
                if not steps_known:
                    steps_known, steps_free = (
                        True,
                        _hand_retreats(body, solids, tree, scratch, branches, goals, around, run, T),
                    )
                furthest = _retreats(
                    chain, body, solids, tree, scratch, branches, goals, around, run, T, k, b, steps_free
                )
                place_hand(body, solids, scratch, goals.T_world_base, T, goals.row[run])
                if furthest == BLOCKED:
                    if found.status[cell] == HIT:
                        found.status[cell] = BLOCKED
                        _name(scratch, found, cell)
                    continue
                if furthest == OPEN:
                    gap = UNDECIDED
            if gap == UNDECIDED:
                _list(found, cell, q[b], k, b)
            elif gap > best:
                best = gap
                _copy(q[b], found.q[cell])
                found.pick[cell, 0], found.pick[cell, 1] = k, b
        if best > -math.inf and best >= hand:
            break
    if best > -math.inf:
        found.status[cell] = FEASIBLE
        found.clearance[cell] = max(0.0, best - FREE_BAND)
    elif math.isnan(hand) and swings and _reaches(chain, T, q, exists, inside):
        found.status[cell] = LIMITS


@njit(**STRICT)
def _name(scratch, found, cell):
    found.pair[cell, 0], found.pair[cell, 1] = scratch.hit[0], scratch.hit[1]
    found.depth[cell] = scratch.depth[0]


@njit(**STRICT)
def _list(found, cell, q, k, b):
    kept = found.open_count[cell]
    found.open_count[cell] += 1
    if kept < OPEN_KEPT:
        _copy(q, found.open_q[cell, kept])
        found.open_pick[cell, kept, 0], found.open_pick[cell, kept, 1] = k, b


@njit(**STRICT)
def _hand(body, solids, tree, scratch, goals, around, run, step, T):
    """Place what is fixed to the tool; return its clearance (m), UNDECIDED, or -inf."""
    place_hand(body, solids, scratch, goals.T_world_base, T, goals.row[run])
    if goals.blocked:
        scratch.hit[0] = -1
        return -math.inf
    if around.gap[run, step] == -math.inf:
        scratch.hit[0], scratch.hit[1] = around.hit[run, step, 0], around.hit[run, step, 1]
        scratch.depth[0] = around.depth[run, step]
        return -math.inf
    return check_hand(body, solids, tree, scratch, goals.margin, around.gap[run, step])


@njit(**STRICT)
def _reaches(chain, T, q, exists, inside):
    """Whether any branch reaches a pose, inside the limits or not."""
    for k in range(len(chain.geometry)):
        branches_at(chain.geometry, chain.joint, chain.limits, chain.forward, k, T, False, q, exists, inside)
        for b in range(BRANCHES):
            if exists[b]:
                return True
    return False


# -- retreat --------------------------------------------------------------------------------


@njit(**STRICT)
def _hand_retreats(body, solids, tree, scratch, branches, goals, around, run, T):
    """Whether what is fixed to the tool is certified free at every step of the retreat."""
    moved = branches.T
    for s in range(len(goals.retreat)):
        _step(T, goals.retreat[s], moved)
        if _hand(body, solids, tree, scratch, goals, around, run, s + 1, moved) <= UNDECIDED:
            return False
    return True


@njit(**STRICT)
def _retreats(chain, body, solids, tree, scratch, branches, goals, around, run, T, k, b, hand_free):
    """Follow a candidate along the retreat, as the reference does: FEASIBLE, BLOCKED or OPEN."""
    q, exists, inside, at = branches.q[1], branches.exists[1], branches.inside[1], branches.at
    moved = branches.T
    _copy(branches.q[0][b], at)
    furthest = FEASIBLE
    for s in range(len(goals.retreat)):
        _step(T, goals.retreat[s], moved)
        scratch.hit[0] = scratch.hit[2] = -1
        branches_at(
            chain.geometry, chain.joint, chain.limits, chain.forward, k, moved, True, q, exists, inside
        )
        if not _follow(chain.limits, q, inside, at):
            furthest = BLOCKED
            break
        gap = 0.0  # how much room there is does not matter here
        if hand_free:
            place_hand(body, solids, scratch, goals.T_world_base, moved, goals.row[run])
        else:
            gap = min(gap, _hand(body, solids, tree, scratch, goals, around, run, s + 1, moved))
        if gap != -math.inf:
            place_arm(body, solids, scratch, at)
            gap = check_arm(body, solids, tree, scratch, goals.margin, gap, -math.inf)
        if gap == -math.inf:
            furthest = BLOCKED
            break
        if gap == UNDECIDED:
            # A later step may still be certified to collide, but PyBullet will find that as well.
            furthest = OPEN
            break
    scratch.hit[2] = -1
    return furthest


@njit(**STRICT)
def _follow(limits, q, inside, at):
    """Write the configuration nearest to ``at`` into it; return whether it is near enough."""
    nearest, least = -1, math.inf
    for b in range(BRANCHES):
        if inside[b]:
            turn = 0.0
            for j in range(len(at)):
                # A joint that turns further than once around goes on from where it is.
                near = q[b, j] + 2 * math.pi * np.round((at[j] - q[b, j]) / (2 * math.pi))
                if limits[0, j] <= near <= limits[1, j]:
                    q[b, j] = near
                turn = max(turn, abs(q[b, j] - at[j]))
            if turn < least:
                nearest, least = b, turn
    if nearest < 0 or least > RETREAT_TURN:
        return False
    _copy(q[nearest], at)
    return True


@njit(**STRICT)
def _copy(row, out):
    for j in range(len(row)):
        out[j] = row[j]
