"""Whether a pair of pieces that collides at one end of a part of the range of φ does so along it. Compiled.

A pair that collides at one end of a part does so all along it if it collides at both ends, deeper than its
motion deviates from a straight line (see `symgrasp.collision.inner_pieces` for how deep). Between two ends,
the distance of two convex bodies along a fixed direction is at most the larger one, but for how much their
points leave straight lines, and for a quarter of the way that the turn of each body moves its far end: other
points may be nearest at the other end.
"""

from __future__ import annotations

import math

from symgrasp.collision.distance import distance_bounds
from symgrasp.compiling import njit
from symgrasp.engine.checks import HIT_BAND, OVERLAP
from symgrasp.engine.kinematics import compose, place_frames
from symgrasp.engine.redundancy.cover_types import STOPS, TOUCHES
from symgrasp.engine.redundancy.vectors import SAME_CURVE, copy_pose, largest_turn, wrapped
from symgrasp.ik.vectors import STRICT

__all__ = ["LEAST_SAGITTA", "SAGITTA", "pair_excludes"]

SAGITTA = 0.25
"""By how much (m/rad²) points of the arm leave a straight line between their places at both ends of a
curve, for the square of the sum of the differences of the joints that move them."""

LEAST_SAGITTA = 0.04
"""The same, at least, where a trial shows that they leave it by less."""

TRIED = 3.0
"""By how much more they may leave it than half way between the joint values at both ends: the curve itself is
not straight either."""


@njit(**STRICT)
def pair_excludes(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, ahead):
    """Whether the pair that collides at one end of a curve does so all along it.

    Args:
        ahead: how far (m) the curve may lead away from both of its ends.
    """
    hands, pair = moving.hand.shape[1], nodes.pair[one, a]
    for side in range(2):  # those of the hand are placed where the pair collides, which may be on the retreat
        copy_pose(scratch.pose[pair[side]], nodes.placed[side])
    found = _excludes(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, ahead)
    for side in range(2):
        if pair[side] < hands:
            copy_pose(nodes.placed[side], scratch.pose[pair[side]])
    return found


@njit(**STRICT)
def _excludes(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, ahead):
    """Do what `pair_excludes` does, and leave the pair placed anywhere."""
    step, band = nodes.step[one, a], OVERLAP if nodes.state[one, a] == TOUCHES else HIT_BAND
    here, there = nodes.q[one, a], nodes.q[other, b]
    if step > 0:
        if nodes.step[other, b] != step or nodes.state[other, b] == STOPS:
            return False
        here, there = nodes.there[one, a], nodes.there[other, b]
        if largest_turn(here, there, SAME_CURVE) >= SAME_CURVE:
            return False
    first, second = nodes.pair[one, a, 0], nodes.pair[one, a, 1]
    last = -1
    for side in range(2):
        piece = nodes.pair[one, a, side]
        if moving.hand.shape[1] <= piece < len(moving.frame):
            last = max(last, moving.frame[piece])
    way = 0.0
    for j in range(last + 1):
        way += abs(wrapped(there[j] - here[j]))
    least = LEAST_SAGITTA * way * way + ahead
    if not _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, least):
        return False
    alike = (
        nodes.state[other, b] == nodes.state[one, a]
        and nodes.step[other, b] == step
        and nodes.pair[other, b, 0] == first
        and nodes.pair[other, b, 1] == second
    )
    if alike and not _deeper(nodes, scratch, moving, pieces, inputs, covered, other, b, least):
        return False
    if alike:
        for side in range(2):
            copy_pose(nodes.pose[other, b, side], nodes.end[side])
    else:
        place_frames(moving, there, scratch.frames)
        for side in range(2):
            piece = nodes.pair[one, a, side]
            if moving.hand.shape[1] <= piece < len(moving.frame):
                compose(scratch.frames[moving.frame[piece]], moving.local[piece], nodes.end[side])
            else:
                copy_pose(nodes.pose[one, a, side], nodes.end[side])  # the same wherever the arm is
    turned = 0.0
    for side in range(2):
        angle = _turned(nodes.pose[one, a, side], nodes.end[side])
        turned += 0.25 * angle * _length(pieces.size, nodes.pair[one, a, side])
    bend = SAGITTA * way * way + ahead
    if nodes.depth[one, a] <= bend + turned or (alike and nodes.depth[other, b] <= bend + turned):
        bend = min(bend, least + _bent(nodes, scratch, moving, pieces, one, a, here, there))
    bend += turned
    if not _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, bend):
        return False
    if alike:
        return _deeper(nodes, scratch, moving, pieces, inputs, covered, other, b, bend)
    for side in range(2):
        copy_pose(nodes.end[side], scratch.pose[nodes.pair[one, a, side]])
    for level in range(len(covered.inner)):
        if _depth(scratch, moving, pieces, inputs, covered, first, second, level, band, bend) > bend:
            return True
    return False


