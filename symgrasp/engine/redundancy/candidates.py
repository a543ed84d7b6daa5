"""The candidates of a cell at one value of the redundancy φ, checked and written into a slot. Compiled."""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.engine.balance import falls
from symgrasp.engine.checks import HIT_BAND, OVERLAP, UNDECIDED, check_arm
from symgrasp.engine.kinematics import place_arm, place_hand
from symgrasp.engine.path_checks import place_at_step
from symgrasp.engine.redundancy.cover_types import (
    FALLS,
    GONE,
    HITS,
    OUTSIDE,
    SKIPPED,
    STOPS,
    TOUCHES,
    UNSURE,
)
from symgrasp.engine.redundancy.vectors import copy_pose
from symgrasp.engine.retreat_search import arm_retreats, copy_row, moved_along
from symgrasp.engine.search_types import BLOCKED, HIT, RETREAT_UNDECIDED, UNBALANCED
from symgrasp.ik.at_phi import geometry_at
from symgrasp.ik.branches import branches_at
from symgrasp.ik.chain import Chain
from symgrasp.ik.joints import spread_in
from symgrasp.ik.newton import linearise
from symgrasp.ik.self_motion import CLOSE, into_limits
from symgrasp.ik.spans import FINEST, HALVES, find_spans, span_over
from symgrasp.ik.vectors import STRICT

__all__ = ["arm_gap", "find_branches", "is_to_check", "plan_sought", "plan_values", "retreat_gap"]

NARROW = 4.0 * FINEST
"""Width (rad) of a span up to which a value on it is told: those beside its ends may be off it."""

SOUGHT, SEEK_STEPS = 48, 40
"""Joint values all over the range from which Newton's method starts with all joints free, and its steps."""

ALMOST, MORE_STEPS = 1e-4, 300
"""Error (m and rad) of the tool after them from which it goes on, and its further steps: at the limit of the
reach it converges slowly."""

APART = 1e-4
"""Distance (rad) of two values to which it leads that are told apart."""


@njit(**STRICT)
def plan_values(nodes, covered, T):
    """Write the values of φ with which the search of a pose (4, 4) begins, in order; return how many.

    Beside the ends of its range they are those to both sides of the ends of branches, where these are known,
    one between ends that are near each other, and others where branches reach the pose.
    """
    locked, spans, planned = covered.locked, nodes.spans, nodes.planned
    find_spans(spans, nodes.chain, locked, T)
    planned[0], planned[1] = locked.lower, locked.upper
    count = 2
    for half in range(HALVES):
        for k in range(spans.number[half]):
            if spans.ends[half, k, 1] - spans.ends[half, k, 0] <= NARROW:
                count = _sort_in(planned, count, spans.reached[half, k])
            for end in range(2):
                for side in range(2):
                    phi = spans.ends[half, k, end] + (FINEST if side else -FINEST)
                    if locked.lower < phi < locked.upper:
                        count = _sort_in(planned, count, phi)
    return _plan_between(nodes, covered, count)


@njit(**STRICT)
def plan_sought(nodes, branches, covered, T):
    """Do what `plan_values` does with values at which Newton's method reaches a pose (4, 4), all joints free.

    They are for arms without a closed form, whose branches may exist on short parts only, or at single
    values. Joint values all over lead to them.

    Returns:
        How many there are; 0 where it leads to none.
    """
    locked, planned, chain, row = covered.locked, nodes.planned, nodes.chain, nodes.half
    loose = Chain(chain.geometry, chain.joint, chain.limits, chain.leeway, chain.forward, nodes.unlocked)
    J, A = branches.memory.J, branches.memory.A
    planned[0], planned[1] = locked.lower, locked.upper
    count = 2
    for i in range(SOUGHT):
        spread_in(chain.limits, i, row)
        if not into_limits(loose, row, T, SEEK_STEPS, CLOSE, J, A):
            _, move, turn, _ = linearise(chain.forward, nodes.unlocked, row, T, J)
            if not (max(move, turn) < ALMOST and into_limits(loose, row, T, MORE_STEPS, CLOSE, J, A)):
                continue
        phi = row[chain.joint[6]]
        if not locked.lower < phi < locked.upper:  # a turn without limits is covered once
            phi -= 2.0 * math.pi * math.floor((phi - locked.lower) / (2.0 * math.pi))
        near = not locked.lower < phi < locked.upper
        for k in range(count):
            near |= abs(planned[k] - phi) < APART
        if not near:
            count = _sort_in(planned, count, phi)
    return _plan_between(nodes, covered, count) if count > 2 else 0


@njit(**STRICT)
def _plan_between(nodes, covered, count):
    """Add values between those that are planned, where branches reach the pose; return the new count."""
    spans, planned = nodes.spans, nodes.planned
    for k in range(count - 2, -1, -1):
        low, high = planned[k], planned[k + 1]
        if spans.number[0] < 0 or span_over(spans, 0, low, high) or span_over(spans, 1, low, high):
            parts = math.ceil((high - low) / covered.step)
            for i in range(1, parts):
                count = _sort_in(planned, count, low + (high - low) * i / parts)
    return count


@njit(**STRICT)
def _sort_in(values, count, value):
    """Put a value among the first ``count``, which are in order; return the new count."""
    i = count
    while values[i - 1] > value:
        values[i] = values[i - 1]
        i -= 1
    values[i] = value
    return count + 1


