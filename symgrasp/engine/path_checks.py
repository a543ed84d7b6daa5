"""Certificates for all configurations of a path at once. Compiled.

A pair of pieces that is apart at the middle step by more than the two can move on the way, is free at every
step. Only what this leaves open is checked step by step, by the rules of `symgrasp.engine.checks`.

The checks return 0, UNDECIDED, or -inf where a pair is certified colliding at some step; that pair is then in
``scratch.hit``. The pieces that are fixed to the tool have to be placed at the middle step, and stay there
unless a pair collides. Moving, pieces, tree, scratch and path are `MovingPieces`, `PackedPieces`, `Tree`,
`Scratch` and `Path`; row is the row of the grasp, margin is the distance (m) to keep from static pieces.
"""

from __future__ import annotations

import math

from symgrasp.collision.boxes import boxes_apart, oriented_boxes_gap
from symgrasp.collision.distance import distance_bounds_from
from symgrasp.collision.simplex import FAST
from symgrasp.collision.walk import next_near
from symgrasp.compiling import njit
from symgrasp.engine.checks import FREE_BAND, HIT_BAND, UNDECIDED
from symgrasp.engine.kinematics import compose, place_pieces
from symgrasp.engine.search_types import HIT

__all__ = ["check_path_of_arm", "check_path_of_hand", "place_at_step", "write_tool"]


@njit(**FAST)
def write_tool(scratch, path, s):
    """Write where `place_hand` has put the tool into step s of a path."""
    for i in range(3):
        for j in range(3):
            path.tool[s, 3 * i + j] = scratch.tool[i, j]
        path.tool[s, 9 + i] = scratch.tool[i, 3]


@njit(**FAST)
def check_path_of_hand(moving, pieces, tree, scratch, path, row, margin):
    """Check the pieces fixed to the tool against the static pieces and against the robot's base."""
    gap = 0.0
    for g in range(moving.hand.shape[1]):
        gap = min(gap, _against_static(moving, pieces, tree, scratch, path, row, g, margin))
        if gap == -math.inf:
            return gap
    pairs = moving.base_pairs
    return min(gap, _pairs(moving, pieces, scratch, path, row, pairs, 0, len(pairs)))