@njit(**STRICT)
def _bent(nodes, scratch, moving, pieces, one, a, q, other):
    """Return by how much (m) the pieces of a pair leave straight lines, as far as a trial shows.

    The poses of the pieces half way between the joint values (n,) at both ends are compared with the mean of
    those at both ends, ``nodes.end`` at the other one.
    """
    for j in range(len(q)):
        nodes.half[j] = q[j] + 0.5 * wrapped(other[j] - q[j])
    place_frames(moving, nodes.half, scratch.frames)
    total = 0.0
    for side in range(2):
        piece = nodes.pair[one, a, side]
        if not moving.hand.shape[1] <= piece < len(moving.frame):
            continue
        pose, here, there = nodes.middle, nodes.pose[one, a, side], nodes.end[side]
        compose(scratch.frames[moving.frame[piece]], moving.local[piece], pose)
        for i in range(12):
            pose[i] -= 0.5 * (here[i] + there[i])
        turn = shift = 0.0
        for i in range(3):
            along = pose[9 + i]
            for j in range(3):
                turn += pose[3 * i + j] ** 2
                along += pose[3 * i + j] * pieces.size[piece, 3 + j]
            shift += along * along
        total += math.sqrt(shift) + 0.5 * math.sqrt(turn) * _length(pieces.size, piece)
    return TRIED * total


@njit(**STRICT)
def _deeper(nodes, scratch, moving, pieces, inputs, covered, at, b, depth):
    """Whether the pair that a candidate hits collides deeper than ``depth`` (m)."""
    first, second = nodes.pair[at, b, 0], nodes.pair[at, b, 1]
    band = OVERLAP if nodes.state[at, b] == TOUCHES else HIT_BAND
    while nodes.depth[at, b] <= depth:
        level = nodes.level[at, b]
        if level == len(covered.inner):
            return False
        copy_pose(nodes.pose[at, b, 0], scratch.pose[first])
        copy_pose(nodes.pose[at, b, 1], scratch.pose[second])
        known = _depth(scratch, moving, pieces, inputs, covered, first, second, level, band, 0.0)
        nodes.depth[at, b], nodes.level[at, b] = max(nodes.depth[at, b], known), level + 1
    return True


@njit(**STRICT)
def _turned(pose, other):
    """Return an upper bound of the angle (rad) between two poses (12,), up to a right angle."""
    total = 0.0
    for i in range(9):
        total += (pose[i] - other[i]) ** 2
    return 1.12 * math.sqrt(0.5 * total)


@njit(**STRICT)
def _length(size, k):
    """Return the largest distance (m) of two points of a piece."""
    x, y, z = size[k, 6], size[k, 7], size[k, 8]
    return 2.0 * (math.sqrt(x * x + y * y + z * z) + size[k, 0])


@njit(**STRICT)
def _depth(scratch, moving, pieces, inputs, covered, first, second, level, band, least):
    """Return by how much (m) more than it takes two pieces are certain to collide.

    Where they do by less than ``least`` (m), it may return anything less.

    Args:
        level: which of the bodies inside the pieces tell.
        band: by how much (m) they have to be closer than their margin to be certain to collide.
    """
    bar = -band - pieces.size[first, 1] - pieces.size[second, 1]
    if second > moving.objects[-1]:
        bar += inputs.margin
    if bar == -math.inf:
        return -1.0
    _, upper = distance_bounds(
        covered.inner[level], scratch.pose, first, second, bar - least, math.inf, -math.inf, scratch.simplex
    )
    return bar - upper
