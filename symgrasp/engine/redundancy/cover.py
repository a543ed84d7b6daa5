"""The search that covers the redundancy φ of infeasible cells: it steps over nothing that is free. Compiled.

The range of φ is divided into parts, and a part is halved until every branch is excluded on it (see
`symgrasp.engine.redundancy.exclusion`), or it is narrower than `FINEST`.

By how much curves bend is bounded by what is usual for arms, not by a proof: so an infeasible cell is
infeasible to the resolution of the parts that were left. What does not depend on φ is proven: a hand that
collides, and poses out of reach, which are not covered (see `symgrasp.engine.redundancy.out_of_reach`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from queue import SimpleQueue

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.collision.tree import Tree
from symgrasp.compiling import ENTRY, is_compiled, njit
from symgrasp.engine.checks import FREE_BAND, UNDECIDED
from symgrasp.engine.kinematics import MovingPieces, Scratch, place_hand
from symgrasp.engine.redundancy.candidates import (
    arm_gap,
    find_branches,
    is_to_check,
    plan_sought,
    plan_values,
    retreat_gap,
)
from symgrasp.engine.redundancy.cover_types import (
    MOST_UNDECIDED,
    TOUCHES,
    CoverInput,
    CoverResult,
    Nodes,
    new_nodes,
)
from symgrasp.engine.redundancy.crossings import SWING_STEPS, begin_swing, crosses, next_of_swing
from symgrasp.engine.redundancy.exclusion import EXCLUDED, TOUCHING, what_is_known
from symgrasp.engine.redundancy.undecided import new_undecided, note_undecided
from symgrasp.engine.retreat_search import copy_row, tool_clearance, tool_retreats
from symgrasp.engine.search_types import (
    BLOCKED,
    FEASIBLE,
    Balance,
    BranchScratch,
    RowChecks,
    SearchInput,
    new_branches,
)
from symgrasp.engine.threads import in_parallel
from symgrasp.ik.at_phi import geometry_at
from symgrasp.ik.branches import branch_count
from symgrasp.ik.chain import Chain
from symgrasp.ik.spans import prepare_spans
from symgrasp.ik.vectors import STRICT

__all__ = ["COARSE", "FINEST", "cover", "is_cover_compiled"]

FINEST = 1e-4
"""Width (rad) of a part of the range of φ that is not halved any more."""

COARSE = 3e-3
"""The same where a pair of pieces is excluded all along the part, but overlaps by so little that PyBullet may
call it free: PyBullet is not asked more often."""

ROOTS = 3
"""Roots of the closed form of arms with a spherical triple; each tells two branches apart."""

MOST_VISITED = 20_000
"""Values of φ of a cell after which the search gives up."""


def cover(
    chain: Chain,
    moving: MovingPieces,
    pieces: PackedPieces,
    tree: Tree,
    scratches: Sequence[Scratch],
    inputs: SearchInput,
    balance: Balance,
    rows: RowChecks,
    covered: CoverInput,
    joints: int,
) -> CoverResult:
    """Search all of φ for free configurations of some cells, on all cores.

    Args:
        chain, moving, pieces, tree, scratches, inputs, balance, joints: see `symgrasp.engine.search.search`.
        rows: the row checks of that search.
        covered: what to cover.
    """
    c = len(covered.cells)
    result = CoverResult(
        found=np.zeros(c, dtype=bool),
        q=np.full((c, joints), np.nan),
        phi=np.full(c, np.nan),
        branch=np.full(c, -1, dtype=np.int16),
        clearance=np.full(c, np.nan),
        proven=np.zeros(c, dtype=bool),
        left=np.zeros(c),
        visited=np.zeros(c, dtype=np.int64),
        undecided=new_undecided(c, MOST_UNDECIDED),
        overlapping=new_undecided(c, MOST_UNDECIDED),
    )
    idle: SimpleQueue[tuple[Nodes, Scratch, BranchScratch]] = SimpleQueue()
    for scratch in scratches:
        branches = new_branches(chain, joints, len(inputs.retreat), len(moving.frame))
        idle.put((new_nodes(chain, covered.locked, branch_count(chain), joints), scratch, branches))

    def cover_part(part: int) -> None:
        own = idle.get()
        try:
            _cover_part(*own, moving, pieces, tree, inputs, balance, rows, covered, result, part)
        finally:
            idle.put(own)

    cover_part(0)  # here, where Ctrl-C can interrupt its compiling
    in_parallel(cover_part, range(1, inputs.parts))
    return result


def is_cover_compiled() -> bool:
    """Whether `cover` runs at once on this machine, with nothing to compile."""
    return is_compiled(_cover_part)


@njit(**ENTRY)
def _cover_part(nodes, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, part):
    """Cover the cells of one part; parts are interleaved."""
    prepare_spans(nodes.spans, covered.locked)
    for i in range(part, len(covered.cells), inputs.parts):
        _cover_cell(nodes, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, i)


@njit(**STRICT)
def _cover_cell(nodes, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, i):
    """Cover one cell and write its result."""
    cell = covered.cells[i]
    T, run = inputs.T_base_tool[cell], cell * len(inputs.row) // len(inputs.T_base_tool)
    hand = tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, T)
    if hand == -math.inf:
        result.proven[i] = True
        return
    tool = FEASIBLE
    if len(inputs.retreat):
        tool = tool_retreats(moving, pieces, tree, scratch, branches, inputs, rows, run, T)
        place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
        if tool == BLOCKED:
            result.proven[i] = True
            return
    scratch.hit[2] = -1
    nodes.reached[0] = False
    those = i, T, inputs.row[run], hand, tool
    parts = nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those
    _cover_parts(*parts, plan_values(nodes, covered, T))
    if not (nodes.reached[0] or covered.locked.spherical):
        _cover_parts(*parts, plan_sought(nodes, branches, covered, T))


@njit(**STRICT)
def _cover_parts(
    nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those, planned
):
    """Cover a cell between planned values of φ, so many; stop at the first that is free."""
    i = those[0]
    nodes.used[:] = False
    if planned == 0:
        return
    left = _slot(nodes, nodes.planned[0])
    free = _visit(
        nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those, left,
        covered.step,
    )  # fmt: skip
    for k in range(1, planned):
        if free:
            return
        nodes.stack[0] = _slot(nodes, nodes.planned[k])
        count = 1
        free = _visit(
            nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those,
            nodes.stack[0], covered.step,
        )  # fmt: skip
        while count > 0 and not free:
            right = nodes.stack[count - 1]
            width = nodes.phi[right] - nodes.phi[left]
            known = what_is_known(nodes, scratch, moving, pieces, inputs, covered, left, right, width)
            if known != EXCLUDED:
                ends = width <= (COARSE if known == TOUCHING else FINEST)
                if not ends and result.visited[i] < MOST_VISITED:
                    middle = _slot(nodes, 0.5 * (nodes.phi[left] + nodes.phi[right]))
                    nodes.stack[count] = middle
                    copy_row(nodes.excluded[right], nodes.excluded[middle])
                    count += 1
                    free = _visit(
                        nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run,
                        those, middle, width,
                    )  # fmt: skip
                    continue
                if not ends or known != TOUCHING:
                    result.left[i] = max(result.left[i], width)
            if covered.locked.spherical:
                free = _search_crossings(
                    nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run,
                    those, left, right,
                )  # fmt: skip
            nodes.used[left] = False
            left = right
            count -= 1
    if not free:
        result.left[i] = max(result.left[i], result.undecided.spacing[i])


@njit(**STRICT)
def _search_crossings(
    nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those, left, right
):
    """Check candidates on swings of branches between two slots; return whether one is free, like `_visit`.

    The arguments are those of `_visit`; the left slot is not needed any more.
    """
    i, T, row, hand, tool = those
    locked, memory, joint = covered.locked, branches.memory, nodes.chain.joint[6]
    low, high = nodes.phi[left], nodes.phi[right]
    for b in range(len(branches.exists[0])):
        for k in range(ROOTS):
            if not crosses(nodes, left, right, b, k):
                continue
            begin_swing(nodes, left, b)
            for step in range(SWING_STEPS):
                goes_on, fits = next_of_swing(nodes, memory, joint, T, step, low, high)
                if not goes_on:
                    break
                if not fits:
                    continue
                q = branches.q[0][b]
                copy_row(memory.row, q)
                branches.inside[0][b] = True
                gap = arm_gap(
                    nodes, scratch, branches, moving, pieces, tree, inputs, balance, T, row, hand, left, b
                )
                if gap == -math.inf:
                    continue
                geometry_at(locked, q[joint], nodes.chain.geometry[0])
                gap = retreat_gap(
                    nodes, scratch, branches, moving, pieces, tree, inputs, balance, run, T, row, tool, gap,
                    left, b,
                )  # fmt: skip
                if gap in (-math.inf, UNDECIDED):
                    continue
                result.found[i], result.phi[i], result.branch[i] = True, q[joint], b
                result.clearance[i] = max(0.0, gap - FREE_BAND)
                copy_row(q, result.q[i])
                return True
    return False


@njit(**STRICT)
def _slot(nodes, phi):
    """Take a free slot for a value of φ (rad) and return it; nothing is known of the part that ends there."""
    k = 0
    while nodes.used[k]:
        k += 1
    nodes.used[k], nodes.excluded[k], nodes.phi[k] = True, False, phi
    return k


@njit(**STRICT)
def _visit(
    nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those, at, width
):
    """Check all candidates of a cell at the value of φ of slot ``at``, and write them there.

    Args:
        run: index of the cell's run.
        those: what is known of the cell: its index, tool pose (4, 4) and row, the clearance (m) of the
            pieces that are fixed to the tool, and what `tool_retreats` says of their retreat.
        width: width (rad) of the part that is halved there, at most.

    Returns:
        Whether one is free; it is then in the result.
    """
    i, T, row, hand, tool = those
    result.visited[i] += 1
    find_branches(nodes, branches, covered.locked, T, at)
    for b in range(len(branches.exists[0])):
        if not is_to_check(nodes, branches, at, b):
            continue
        gap = arm_gap(nodes, scratch, branches, moving, pieces, tree, inputs, balance, T, row, hand, at, b)
        if gap == -math.inf:
            continue
        gap = retreat_gap(
            nodes, scratch, branches, moving, pieces, tree, inputs, balance, run, T, row, tool, gap, at, b
        )
        if gap == -math.inf:
            continue
        if gap == UNDECIDED:
            if nodes.state[at, b] != TOUCHES:
                note_undecided(result.undecided, i, nodes.phi[at], b, width)
            elif width > COARSE:
                note_undecided(result.overlapping, i, nodes.phi[at], b, width)
            continue
        result.found[i], result.phi[i], result.branch[i] = True, nodes.phi[at], b
        result.clearance[i] = max(0.0, gap - FREE_BAND)
        copy_row(branches.q[0][b], result.q[i])
        return True
    return False
