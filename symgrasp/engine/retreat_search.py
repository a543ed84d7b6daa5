"""The tool's own checks, and the search along the straight retreat from a grasp. Compiled.

Arguments that the functions share: chain, moving, pieces, tree, inputs and balance are those of `search`;
scratch is `Scratch`, branches is `BranchScratch`, rows is `RowChecks`. T is a tool pose (4, 4) in the base.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.engine.balance import stands
from symgrasp.engine.checks import UNDECIDED, check_hand
from symgrasp.engine.kinematics import place_frames, place_hand
from symgrasp.engine.path_checks import check_path_of_arm, check_path_of_hand, write_tool
from symgrasp.engine.search_types import BLOCKED, FEASIBLE, LIMITS, RETREAT_UNDECIDED, UNBALANCED
from symgrasp.ik.branches import branches_near
from symgrasp.ik.joints import within
from symgrasp.ik.retreat import RETREAT_TURN
from symgrasp.ik.vectors import STRICT

__all__ = ["arm_retreats", "copy_row", "moved_along", "tool_clearance", "tool_retreats"]


@njit(**STRICT)
def tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, T):
    """Place the pieces that are fixed to the tool at the grasp and check them.

    Args:
        run: index of the cell's run.
        T: tool pose (4, 4) in the base.

    Returns:
        Their clearance (m), UNDECIDED, or -inf where they collide; the pair is then in ``scratch.hit``.
    """
    place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
    if inputs.always_collides:
        scratch.hit[0] = -1
        return -math.inf
    if rows.gap[run, 0] == -math.inf:
        scratch.hit[0], scratch.hit[1] = rows.hit[run, 0, 0], rows.hit[run, 0, 1]
        scratch.depth[0] = rows.depth[run, 0]
        return -math.inf
    return check_hand(moving, pieces, tree, scratch, inputs.margin, rows.gap[run, 0])


@njit(**STRICT)
def tool_retreats(moving, pieces, tree, scratch, branches, inputs, rows, run, T):
    """Check the pieces that are fixed to the tool along the retreat, and write its tool poses.

    Returns:
        FEASIBLE, BLOCKED, or RETREAT_UNDECIDED.
    """
    path, moved, row, steps = branches.path, branches.T, inputs.row[run], len(inputs.retreat)
    worst, middle = 0.0, steps // 2
    for step in range(1 + steps):
        s = middle if step == steps else step  # the hand stays at the middle
        moved_along(T, inputs.retreat[s], moved)
        place_hand(moving, pieces, scratch, inputs.T_world_base, moved, row)
        write_tool(scratch, path, s)
        worst = min(worst, rows.gap[run, 1 + s])
        if worst == -math.inf:
            scratch.hit[0], scratch.hit[1] = rows.hit[run, 1 + s, 0], rows.hit[run, 1 + s, 1]
            scratch.depth[0] = rows.depth[run, 1 + s]
            return BLOCKED
    way = max(
        abs(inputs.retreat[middle] - inputs.retreat[0]), abs(inputs.retreat[-1] - inputs.retreat[middle])
    )
    for g in range(moving.hand.shape[1]):
        path.motion[g] = way
    return _status(min(worst, check_path_of_hand(moving, pieces, tree, scratch, path, row, inputs.margin)))


@njit(**STRICT)
def arm_retreats(chain, moving, pieces, tree, scratch, branches, inputs, balance, run, T, k, b, tool):
    """Follow a candidate along the retreat, in the steps of `CandidateChecker`.

    The order of the checks is another one: a candidate is blocked if any step is, whatever the others are.

    Args:
        k: redundancy sample of the candidate.
        b: branch of the candidate.
        tool: what `tool_retreats` returned for the cell.

    Returns:
        FEASIBLE, BLOCKED, or RETREAT_UNDECIDED. The pair that blocks it, if one does, is in ``scratch.hit``;
        where and why it is blocked is in the path.
    """
    if tool == BLOCKED:
        return BLOCKED
    q, exists, inside, at = branches.q[1], branches.exists[1], branches.inside[1], branches.at
    path, moved, falls, row = branches.path, branches.T, len(balance.edges) > 0, inputs.row[run]
    scratch.hit[0] = -1
    copy_row(branches.q[0][b], at)
    if falls and not stands(balance, scratch.frames, inputs.T_world_base, T, row, False):
        path.blocked[0], path.blocked[1] = 0, UNBALANCED
        return BLOCKED
    for s in range(len(inputs.retreat)):
        moved_along(T, inputs.retreat[s], moved)
        branches_near(chain, k, moved, at, RETREAT_TURN, q, exists, inside, branches.memory)
        if not _follow(chain.limits, inputs.turns, q, inside, at):
            path.blocked[0], path.blocked[1] = 1 + s, LIMITS
            return BLOCKED
        copy_row(at, path.q[s])
        place_frames(moving, at, path.frames[s])
        if falls and not stands(balance, path.frames[s], inputs.T_world_base, moved, row, False):
            path.blocked[0], path.blocked[1] = 1 + s, UNBALANCED
            return BLOCKED
    moved_along(T, inputs.retreat[len(inputs.retreat) // 2], moved)
    place_hand(moving, pieces, scratch, inputs.T_world_base, moved, row)
    found = _status(check_path_of_arm(moving, pieces, tree, scratch, path, row, inputs.margin))
    return tool if found == FEASIBLE else found


@njit(**STRICT)
def _status(gap):
    """Return what a clearance (m) of a path means: FEASIBLE, BLOCKED, or RETREAT_UNDECIDED."""
    if gap == -math.inf:
        return BLOCKED
    return RETREAT_UNDECIDED if gap == UNDECIDED else FEASIBLE


@njit(**STRICT)
def _follow(limits, turns, q, inside, at):
    """Replace ``at`` by the nearest branch inside the limits; return whether it turns no joint too far."""
    nearest, least = -1, math.inf
    for b in range(len(inside)):
        if inside[b]:
            turn = 0.0
            for j in range(len(at)):
                # A joint with a range above a full turn takes the value nearest to the present one.
                near = q[b, j] + 2 * math.pi * np.rint((at[j] - q[b, j]) / (2 * math.pi))
                if within(limits, j, near):
                    q[b, j] = min(max(near, limits[0, j]), limits[1, j])
                turn = max(turn, abs(q[b, j] - at[j]))
            if turn < least:
                nearest, least = b, turn
    if nearest < 0:
        return False
    for j in range(len(at)):
        if abs(q[nearest, j] - at[j]) > turns[j]:
            return False
    copy_row(q[nearest], at)
    return True


@njit(**STRICT)
def moved_along(T, distance, out):
    """Write a tool pose (4, 4) moved by a signed distance (m) along its approach."""
    for i in range(3):
        for j in range(3):
            out[i, j] = T[i, j]
        out[i, 3] = T[i, 2] * distance + T[i, 3]


@njit(**STRICT)
def copy_row(row, out):
    """Copy a row (n,) into another."""
    for j in range(len(row)):
        out[j] = row[j]
