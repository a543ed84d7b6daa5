"""The tool's own checks, and the search along the straight retreat from a grasp. Compiled.

Arguments that the functions share: chain, moving, pieces, tree, inputs and balance are those of `search`;
scratch is `Scratch`, branches is `BranchScratch`, rows is `RowChecks`. T is a tool pose (4, 4) in the base.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.engine.balance import stands
from symgrasp.engine.checks import UNDECIDED, check_arm, check_hand
from symgrasp.engine.kinematics import place_arm, place_hand
from symgrasp.engine.search_types import BLOCKED, FEASIBLE, RETREAT_UNDECIDED
from symgrasp.ik.branches import branches_at
from symgrasp.ik.retreat import RETREAT_TURN
from symgrasp.ik.vectors import STRICT

__all__ = ["arm_retreats", "copy_row", "moved_along", "tool_clearance", "tool_retreats"]


@njit(**STRICT)
def tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, step, T):
    """Place the pieces that are fixed to the tool and check them.

    Args:
        run: index of the cell's run.
        step: 0 at the grasp, else 1 + index of the step of the retreat.
        T: tool pose (4, 4) in the base.

    Returns:
        Their clearance (m), UNDECIDED, or -inf where they collide; the pair is then in ``scratch.hit``.
    """
    place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
    if inputs.always_collides:
        scratch.hit[0] = -1
        return -math.inf
    if rows.gap[run, step] == -math.inf:
        scratch.hit[0], scratch.hit[1] = rows.hit[run, step, 0], rows.hit[run, step, 1]
        scratch.depth[0] = rows.depth[run, step]
        return -math.inf
    return check_hand(moving, pieces, tree, scratch, inputs.margin, rows.gap[run, step])


@njit(**STRICT)
def tool_retreats(moving, pieces, tree, scratch, branches, inputs, rows, run, T):
    """Whether the pieces that are fixed to the tool are certified free at every step of the retreat."""
    moved = branches.T
    for s in range(len(inputs.retreat)):
        moved_along(T, inputs.retreat[s], moved)
        if tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, s + 1, moved) <= UNDECIDED:
            return False
    return True


@njit(**STRICT)
def arm_retreats(
    chain, moving, pieces, tree, scratch, branches, inputs, balance, rows, run, T, k, b, tool_free
):
    """Follow a candidate, at which the arm is placed, along the retreat, in the steps of `CandidateChecker`.

    Args:
        k: redundancy sample of the candidate.
        b: branch of the candidate.
        tool_free: whether `tool_retreats` holds.

    Returns:
        FEASIBLE, BLOCKED, or RETREAT_UNDECIDED.
    """
    q, exists, inside, at = branches.q[1], branches.exists[1], branches.inside[1], branches.at
    moved, falls, row = branches.T, len(balance.edges) > 0, inputs.row[run]
    copy_row(branches.q[0][b], at)
    if falls and not stands(balance, scratch.frames, inputs.T_world_base, T, row, False):
        scratch.hit[0] = scratch.hit[2] = -1
        return BLOCKED
    furthest = FEASIBLE
    for s in range(len(inputs.retreat)):
        moved_along(T, inputs.retreat[s], moved)
        scratch.hit[0] = scratch.hit[2] = -1
        branches_at(chain, k, moved, True, q, exists, inside, branches.memory)
        if not _follow(chain.limits, q, inside, at):
            furthest = BLOCKED
            break
        if falls:
            place_arm(moving, pieces, scratch, at)
            if not stands(balance, scratch.frames, inputs.T_world_base, moved, row, False):
                furthest = BLOCKED
                break
        gap = 0.0  # on the retreat only collisions matter, not the clearance
        if tool_free:
            place_hand(moving, pieces, scratch, inputs.T_world_base, moved, row)
        else:
            gap = min(gap, tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, s + 1, moved))
        if gap != -math.inf:
            place_arm(moving, pieces, scratch, at)
            gap = check_arm(moving, pieces, tree, scratch, inputs.margin, gap, -math.inf)
        if gap == -math.inf:
            furthest = BLOCKED
            break
        if gap == UNDECIDED:
            # Later steps need no check: PyBullet decides the whole retreat.
            furthest = RETREAT_UNDECIDED
            break
    scratch.hit[2] = -1
    return furthest


@njit(**STRICT)
def _follow(limits, q, inside, at):
    """Replace ``at`` by the nearest branch inside the limits; return whether none turns a joint too far."""
    nearest, least = -1, math.inf
    for b in range(len(inside)):
        if inside[b]:
            turn = 0.0
            for j in range(len(at)):
                # A joint with a range above a full turn takes the value nearest to the present one.
                near = q[b, j] + 2 * math.pi * np.round((at[j] - q[b, j]) / (2 * math.pi))
                if limits[0, j] <= near <= limits[1, j]:
                    q[b, j] = near
                turn = max(turn, abs(q[b, j] - at[j]))
            if turn < least:
                nearest, least = b, turn
    if nearest < 0 or least > RETREAT_TURN:
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