@njit(**STRICT)
def find_branches(nodes, branches, locked, T, at):
    """Find the branches that reach a pose (4, 4) at the value of φ of slot ``at``, and begin it with them."""
    geometry_at(locked, nodes.phi[at], nodes.chain.geometry[0])
    branches_at(
        nodes.chain, 0, T, False, branches.q[0], branches.exists[0], branches.inside[0], branches.memory
    )
    for b in range(len(branches.exists[0])):
        nodes.missing[at, b] = branches.memory.missing[b]


@njit(**STRICT)
def is_to_check(nodes, branches, at, b):
    """Whether a branch is neither gone nor excluded; its joint values are written down if it is there."""
    nodes.state[at, b], nodes.step[at, b] = GONE, 0
    if not branches.exists[0][b]:
        return False
    # Of excluded ones, too: they may be where another's curve ends.
    copy_row(branches.q[0][b], nodes.q[at, b])
    nodes.state[at, b] = SKIPPED
    nodes.reached[0] = True
    return not nodes.excluded[at, b]


@njit(**STRICT)
def arm_gap(nodes, scratch, branches, moving, pieces, tree, inputs, balance, T, row, most, at, b):
    """Place an arm and return its clearance (m), at most ``most``.

    `UNDECIDED` where only PyBullet can tell, and -inf where it is not free; the slot says why.
    """
    nodes.state[at, b] = OUTSIDE
    if not branches.inside[0][b]:
        return -math.inf
    place_arm(moving, pieces, scratch, branches.q[0][b])
    if len(balance.edges) > 0:
        edge, beyond = falls(balance, scratch.frames, inputs.T_world_base, T, row, True)
        if edge >= 0:
            _note_fall(nodes, at, b, edge, beyond, True)
            return -math.inf
    gap = check_arm(moving, pieces, tree, scratch, inputs.margin, most, -math.inf, HIT_BAND)
    if gap == -math.inf:
        _note_pair(nodes, scratch, at, b, HITS)
    elif gap == UNDECIDED:
        nodes.state[at, b] = UNSURE
        scratch.hit[2] = -1
        if check_arm(moving, pieces, tree, scratch, inputs.margin, most, -math.inf, OVERLAP) == -math.inf:
            _note_pair(nodes, scratch, at, b, TOUCHES)
        scratch.hit[2] = -1  # what is remembered has to collide for PyBullet, too
    return gap


@njit(**STRICT)
def _note_fall(nodes, at, b, edge, beyond, loaded):
    """Write into a slot over which edge the robot falls, by how much (m), and whether it bears the load."""
    nodes.state[at, b], nodes.depth[at, b] = FALLS, beyond
    nodes.pair[at, b, 0], nodes.pair[at, b, 1] = edge, loaded


@njit(**STRICT)
def _note_pair(nodes, scratch, at, b, state):
    """Write into a slot which pair collides, where its pieces are placed."""
    nodes.state[at, b] = state
    for side in range(2):
        piece = scratch.hit[side]
        nodes.pair[at, b, side] = piece
        copy_pose(scratch.pose[piece], nodes.pose[at, b, side])
    nodes.depth[at, b], nodes.level[at, b] = -1.0, 0


@njit(**STRICT)
def retreat_gap(
    nodes, scratch, branches, moving, pieces, tree, inputs, balance, run, T, row, tool, gap, at, b
):
    """Return the clearance (m) of an arm that may have to retreat; -inf where that is blocked.

    Args:
        run: index of the cell's run.
        T, row: its tool pose (4, 4) and row.
        tool: what `tool_retreats` says of the retreat of its hand.
        gap: the clearance before, or `UNDECIDED`, which it stays.
        at, b: the slot, which says why it is not free, and the branch.
    """
    if gap == UNDECIDED or len(inputs.retreat) == 0:
        return gap
    furthest = arm_retreats(
        nodes.chain, moving, pieces, tree, scratch, branches, inputs, balance, run, T, 0, b, tool
    )
    if furthest == BLOCKED:
        _note_block(nodes, scratch, branches, moving, inputs, balance, T, row, at, b)
    place_hand(moving, pieces, scratch, inputs.T_world_base, T, row)
    if furthest == BLOCKED:
        return -math.inf
    if furthest == RETREAT_UNDECIDED:
        nodes.state[at, b] = UNSURE
        return UNDECIDED
    return gap


@njit(**STRICT)
def _note_block(nodes, scratch, branches, moving, inputs, balance, T, row, at, b):
    """Write into a slot where and why a candidate is blocked on its retreat, as `arm_retreats` found."""
    path, step = branches.path, branches.path.blocked[0]
    nodes.step[at, b] = step
    if path.blocked[1] == HIT:
        for side in range(2):
            place_at_step(moving, scratch, path, row, scratch.hit[side], step - 1)
        _note_pair(nodes, scratch, at, b, HITS)
        copy_row(path.q[step - 1], nodes.there[at, b])
        return
    if path.blocked[1] == UNBALANCED:
        frames = path.frames[step - 1] if step else scratch.frames
        edge, beyond = falls(balance, frames, inputs.T_world_base, branches.T if step else T, row, False)
        _note_fall(nodes, at, b, edge, beyond, False)
        copy_row(branches.at, nodes.there[at, b])
        return
    nodes.state[at, b] = STOPS
    copy_row(branches.at, nodes.there[at, b])
    moved_along(T, inputs.retreat[step - 1], branches.T)
    q, exists, inside = branches.q[1], branches.exists[1], branches.inside[1]
    branches_at(nodes.chain, 0, branches.T, False, q, exists, inside, branches.memory)
    for k in range(len(exists)):
        nodes.absent[at, b, k], nodes.lacking[at, b, k] = not exists[k], branches.memory.missing[k]
        copy_row(q[k], nodes.onward[at, b, k])
