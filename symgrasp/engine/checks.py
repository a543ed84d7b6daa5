"""Certificates for one configuration: free, colliding, or left to PyBullet to decide. Compiled.

A pair of pieces is certified free when a separating plane keeps them further apart than the margin
they must keep, and certified colliding when they are closer than that by more than `HIT_BAND`, which
is more than the error of PyBullet's own distances. In between, PyBullet decides.

The checks take as ``gap`` the clearance (m) that everything checked so far is certain to have, or
`UNDECIDED`, and return it with their own pairs included, or -inf where a pair is certified colliding;
that pair is then in ``scratch.hit``. Moving, pieces, tree and scratch are `MovingPieces`,
`PackedPieces`, `Tree` and `Scratch`; margin is the distance (m) to keep from static pieces.
"""

from __future__ import annotations

import math

from symgrasp.collision.boxes import boxes_apart
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.simplex import FAST
from symgrasp.collision.walk import next_near
from symgrasp.compiling import njit

__all__ = ["FREE_BAND", "HIT_BAND", "OVERLAP", "UNDECIDED", "check_arm", "check_hand", "check_row"]

FREE_BAND = 1e-5
"""A gap that exceeds the margin by this (m) is free for PyBullet too: its distances are those of two
points of the pieces, so apart from rounding they are never below the true ones; and the hand is placed
by the tool pose, from which the joint values may deviate by 1e-6 m and rad."""

HIT_BAND = 5e-4
"""A gap that is below the margin by this (m) is a collision for PyBullet too, although it may stop
before it has found the nearest points: the worst of 100,000 pairs near contact was off by 0.2 mm."""

OVERLAP = 2e-5
"""By how much (m) pieces overlap, or are closer than their margin, that collide whatever PyBullet says, whose
distances may be too large near contact: more than pieces and poses are rounded by."""

SAME_POSE = 1e-9
"""Poses whose entries differ by less than this (m, or dimensionless) have the same certified collisions:
those are at least `HIT_BAND` deep, five orders of magnitude more."""

UNDECIDED = -1e9
"""Clearance (m) that stands for: some pair is neither certified free nor certified colliding."""


@njit(**FAST)
def check_row(moving, pieces, scratch, gap):
    """Check the hand against the object and against itself, which is the same for all cells of a row.

    The object is round and the opening depends on the row alone, so the angle θ does not matter.
    """
    for g in range(moving.hand.shape[1]):
        if not moving.touch[g]:
            gap = _against_object(moving, pieces, scratch, g, gap, -math.inf, HIT_BAND)
            if gap == -math.inf:
                return gap
    return _pairs(pieces, scratch, moving.hand_pairs, 0, len(moving.hand_pairs), gap, -math.inf, HIT_BAND)


@njit(**FAST)
def check_hand(moving, pieces, tree, scratch, margin, gap):
    """Check the pieces fixed to the tool against the static pieces and against the robot's base."""
    for g in range(moving.hand.shape[1]):
        gap = _against_static(pieces, tree, scratch, g, margin, gap, -math.inf, HIT_BAND)
        if gap == -math.inf:
            return gap
    return _pairs(pieces, scratch, moving.base_pairs, 0, len(moving.base_pairs), gap, -math.inf, HIT_BAND)


@njit(**FAST)
def check_arm(moving, pieces, tree, scratch, margin, gap, best, band):
    """Check the pieces between base and tool against everything.

    Args:
        best: clearance (m) that is wanted, or -inf; a smaller clearance counts as a collision, because it
            does not improve enough on the best candidate so far.
        band: by how much (m) a pair that collides has to be below its margin: `HIT_BAND`, or less where the
            pieces themselves count, not what PyBullet says of them.
    """
    hit = scratch.hit
    if hit[2] >= 0:
        # The pair that ruled out the last candidate often rules out this one too, and certainly where both
        # pieces have the same poses, as when only the other shoulder configuration differs.
        if _same_poses(scratch):
            return -math.inf
        gap = _pair(pieces, scratch, hit[2], hit[3], scratch.depth[1], gap, best, band)
        if gap == -math.inf:
            _remember(scratch, scratch.depth[1])
            return gap
    for k in range(len(moving.frame) - 1, moving.hand.shape[1] - 1, -1):
        after = _against_static(pieces, tree, scratch, k, margin, gap, best, band)
        if after == -math.inf:
            _remember(scratch, margin)
            return after
        gap = after
        if not moving.touch[k]:
            gap = _against_object(moving, pieces, scratch, k, after, best, band)
        if gap > -math.inf:
            start = moving.arm_pair_start
            gap = _pairs(pieces, scratch, moving.arm_pairs, start[k], start[k + 1], gap, best, band)
        if gap == -math.inf:
            _remember(scratch, 0.0)
            return gap
    return gap


@njit(**FAST)
def _remember(scratch, margin):
    """Remember the pair that ruled out a candidate, its margin (m), and the poses of its pieces."""
    scratch.depth[1] = margin
    for side in range(2):
        scratch.hit[2 + side] = scratch.hit[side]
        for i in range(12):
            scratch.last_pose[side, i] = scratch.pose[scratch.hit[side], i]


@njit(**FAST)
def _same_poses(scratch):
    """Whether the pieces of the remembered pair have the same poses as then."""
    for side in range(2):
        piece = scratch.hit[2 + side]
        for i in range(12):
            if abs(scratch.pose[piece, i] - scratch.last_pose[side, i]) > SAME_POSE:
                return False
    return True


@njit(**FAST)
def _against_object(moving, pieces, scratch, k, gap, best, band):
    """Check piece k against the object."""
    box = scratch.box
    for i in moving.objects:
        if not boxes_apart(box, k, i, box, max(gap, FREE_BAND)):
            gap = _pair(pieces, scratch, k, i, 0.0, gap, best, band)
            if gap == -math.inf:
                return gap
    return gap


@njit(**FAST)
def _pairs(pieces, scratch, pairs, first, end, gap, best, band):
    """Check the pairs from index first to before end."""
    box = scratch.box
    for i in range(first, end):
        a, b = pairs[i, 0], pairs[i, 1]
        if not boxes_apart(box, a, b, box, max(gap, FREE_BAND)):
            gap = _pair(pieces, scratch, a, b, 0.0, gap, best, band)
            if gap == -math.inf:
                return gap
    return gap


@njit(**FAST)
def _against_static(pieces, tree, scratch, k, margin, gap, best, band):
    """Check piece k against the static pieces."""
    waiting, sure = min(1, len(tree.skip)), margin + FREE_BAND
    scratch.stack[0] = 0
    while True:
        i, waiting, lower = next_near(pieces, tree, scratch, k, sure, max(gap, sure), waiting)
        if i < 0:
            return gap
        gap = min(gap, lower) if lower >= sure else _pair(pieces, scratch, k, i, margin, gap, best, band)
        if gap == -math.inf:
            return gap


@njit(**FAST)
def _pair(pieces, scratch, a, b, margin, gap, best, band):
    """Check a pair of pieces with a margin (m) to keep, after their axis-aligned boxes were found near."""
    size = pieces.size
    sure = margin + FREE_BAND
    reach = max(gap, sure)
    slack = size[a, 1] + size[b, 1]
    bar = max(best, margin - band - slack)
    lower, upper = distance_bounds(pieces, scratch.pose, a, b, reach, sure, bar, scratch.simplex)
    if upper < bar:
        scratch.hit[0], scratch.hit[1], scratch.depth[0] = a, b, margin - upper - slack
        return -math.inf
    return min(gap, lower) if lower >= sure else UNDECIDED
