"""Proofs that cells hold as a whole: feasible, or infeasible, at every height and angle inside. Compiled.

A box of heights and angles is proven feasible from a configuration in its middle, which the arm leaves by no
more than `symgrasp.engine.cell_paths` says: limits that are further away are kept, and pieces that are
further apart than they move stay apart. The redundancy keeps its value, so there is a candidate at that
sample everywhere.

A box is proven infeasible without the arm: the hand fits at none of its heights, two pieces of which one is
fixed to the tool are deeper inside each other than they move, or the tool stays out of reach.

Where a box is too large it is cut in four. The arguments are those of `symgrasp.engine.cell_paths`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from symgrasp.collision.boxes import box_of, boxes_apart
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import PackedPieces
from symgrasp.collision.simplex import FAST
from symgrasp.collision.tree import Tree
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.cell_paths import follows, motion_of, place_tool, reaches_middle, tool_motion
from symgrasp.engine.cell_types import CellInput, new_work
from symgrasp.engine.checks import FREE_BAND, HIT_BAND
from symgrasp.engine.kinematics import MovingPieces, Scratch, compose, place_pieces
from symgrasp.engine.reach import beyond_reach
from symgrasp.engine.search_types import Balance
from symgrasp.engine.threads import core_count, in_parallel
from symgrasp.poses import Array

__all__ = ["prove_cells"]

ROUNDING = 1e-6
"""What is proven has to hold by that much (m, rad): more than numbers are rounded by."""

PROVEN, OPEN, NEVER = 0, 1, 2
"""What is known of a box: that it is proven, that parts of it may be, that its middle is not."""


def prove_cells(
    moving: MovingPieces,
    pieces: PackedPieces,
    tree: Tree,
    scratches: Sequence[Scratch],
    inputs: CellInput,
    balance: Balance,
    cells: np.ndarray,
    q: Array,
) -> np.ndarray:
    """Prove of some cells, on all cores, that they hold as a whole.

    Args:
        moving: the pieces that the arm moves.
        pieces: all P pieces.
        tree: the boxes of the static pieces.
        scratches: the poses of all pieces, for each thread.
        inputs: what applies to all cells.
        balance: what decides whether the robot stands; its rows are those of ``inputs``.
        cells: (c, 3) roll, row and column.
        q: (c, n) joint values of their witnesses; NaN to prove them infeasible.

    Returns:
        (c,) bool.
    """
    found = np.zeros(len(cells), dtype=bool)
    count = core_count()
    levels = len(inputs.first) - 1
    work = [new_work(s, q.shape[1], len(moving.frame), levels) for s in scratches[:count]]

    def prove(part: int) -> None:
        _prove_part(moving, pieces, tree, inputs, balance, work[part], cells, q, found, part, count)

    in_parallel(partial(prove), range(count))
    return found


@njit(**ENTRY)
def _prove_part(moving, pieces, tree, inputs, balance, work, cells, q, found, part, parts):
    """Prove the cells of one part; parts are interleaved."""
    for i in range(part, len(cells), parts):
        infeasible = math.isnan(q[i, 0])
        work.stack[0, 0], work.stack[0, 1], work.stack[0, 2] = 0, cells[i, 1], cells[i, 2]
        for j in range(q.shape[1]):
            work.from_q[0, j] = q[i, j]
        count, known = 1, PROVEN
        while count > 0 and known != NEVER:
            count -= 1
            box = cells[i, 0], work.stack[count, 0], work.stack[count, 1], work.stack[count, 2]
            for j in range(q.shape[1]):
                work.q[j] = work.from_q[count, j]
            place_tool(inputs, work, box)
            if infeasible:
                known = _refute(moving, pieces, tree, inputs, work, box)
            else:
                known = _prove(moving, pieces, tree, inputs, balance, work, box)
            if known == OPEN:
                if box[1] == len(inputs.first) - 1:
                    known = NEVER
                    break
                for quarter in range(4):
                    work.stack[count, 0] = box[1] + 1
                    work.stack[count, 1] = 2 * box[2] + quarter // 2
                    work.stack[count, 2] = 2 * box[3] + quarter % 2
                    for j in range(q.shape[1]):
                        work.from_q[count, j] = work.q[j]
                    count += 1
        found[i] = known != NEVER


@njit(**FAST)
def _place_hand(moving, pieces, inputs, work, r):
    """Write poses and boxes of the pieces that are fixed to the tool, opened as in a row of boxes."""
    pose, box = work.scratch.pose, work.scratch.box
    for g in range(moving.hand.shape[1]):
        compose(work.T, inputs.rows.hand[r, g], pose[g])
        box_of(pieces.size, pose, g, box[g])


@njit(**FAST)
def _ball(pieces, scratch, k):
    """Return the middle and the radius of a ball around a piece."""
    x, y, z = pieces.size[k, 6], pieces.size[k, 7], pieces.size[k, 8]
    c0, c1, c2 = pieces.size[k, 3], pieces.size[k, 4], pieces.size[k, 5]
    p = scratch.pose[k]
    return (
        p[0] * c0 + p[1] * c1 + p[2] * c2 + p[9],
        p[3] * c0 + p[4] * c1 + p[5] * c2 + p[10],
        p[6] * c0 + p[7] * c1 + p[8] * c2 + p[11],
        math.sqrt(x * x + y * y + z * z) + pieces.size[k, 0],
    )


@njit(**FAST)
def _hand_motion(pieces, inputs, work, box, g):
    """Return how far (m) a piece fixed to the tool moves in a box: in the world, and against the object."""
    x, y, z, radius = _ball(pieces, work.scratch, g)
    moves, slides = tool_motion(inputs, box, x, y, z)
    play = inputs.rows.play[inputs.first[box[1]] + box[2], g]
    return moves + 0.5 * inputs.width / (1 << box[1]) * radius + play, slides + play


@njit(**FAST)
def _prove(moving, pieces, tree, inputs, balance, work, box):
    """Return what is known of a box being feasible, from joint values ``work.q`` near those in its middle."""
    r = inputs.first[box[1]] + box[2]
    if inputs.rows.misfits[r]:
        return NEVER
    if not reaches_middle(moving, inputs, work):
        return NEVER
    limits, q = inputs.limits, work.q
    for j in inputs.free:
        if not limits[0, j] + ROUNDING <= q[j] <= limits[1, j] - ROUNDING:
            return NEVER
    scratch, hands = work.scratch, moving.hand.shape[1]
    place_pieces(moving, pieces, scratch, work.frames)
    _place_hand(moving, pieces, inputs, work, r)
    if not inputs.rows.fits[r] or not follows(inputs, work, box):
        return OPEN
    for j in inputs.free:
        if not limits[0, j] + ROUNDING <= q[j] - work.most[j]:
            return OPEN
        if not q[j] + work.most[j] <= limits[1, j] - ROUNDING:
            return OPEN
    if len(balance.edges) and not _stands(moving, inputs, balance, work, box):
        return OPEN
    known = PROVEN
    for k in range(len(moving.frame)):
        if k < hands:
            work.motion[k], against = _hand_motion(pieces, inputs, work, box, k)
        else:
            x, y, z, radius = _ball(pieces, scratch, k)
            work.motion[k] = motion_of(moving, work, moving.frame[k], -1, x, y, z, radius)
            against = work.motion[k]
        known = max(known, _free_of_static(pieces, tree, scratch, k, inputs.margin, work.motion[k]))
        if known == NEVER:
            return NEVER
        if not moving.touch[k]:
            for i in moving.objects:
                known = max(known, _free(pieces, scratch, k, i, 0.0, against))
    for i in range(len(moving.hand_pairs)):
        a, b = moving.hand_pairs[i, 0], moving.hand_pairs[i, 1]
        known = max(known, _free(pieces, scratch, a, b, 0.0, inputs.rows.play[r, a] + inputs.rows.play[r, b]))
    for i in range(len(moving.base_pairs)):
        a, b = moving.base_pairs[i, 0], moving.base_pairs[i, 1]
        known = max(known, _free(pieces, scratch, a, b, 0.0, work.motion[a]))
    for i in range(len(moving.arm_pairs)):
        if known == NEVER:
            return NEVER
        a, b = moving.arm_pairs[i, 0], moving.arm_pairs[i, 1]
        motion = work.motion[a]
        if b < len(moving.frame):
            if boxes_apart(scratch.box, a, b, scratch.box, FREE_BAND + ROUNDING + motion + work.motion[b]):
                continue
            far, near = (a, b) if b >= hands and moving.frame[a] > moving.frame[b] else (b, a)
            frame, play = len(moving.joint_origin) - 1, 0.0
            if far < hands:
                play = inputs.rows.play[r, far]
            else:
                frame = moving.frame[far]
            x, y, z, radius = _ball(pieces, scratch, far)
            motion = play + motion_of(moving, work, frame, moving.frame[near], x, y, z, radius)
        known = max(known, _free(pieces, scratch, a, b, 0.0, motion))
    return known


@njit(**FAST)
def _free_of_static(pieces, tree, scratch, k, margin, motion):
    """Return what is known of a piece being free of all static ones."""
    reach, node, known = margin + FREE_BAND + ROUNDING + motion, 0, PROVEN
    while node < len(tree.skip):
        if boxes_apart(scratch.box, k, node, tree.box, reach):
            node = tree.skip[node]
            continue
        if tree.piece[node] >= 0:
            known = max(known, _free(pieces, scratch, k, tree.piece[node], margin, motion))
            if known == NEVER:
                return NEVER
        node += 1
    return known


@njit(**FAST)
def _free(pieces, scratch, a, b, margin, motion):
    """Return what is known of two pieces that keep a margin (m) and of which points move some way (m)."""
    keep = margin + FREE_BAND + ROUNDING
    reach = keep + motion
    if boxes_apart(scratch.box, a, b, scratch.box, reach):
        return PROVEN
    lower, upper = distance_bounds(pieces, scratch.pose, a, b, reach, reach, keep, scratch.simplex)
    if lower >= reach:
        return PROVEN
    return NEVER if upper < keep else OPEN


@njit(**FAST)
def _stands(moving, inputs, balance, work, box):
    """Whether the robot stands in all of a box, see `symgrasp.engine.balance.stands`."""
    r, frames, T = inputs.first[box[1]] + box[2], work.frames, work.T
    hand, load = balance.hand[r], balance.load[r]
    mass = balance.fixed[0] + hand[0] + load[0]
    x, y = balance.fixed[1] + load[1], balance.fixed[2] + load[2]
    way = load[0] * inputs.rows.dh[r]
    for k in range(len(balance.joints) - 1):
        w, f = balance.joints[k], frames[k]
        if w[0] > 0.0:
            p0 = (f[0] * w[1] + f[1] * w[2] + f[2] * w[3]) / w[0] + f[9]
            p1 = (f[3] * w[1] + f[4] * w[2] + f[5] * w[3]) / w[0] + f[10]
            p2 = (f[6] * w[1] + f[7] * w[2] + f[8] * w[3]) / w[0] + f[11]
            mass, x, y = mass + w[0], x + w[0] * p0, y + w[0] * p1
            way += w[0] * motion_of(moving, work, k, -1, p0, p1, p2, 0.0)
    if hand[0] > 0.0:
        p0 = (T[0] * hand[1] + T[1] * hand[2] + T[2] * hand[3]) / hand[0] + T[9]
        p1 = (T[3] * hand[1] + T[4] * hand[2] + T[5] * hand[3]) / hand[0] + T[10]
        p2 = (T[6] * hand[1] + T[7] * hand[2] + T[8] * hand[3]) / hand[0] + T[11]
        x, y = x + hand[0] * p0, y + hand[0] * p1
        moves, _ = tool_motion(inputs, box, p0, p1, p2)
        way += hand[0] * (moves + inputs.rows.sway[r])
    for k in range(len(balance.edges)):
        edge = balance.edges[k]
        if not edge[0] * x + edge[1] * y + way + ROUNDING * mass <= edge[2] * mass:  # nor where it is NaN
            return False
    return True


@njit(**FAST)
def _refute(moving, pieces, tree, inputs, work, box):
    """Return what is known of a box being infeasible."""
    r = inputs.first[box[1]] + box[2]
    if inputs.rows.misfits[r]:
        return PROVEN
    known = NEVER
    beyond, x, y, z = beyond_reach(inputs.reach, work.T)
    if beyond > ROUNDING:
        known = OPEN
        moves, _ = tool_motion(inputs, box, x, y, z)
        if beyond > moves + 0.5 * inputs.width / (1 << box[1]) * inputs.reach.wrist[6] + ROUNDING:
            return PROVEN
    _place_hand(moving, pieces, inputs, work, r)
    scratch = work.scratch
    for g in range(moving.hand.shape[1]):
        motion, against = _hand_motion(pieces, inputs, work, box, g)
        node = 0
        while node < len(tree.skip):
            if boxes_apart(scratch.box, g, node, tree.box, inputs.margin):
                node = tree.skip[node]
                continue
            if tree.piece[node] >= 0:
                known = min(known, _hits(inputs, scratch, g, tree.piece[node], inputs.margin, motion))
                if known == PROVEN:
                    return PROVEN
            node += 1
        if not moving.touch[g]:
            for i in moving.objects:
                known = min(known, _hits(inputs, scratch, g, i, 0.0, against))
    for i in range(len(moving.base_pairs)):
        a, b = moving.base_pairs[i, 0], moving.base_pairs[i, 1]
        motion, _ = _hand_motion(pieces, inputs, work, box, a)
        known = min(known, _hits(inputs, scratch, a, b, 0.0, motion))
    return OPEN if known == NEVER and not inputs.rows.fits[r] else known


@njit(**FAST)
def _hits(inputs, scratch, a, b, margin, motion):
    """Return what is known of two pieces that collide all the time that points of them move some way (m)."""
    if boxes_apart(scratch.box, a, b, scratch.box, margin):
        return NEVER
    known = NEVER
    for level in range(len(inputs.inner)):
        size = inputs.inner[level].size
        bar = margin - HIT_BAND - size[a, 1] - size[b, 1]
        if bar == -math.inf:
            return NEVER
        deep = bar - motion - ROUNDING
        _, upper = distance_bounds(
            inputs.inner[level], scratch.pose, a, b, bar, math.inf, deep, scratch.simplex
        )
        if upper < deep:
            return PROVEN
        if upper < bar:
            known = OPEN
    return known