@njit(**FAST)
def check_path_of_arm(moving, pieces, tree, scratch, path, row, margin):
    """Place the pieces between base and tool at the middle step, and check them against everything."""
    place_pieces(moving, pieces, scratch, path.frames[len(path.frames) // 2])
    _bound_motion(moving, pieces.size, scratch, path)
    gap, start = 0.0, moving.arm_pair_start
    for k in range(len(moving.frame) - 1, moving.hand.shape[1] - 1, -1):
        gap = min(gap, _against_static(moving, pieces, tree, scratch, path, row, k, margin))
        if gap > -math.inf and not moving.touch[k]:
            for i in moving.objects:
                if gap > -math.inf and not boxes_apart(
                    scratch.box, k, i, scratch.box, path.motion[k] + FREE_BAND
                ):
                    gap = min(gap, _pair(moving, pieces, scratch, path, row, k, i, 0.0))
        if gap > -math.inf:
            pairs = moving.arm_pairs
            gap = min(gap, _pairs(moving, pieces, scratch, path, row, pairs, start[k], start[k + 1]))
        if gap == -math.inf:
            return gap
    return gap


@njit(**FAST)
def _bound_motion(moving, size, scratch, path):
    """Write how far the pieces between base and tool move from the middle step.

    Every point of a piece is within its radius of the centre of its box, and the change ΔR of the frame's
    rotation moves it by at most ‖ΔR‖ times that more than the centre. The difference of two rotations has
    ‖ΔR‖ = |ΔR|_F / √2, as its singular values are twice the same one and zero.
    """
    steps, frames, motion = len(path.frames), path.frames, path.motion
    middle = steps // 2
    for k in range(moving.hand.shape[1], len(moving.frame)):
        j, c, most = moving.frame[k], moving.local[k], 0.0
        x0 = c[0] * size[k, 3] + c[1] * size[k, 4] + c[2] * size[k, 5] + c[9]
        x1 = c[3] * size[k, 3] + c[4] * size[k, 4] + c[5] * size[k, 5] + c[10]
        x2 = c[6] * size[k, 3] + c[7] * size[k, 4] + c[8] * size[k, 5] + c[11]
        radius = size[k, 0] + math.sqrt(size[k, 6] ** 2 + size[k, 7] ** 2 + size[k, 8] ** 2)
        at = frames[middle, j]
        for s in range(steps):
            turn = shift = 0.0
            f = frames[s, j]
            for i in range(3):
                d0, d1, d2 = f[3 * i] - at[3 * i], f[3 * i + 1] - at[3 * i + 1], f[3 * i + 2] - at[3 * i + 2]
                turn += d0 * d0 + d1 * d1 + d2 * d2
                shift += (d0 * x0 + d1 * x1 + d2 * x2 + f[9 + i] - at[9 + i]) ** 2
            most = max(most, math.sqrt(shift) + math.sqrt(0.5 * turn) * radius)
        motion[k] = most


@njit(**FAST)
def _against_static(moving, pieces, tree, scratch, path, row, k, margin):
    """Check piece k against the static pieces."""
    gap, reach, waiting = 0.0, margin + FREE_BAND + path.motion[k], min(1, len(tree.skip))
    scratch.stack[0] = 0
    while True:
        i, waiting, _ = next_near(pieces, tree, scratch, k, reach, reach, waiting)
        if i < 0:
            return gap
        gap = min(gap, _pair(moving, pieces, scratch, path, row, k, i, margin))
        if gap == -math.inf:
            return gap


@njit(**FAST)
def _pairs(moving, pieces, scratch, path, row, pairs, first, end):
    """Check the pairs from index first to before end."""
    gap = 0.0
    for i in range(first, end):
        a, b = pairs[i, 0], pairs[i, 1]
        reach = FREE_BAND + _motion(moving, path, a) + _motion(moving, path, b)
        if not boxes_apart(scratch.box, a, b, scratch.box, reach):
            gap = min(gap, _pair(moving, pieces, scratch, path, row, a, b, 0.0))
            if gap == -math.inf:
                return gap
    return gap


@njit(**FAST)
def _motion(moving, path, k):
    """Return how far (m) piece k moves from the middle step."""
    return path.motion[k] if k < len(moving.frame) else 0.0


@njit(**FAST)
def _pair(moving, pieces, scratch, path, row, a, b, margin):
    """Check a pair of pieces with a margin (m) to keep: at the middle step for all, then at each step."""
    size, pose, middle = pieces.size, scratch.pose, len(path.frames) // 2
    sure = margin + FREE_BAND
    reach = sure + _motion(moving, path, a) + _motion(moving, path, b)
    apart, (v0, v1, v2) = oriented_boxes_gap(size, pose, a, b, reach)
    if apart >= reach:
        return 0.0
    slack = size[a, 1] + size[b, 1]
    bar = margin - HIT_BAND - slack
    begin = v0, v1, v2, -1, -1
    lower, upper, begin = distance_bounds_from(pieces, pose, a, b, reach, sure, bar, scratch.simplex, begin)
    gap, at = 0.0 if lower >= sure else UNDECIDED, middle
    if upper >= bar and lower < reach:
        for s in range(len(path.frames)):
            if s != middle:
                place_at_step(moving, scratch, path, row, a, s)
                place_at_step(moving, scratch, path, row, b, s)
                lower, upper, begin = distance_bounds_from(
                    pieces, pose, a, b, sure, sure, bar, scratch.simplex, begin
                )
                if upper < bar:
                    at = s
                    break
                if lower < sure:
                    gap = UNDECIDED
        place_at_step(moving, scratch, path, row, a, middle)
        place_at_step(moving, scratch, path, row, b, middle)
    if upper < bar:
        scratch.hit[0], scratch.hit[1], scratch.depth[0] = a, b, margin - upper - slack
        path.blocked[0], path.blocked[1] = at + 1, HIT
        return -math.inf
    return gap


@njit(**FAST)
def place_at_step(moving, scratch, path, row, k, s):
    """Write the pose of piece k, if it moves, at step s."""
    if k < moving.hand.shape[1]:
        compose(path.tool[s], moving.hand[row, k], scratch.pose[k])
    elif k < len(moving.frame):
        compose(path.frames[s, moving.frame[k]], moving.local[k], scratch.pose[k])
