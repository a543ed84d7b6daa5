"""The windows of cells: all intervals of the redundancy φ on which a branch is free. Compiled.

The range of φ is halved as by `symgrasp.engine.redundancy.cover`, which stops at the first free
configuration. Here every part is halved until each branch is excluded on it, is free all along it, or it is
narrow enough.

A branch that is free at both ends of a part is so all along it where no piece moves further in between than
the clearances at both ends allow, no joint can pass a limit, and no other branch is near with which it could
end. By how much curves bend is bounded by what is usual for arms, as for what is excluded. Where that does
not tell, it is taken for free once the part is narrower than `STEP`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from queue import SimpleQueue
from typing import NamedTuple

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.collision.tree import Tree
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.checks import UNDECIDED
from symgrasp.engine.kinematics import MovingPieces, Scratch, place_hand
from symgrasp.engine.redundancy.candidates import (
    arm_gap,
    find_branches,
    is_to_check,
    plan_values,
    retreat_gap,
)
from symgrasp.engine.redundancy.cover import COARSE, FINEST
from symgrasp.engine.redundancy.cover_types import GONE, SKIPPED, CoverInput, Nodes, new_nodes
from symgrasp.engine.redundancy.exclusion import BEND, EXCLUDED, LEAST_BEND, TOUCHING, what_is_known
from symgrasp.engine.redundancy.pair_exclusion import SAGITTA
from symgrasp.engine.redundancy.undecided import Undecided, new_undecided, note_undecided
from symgrasp.engine.redundancy.vectors import SAME_CURVE, copy_pose, wrapped
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
from symgrasp.ik.branches import branch_count
from symgrasp.ik.chain import Chain
from symgrasp.ik.spans import prepare_spans
from symgrasp.ik.vectors import STRICT
from symgrasp.poses import Array

__all__ = ["FINEST", "MOST_WINDOWS", "STEP", "WindowResult", "windows"]

MOST_WINDOWS = 128
"""Most windows of a cell that are told apart; more would be those of noise."""

MOST_UNDECIDED = 4096
"""Most candidates of a cell that only PyBullet can decide, and that are listed."""

FREE = SKIPPED + 1
"""State of a branch that is free."""

STEP = 1e-3
"""Width (rad) of a part at both ends of which a branch is free, and that is not halved any more; five times
as much with a retreat or balance, of which no measure is known."""

CLEAR = 0.1
"""Largest clearance (m) of the links that counts."""

NEAR_ROOT = 3.0
"""How far apart (rad/rad, for the width of a part) two branches are that do not end in between."""

CLOSED, TAKEN, WHOLE, OPEN = 0, 1, 2, 3
"""What a branch is on a part: not free, free to the resolution, free all along, or not known yet."""


class WindowResult(NamedTuple):
    """What was found for each of c cells.

    Attributes:
        found: (c,) number of windows.
        branch: (c, MOST_WINDOWS) branch of each.
        ends: (c, MOST_WINDOWS, 2) where it begins and ends (rad).
        whole: (c, MOST_WINDOWS) whether it is free all along; else parts of it are to the resolution.
        undecided: the candidates that only PyBullet can decide, `MOST_UNDECIDED` at most.
    """

    found: np.ndarray
    branch: np.ndarray
    ends: Array
    whole: np.ndarray
    undecided: Undecided


class _Free(NamedTuple):
    """What is kept of free candidates at some values of the redundancy, beside `Nodes`.

    Attributes:
        gap: (SLOTS, B) clearance (m) of their links.
        place: (SLOTS, B, M, 12) poses of the pieces that move.
        whole: (SLOTS, B) which branches are free all along the part that ends at a slot.
        label: (B,) what each branch is on the present part.
        begun: (B,) where the window of a branch begins (rad), NaN where none has.
        to: (B,) where it ends so far.
        proven: (B,) whether it is free all along so far.
    """

    gap: Array
    place: Array
    whole: np.ndarray
    label: np.ndarray
    begun: Array
    to: Array
    proven: np.ndarray


def windows(
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
) -> WindowResult:
    """Find the windows of some cells, on all cores; see `cover` for the arguments."""
    c = len(covered.cells)
    result = WindowResult(
        found=np.zeros(c, dtype=np.int64),
        branch=np.zeros((c, MOST_WINDOWS), dtype=np.int64),
        ends=np.zeros((c, MOST_WINDOWS, 2)),
        whole=np.zeros((c, MOST_WINDOWS), dtype=bool),
        undecided=new_undecided(c, MOST_UNDECIDED),
    )
    idle: SimpleQueue[tuple[Nodes, _Free, Scratch, BranchScratch]] = SimpleQueue()
    count = branch_count(chain)
    for scratch in scratches:
        branches = new_branches(chain, joints, len(inputs.retreat), len(moving.frame))
        nodes = new_nodes(chain, covered.locked, count, joints)
        slots = len(nodes.phi)
        free = _Free(
            gap=np.empty((slots, count)),
            place=np.empty((slots, count, len(moving.frame), 12)),
            whole=np.zeros((slots, count), dtype=bool),
            label=np.empty(count, dtype=np.int64),
            begun=np.empty(count),
            to=np.empty(count),
            proven=np.empty(count, dtype=bool),
        )
        idle.put((nodes, free, scratch, branches))

    def find_part(part: int) -> None:
        own = idle.get()
        try:
            _find_part(*own, moving, pieces, tree, inputs, balance, rows, covered, result, part)
        finally:
            idle.put(own)

    find_part(0)  # here, where Ctrl-C can interrupt its compiling
    in_parallel(find_part, range(1, inputs.parts))
    return result


@njit(**ENTRY)
def _find_part(
    nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, part
):
    """Find the windows of the cells of one part; parts are interleaved."""
    prepare_spans(nodes.spans, covered.locked)
    for i in range(part, len(covered.cells), inputs.parts):
        _find(nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, i)


@njit(**STRICT)
def _find(nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, i):
    """Find the windows of one cell."""
    cell = covered.cells[i]
    T, run = inputs.T_base_tool[cell], cell * len(inputs.row) // len(inputs.T_base_tool)
    if tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, T) == -math.inf:
        return
    tool = FEASIBLE
    if len(inputs.retreat):
        tool = tool_retreats(moving, pieces, tree, scratch, branches, inputs, rows, run, T)
        place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
        if tool == BLOCKED:
            return
    scratch.hit[2] = -1
    nodes.used[:] = False
    free.begun[:] = math.nan
    locked = covered.locked
    those = i, T, inputs.row[run], tool
    planned = plan_values(nodes, covered, T)
    left = _slot(nodes, free, nodes.planned[0])
    _visit(
        nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, result, run, those, left,
        locked, covered.step,
    )  # fmt: skip
    for k in range(1, planned):
        nodes.stack[0] = _slot(nodes, free, nodes.planned[k])
        count = 1
        _visit(
            nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, result, run, those,
            nodes.stack[0], locked, covered.step,
        )  # fmt: skip
        while count > 0:
            right = nodes.stack[count - 1]
            if _label(nodes, free, scratch, moving, pieces, inputs, balance, covered, left, right):
                _go_on(nodes, free, result, i, left, right)
                nodes.used[left] = False
                left = right
                count -= 1
                continue
            width = nodes.phi[right] - nodes.phi[left]
            middle = _slot(nodes, free, 0.5 * (nodes.phi[left] + nodes.phi[right]))
            nodes.stack[count] = middle
            copy_row(nodes.excluded[right], nodes.excluded[middle])
            copy_row(free.whole[right], free.whole[middle])
            count += 1
            _visit(
                nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, result, run, those,
                middle, locked, width,
            )  # fmt: skip
    for b in range(len(free.begun)):
        _end(free, result, i, b)


@njit(**STRICT)
def _slot(nodes, free, phi):
    """Take a free slot for a value of φ (rad) and return it; nothing is known of the part that ends there."""
    k = 0
    while nodes.used[k]:
        k += 1
    nodes.used[k], nodes.excluded[k], nodes.phi[k] = True, False, phi
    free.whole[k] = False
    return k


@njit(**STRICT)
def _go_on(nodes, free, result, i, left, right):
    """Let the windows of a cell go on over a part, or end before it."""
    for b in range(len(free.label)):
        if free.label[b] == CLOSED:
            _end(free, result, i, b)
            if nodes.state[right, b] == FREE:  # it begins there
                free.begun[b], free.to[b], free.proven[b] = nodes.phi[right], nodes.phi[right], True
            continue
        if math.isnan(free.begun[b]):
            free.begun[b], free.proven[b] = nodes.phi[left], True
        free.to[b] = nodes.phi[right]
        free.proven[b] &= free.label[b] == WHOLE


@njit(**STRICT)
def _end(free, result, i, b):
    """Write down the window of a branch that ends, if there is one."""
    if math.isnan(free.begun[b]):
        return
    at = result.found[i]
    if at < MOST_WINDOWS:
        result.branch[i, at], result.whole[i, at] = b, free.proven[b]
        result.ends[i, at, 0], result.ends[i, at, 1] = free.begun[b], free.to[b]
        result.found[i] = at + 1
    free.begun[b] = math.nan


@njit(**STRICT)
def _label(nodes, free, scratch, moving, pieces, inputs, balance, covered, left, right):
    """Say of every branch what it is on the part between two slots; return whether all is known."""
    width = nodes.phi[right] - nodes.phi[left]
    measured = len(inputs.retreat) == 0 and len(balance.edges) == 0
    every = True
    for b in range(len(free.label)):
        here, there = nodes.state[left, b] == FREE, nodes.state[right, b] == FREE
        if free.whole[right, b]:
            free.label[b] = WHOLE
        elif here and there:
            if measured and _free_between(nodes, free, inputs, pieces, left, right, b, width):
                free.label[b] = WHOLE
                if covered.locked.spherical:  # else branches may change places
                    free.whole[right, b] = True
            elif width <= (STEP if measured else 5.0 * STEP) and _same(nodes, left, right, b):
                free.label[b] = TAKEN
            else:
                free.label[b] = CLOSED if width <= FINEST else OPEN
        elif here or there:
            free.label[b] = CLOSED if width <= FINEST else OPEN
        else:
            free.label[b] = CLOSED
        every &= free.label[b] != OPEN
    if not every:
        return False
    for b in range(len(free.label)):  # of what is free nothing is to be excluded
        nodes.excluded[right, b] |= free.label[b] != CLOSED
    known = what_is_known(nodes, scratch, moving, pieces, inputs, covered, left, right, width)
    for b in range(len(free.label)):
        nodes.excluded[right, b] &= free.label[b] == CLOSED
    if known == EXCLUDED:
        return True
    return width <= (COARSE if known == TOUCHING else FINEST)


@njit(**STRICT)
def _same(nodes, left, right, b):
    """Whether a branch is at both ends of a part on the same curve."""
    for j in range(nodes.q.shape[2]):
        if abs(wrapped(nodes.q[right, b, j] - nodes.q[left, b, j])) >= SAME_CURVE:
            return False
    return True


@njit(**STRICT)
def _free_between(nodes, free, inputs, pieces, left, right, b, width):
    """Whether a branch that is free at both ends of a part is free all along it."""
    if not _same(nodes, left, right, b):
        return False
    limits, n = nodes.chain.limits, nodes.q.shape[2]
    apart = way = 0.0
    for j in range(n):
        turn = abs(wrapped(nodes.q[right, b, j] - nodes.q[left, b, j]))
        apart, way = max(apart, turn), way + turn
    bend = (BEND * apart + LEAST_BEND) * apart
    for j in range(n):
        half = 0.5 * (limits[1, j] - limits[0, j])
        if half < math.pi:
            for at in (left, right):
                if half - abs(wrapped(nodes.q[at, b, j] - limits[2, j])) < bend:
                    return False
    for at in (left, right):  # another branch, with which it might end
        for other in range(nodes.state.shape[1]):
            if other == b or nodes.state[at, other] == GONE:
                continue
            most = 0.0
            for j in range(n):
                most = max(most, abs(wrapped(nodes.q[at, other, j] - nodes.q[at, b, j])))
            if most < NEAR_ROOT * width:
                return False
    slack = free.gap[left, b] + free.gap[right, b] - 2.0 * inputs.margin
    moved = 2.0 * SAGITTA * way * way
    if slack <= moved:
        return False
    first = free.place.shape[2]
    most = 0.0
    for k in range(first):
        most = max(most, _chord(free.place[left, b, k], free.place[right, b, k], pieces.size, k))
    return slack > moved + 2.0 * most


@njit(**STRICT)
def _chord(here, there, size, k):
    """Return how far (m) the points of a piece at one end of a part are from those at the other, at most."""
    turn = shift = 0.0
    for i in range(3):
        along = there[9 + i] - here[9 + i]
        for j in range(3):
            d = there[3 * i + j] - here[3 * i + j]
            turn += d * d
            along += d * size[k, 3 + j]
        shift += along * along
    x, y, z = size[k, 6], size[k, 7], size[k, 8]
    return math.sqrt(shift) + math.sqrt(turn) * (math.sqrt(x * x + y * y + z * z) + size[k, 0])


@njit(**STRICT)
def _visit(
    nodes, free, scratch, branches, moving, pieces, tree, inputs, balance, result, run, those, at, locked,
    width,
):  # fmt: skip
    """Check all candidates of a cell at the value of φ of slot ``at``, and write them there.

    Args:
        run: index of the cell's run.
        those: what is known of the cell: its index, tool pose (4, 4) and row, and what `tool_retreats` says
            of the retreat of its hand.
        width: width (rad) of the part that is halved there, at most.
    """
    i, T, row, tool = those
    find_branches(nodes, branches, locked, T, at)
    for b in range(len(branches.exists[0])):
        if not is_to_check(nodes, branches, at, b):
            continue
        if free.whole[at, b]:
            nodes.state[at, b] = FREE
            continue
        gap = arm_gap(nodes, scratch, branches, moving, pieces, tree, inputs, balance, T, row, CLEAR, at, b)
        if gap == -math.inf:
            continue
        for k in range(free.place.shape[2]):
            copy_pose(scratch.pose[k], free.place[at, b, k])
        gap = retreat_gap(
            nodes, scratch, branches, moving, pieces, tree, inputs, balance, run, T, row, tool, gap, at, b
        )
        if gap == -math.inf:
            continue
        if gap == UNDECIDED:
            note_undecided(result.undecided, i, nodes.phi[at], b, width)
            continue
        nodes.state[at, b], free.gap[at, b] = FREE, gap
