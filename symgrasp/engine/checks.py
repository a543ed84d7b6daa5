"""Certificates for one configuration: free, colliding, or for PyBullet to decide. Compiled.

A pair of pieces is certified free when a separating plane keeps them further apart than the margin
they must keep, and certified colliding when they are closer than that by more than `HIT_BAND`, which
is more than PyBullet's own distances are ever off. Between the two PyBullet decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.engine.distance import FAST, distance_bounds
from symgrasp.engine.tree import box_of
from symgrasp.poses import Array

__all__ = [
    "HIT_BAND", "UNDECIDED", "MovingBodies", "Scratch", "check_arm", "check_hand", "check_round",
    "mark_near", "new_scratch", "place_arm", "place_hand",
]  # fmt: skip

FREE_BAND = 1e-5
"""A gap that exceeds the margin by this (m) is free for PyBullet too: its distances are those of two
points of the pieces, never below the true ones but for rounding, and the hand is placed by the tool
pose, which the joint values may miss by 1e-6 m and rad."""

HIT_BAND = 5e-4
"""A gap that is below the margin by this (m) is a collision for PyBullet too: it may stop before it
has found the nearest points. The worst of 100,000 pairs near touching was off by 0.2 mm."""

SAME_PLACE = 1e-9
"""Poses whose numbers differ by less than this (m and of one) share their collisions: a pair certified
to collide sinks in by `HIT_BAND` at least, six orders of magnitude more."""

UNDECIDED = -1e9
"""Stands for the clearance (m) of what is neither certified free nor certified colliding."""


class MovingBodies(NamedTuple):
    """The moving body of an arm and what it may not touch. Pieces: M move, the first G with the tool.

    Attributes:
        joint_origin: (n, 12) each joint's frame in the one before; the first in the world.
        joint_axis: (n, 3) axes in the joint frames.
        frame: (M,) the joint that moves each piece; unused for the first G.
        local: (M, 12) pose of each piece in its joint's frame; unused for the first G.
        hand: (rows, G, 12) pose of each of the first G pieces in the tool frame, at the opening of
            each row.
        touch: (G,) whether it may touch the object.
        hand_pairs: (., 2) pairs of the first G pieces.
        base_pairs: (., 2) pairs of one of the first G pieces and one of the robot that stands still.
        arm_pairs: (., 2) all other pairs of the robot's pieces, by the one that moves.
        arm_pair_start: (M + 1,) where each moving piece's pairs begin in ``arm_pairs``.
        objects: (.,) the pieces of the object.
    """

    joint_origin: Array
    joint_axis: Array
    frame: np.ndarray
    local: Array
    hand: Array
    touch: np.ndarray
    hand_pairs: np.ndarray
    base_pairs: np.ndarray
    arm_pairs: np.ndarray
    arm_pair_start: np.ndarray
    objects: np.ndarray


class Scratch(NamedTuple):
    """What one thread writes to.

    Attributes:
        pose: (P, 12) where the pieces are.
        box: (P, 6) boxes around them.
        frames: (n, 12) the joints' frames in the world.
        tool: (4, 4) the tool in the world.
        simplex: (4, 3) for `distance_bounds`.
        hit: (4,) the pair found colliding last, and the pair that spoilt the candidate before.
        depth: (2,) how much closer (m) than allowed the former is at least, and the margin (m) of
            the latter.
        place: (2, 12) where the pieces of the latter were.
    """

    pose: Array
    box: Array
    frames: Array
    tool: Array
    simplex: Array
    hit: np.ndarray
    depth: Array
    place: Array


@njit(cache=True)
def new_scratch(pose, solids, joints):
    """Return scratch with all pieces where they stand."""
    own = pose.copy()
    box = np.empty((len(pose), 6))
    for k in range(len(pose)):
        box_of(solids.size, own, k, box[k])
    hit = np.full(4, -1, dtype=np.int64)
    frames, place = np.empty((joints, 12)), np.empty((2, 12))
    return Scratch(own, box, frames, np.empty((4, 4)), np.empty((4, 3)), hit, np.zeros(2), place)


# -- placing --------------------------------------------------------------------------------


@njit(**FAST)
def place_hand(body, solids, scratch, T_world_base, T, row):
    """Place what is fixed to the tool."""
    pose, tool, hand = scratch.pose, scratch.tool, body.hand
    for i in range(3):
        b0, b1, b2 = T_world_base[i, 0], T_world_base[i, 1], T_world_base[i, 2]
        for j in range(4):
            tool[i, j] = b0 * T[0, j] + b1 * T[1, j] + b2 * T[2, j]
        tool[i, 3] += T_world_base[i, 3]
    for g in range(hand.shape[1]):
        for i in range(3):
            t0, t1, t2 = tool[i, 0], tool[i, 1], tool[i, 2]
            for j in range(3):
                pose[g, 3 * i + j] = (
                    t0 * hand[row, g, j] + t1 * hand[row, g, 3 + j] + t2 * hand[row, g, 6 + j]
                )
            at = t0 * hand[row, g, 9] + t1 * hand[row, g, 10] + t2 * hand[row, g, 11]
            pose[g, 9 + i] = at + tool[i, 3]
        box_of(solids.size, pose, g, scratch.box[g])


@njit(**FAST)
def place_arm(body, solids, scratch, q):
    """Place what moves between the base and the tool."""
    frames = scratch.frames
    for j in range(len(q) - 1):
        if j == 0:
            for i in range(12):
                frames[0, i] = body.joint_origin[0, i]
        else:
            _compose(frames[j - 1], body.joint_origin[j], frames[j])
        _spin(frames[j], body.joint_axis[j], q[j])
    for k in range(body.hand.shape[1], len(body.frame)):
        _compose(frames[body.frame[k]], body.local[k], scratch.pose[k])
        box_of(solids.size, scratch.pose, k, scratch.box[k])


@njit(**FAST)
def _compose(a, b, out):
    for i in range(3):
        a0, a1, a2 = a[3 * i], a[3 * i + 1], a[3 * i + 2]
        for j in range(3):
            out[3 * i + j] = a0 * b[j] + a1 * b[3 + j] + a2 * b[6 + j]
        out[9 + i] = a0 * b[9] + a1 * b[10] + a2 * b[11] + a[9 + i]


@njit(**FAST)
def _spin(frame, axis, angle):
    """Turn a frame about one of its own axes."""
    s, c = math.sin(angle), math.cos(angle)
    x, y, z = axis[0], axis[1], axis[2]
    d = 1.0 - c
    r00, r01, r02 = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    r10, r11, r12 = d * x * y + s * z, c + d * y * y, d * y * z - s * x
    r20, r21, r22 = d * x * z - s * y, d * y * z + s * x, c + d * z * z
    for i in range(3):
        a, b, e = frame[3 * i], frame[3 * i + 1], frame[3 * i + 2]
        frame[3 * i] = a * r00 + b * r10 + e * r20
        frame[3 * i + 1] = a * r01 + b * r11 + e * r21
        frame[3 * i + 2] = a * r02 + b * r12 + e * r22


# -- checking -------------------------------------------------------------------------------
# All take the clearance (m) that everything so far has for certain, or UNDECIDED, and return it with
# what they check, or -inf where that is certified colliding; the pair is then in ``scratch.hit``.


@njit(**FAST)
def check_round(body, solids, scratch, gap):
    """Check what is the same all around the object: the hand against the object, and against itself."""
    for g in range(len(body.touch)):
        if not body.touch[g]:
            gap = _against_object(body, solids, scratch, g, gap, -math.inf)
            if gap == -math.inf:
                return gap
    return _pairs(solids, scratch, body.hand_pairs, 0, len(body.hand_pairs), gap, -math.inf)


@njit(**FAST)
def check_hand(body, solids, tree, scratch, margin, gap):
    """Check all else that the tool pose alone places."""
    for g in range(len(body.touch)):
        gap = _against_rest(solids, tree, scratch, g, margin, gap, -math.inf)
        if gap == -math.inf:
            return gap
    return _pairs(solids, scratch, body.base_pairs, 0, len(body.base_pairs), gap, -math.inf)


@njit(**FAST)
def check_arm(body, solids, tree, scratch, margin, gap, best):
    """Check everything that moves against the tool.

    Args:
        best: clearance (m) of a candidate found before, or -inf: with less the answer is -inf too.
    """
    hit = scratch.hit
    if hit[2] >= 0:
        # What spoilt the candidate before often spoils this one too: surely where the two pieces are
        # where they were, as when an arm turns its shoulder over and leaves the rest in place.
        if _in_place(scratch):
            return -math.inf
        gap = _pair(solids, scratch, hit[2], hit[3], scratch.depth[1], gap, best)
        if gap == -math.inf:
            _remember(scratch, scratch.depth[1])
            return gap
    for k in range(len(body.frame) - 1, body.hand.shape[1] - 1, -1):
        after = _against_rest(solids, tree, scratch, k, margin, gap, best)
        if after == -math.inf:
            _remember(scratch, margin)
            return after
        gap = _against_object(body, solids, scratch, k, after, best)
        if gap > -math.inf:
            start = body.arm_pair_start
            gap = _pairs(solids, scratch, body.arm_pairs, start[k], start[k + 1], gap, best)
        if gap == -math.inf:
            _remember(scratch, 0.0)
            return gap
    return gap


@njit(**FAST)
def _remember(scratch, margin):
    """Remember the pair that spoilt a candidate, and where its pieces are."""
    scratch.depth[1] = margin
    for side in range(2):
        scratch.hit[2 + side] = scratch.hit[side]
        for i in range(12):
            scratch.place[side, i] = scratch.pose[scratch.hit[side], i]


@njit(**FAST)
def _in_place(scratch):
    """Whether the pieces of the remembered pair are where they were."""
    for side in range(2):
        piece = scratch.hit[2 + side]
        for i in range(12):
            if abs(scratch.pose[piece, i] - scratch.place[side, i]) > SAME_PLACE:
                return False
    return True


@njit(**FAST)
def mark_near(body, size, tree, scratch, reach, near, near_pairs):
    """Mark what has a box within ``reach`` (m) of that of a piece that moves, where the two may not touch.

    Args:
        size: of all pieces, see `Solids`.
        near: (P,) bool receives marks for the pieces of the object and those that stand still.
        near_pairs: (.,) bool receives marks for the pairs of the robot's own pieces: ``hand_pairs``,
            then ``base_pairs``, then ``arm_pairs``.
    """
    box, hands = scratch.box, body.hand.shape[1]
    for k in range(len(body.frame)):
        node = 0
        while node < len(tree.skip):
            if _far(box, k, node, tree.box, reach):
                node = tree.skip[node]
                continue
            piece = tree.piece[node]
            if piece >= 0 and not near[piece]:
                near[piece] = not _boxes_apart(size, scratch.pose, k, piece, reach)
            node += 1
        if k >= hands or not body.touch[k]:
            for i in body.objects:
                near[i] |= not _far(box, k, i, box, reach)
    first = _mark_pairs(box, body.hand_pairs, reach, near_pairs, 0)
    first = _mark_pairs(box, body.base_pairs, reach, near_pairs, first)
    _mark_pairs(box, body.arm_pairs, reach, near_pairs, first)


@njit(**FAST)
def _mark_pairs(box, pairs, reach, near, first):
    for i in range(len(pairs)):
        near[first + i] = not _far(box, pairs[i, 0], pairs[i, 1], box, reach)
    return first + len(pairs)


@njit(**FAST)
def _against_object(body, solids, scratch, k, gap, best):
    box = scratch.box
    for i in body.objects:
        if not _far(box, k, i, box, max(gap, FREE_BAND)):
            gap = _pair(solids, scratch, k, i, 0.0, gap, best)
            if gap == -math.inf:
                return gap
    return gap


@njit(**FAST)
def _pairs(solids, scratch, pairs, first, end, gap, best):
    box = scratch.box
    for i in range(first, end):
        a, b = pairs[i, 0], pairs[i, 1]
        if not _far(box, a, b, box, max(gap, FREE_BAND)):
            gap = _pair(solids, scratch, a, b, 0.0, gap, best)
            if gap == -math.inf:
                return gap
    return gap


@njit(**FAST)
def _against_rest(solids, tree, scratch, k, margin, gap, best):
    own, box, skip, piece = scratch.box, tree.box, tree.skip, tree.piece
    node = 0
    while node < len(skip):
        if _far(own, k, node, box, max(gap, margin + FREE_BAND)):
            node = skip[node]
            continue
        if piece[node] >= 0:
            gap = _pair(solids, scratch, k, piece[node], margin, gap, best)
            if gap == -math.inf:
                return gap
        node += 1
    return gap


@njit(**FAST)
def _far(box, a, b, other, reach):
    """Whether box a of some and box b of others are further apart than ``reach``."""
    return (
        box[a, 0] > other[b, 3] + reach
        or other[b, 0] > box[a, 3] + reach
        or box[a, 1] > other[b, 4] + reach
        or other[b, 1] > box[a, 4] + reach
        or box[a, 2] > other[b, 5] + reach
        or other[b, 2] > box[a, 5] + reach
    )


@njit(**FAST)
def _pair(solids, scratch, a, b, margin, gap, best):
    """Check a pair of pieces, whose boxes are near, that must keep a margin (m)."""
    size = solids.size
    sure = margin + FREE_BAND
    reach = max(gap, sure)
    if _boxes_apart(size, scratch.pose, a, b, reach):
        return gap
    slack = size[a, 1] + size[b, 1]
    bar = max(best, margin - HIT_BAND - slack)
    lower, upper = distance_bounds(solids, scratch.pose, a, b, reach, sure, bar, scratch.simplex)
    if upper < bar:
        scratch.hit[0], scratch.hit[1], scratch.depth[0] = a, b, margin - upper - slack
        return -math.inf
    return min(gap, lower) if lower >= sure else UNDECIDED


@njit(**FAST)
def _boxes_apart(size, pose, a, b, reach):
    """Whether a face of either piece's own box keeps the pieces further apart than ``reach``."""
    reach += size[a, 0] + size[b, 0]
    d0, d1, d2 = pose[b, 9] - pose[a, 9], pose[b, 10] - pose[a, 10], pose[b, 11] - pose[a, 11]
    for i in range(3):
        d = (d0, d1, d2)[i]
        for j in range(3):
            d += pose[b, 3 * i + j] * size[b, 3 + j] - pose[a, 3 * i + j] * size[a, 3 + j]
        if i == 0:
            d0 = d
        elif i == 1:
            d1 = d
        else:
            d2 = d
    # Components of the boxes' axes along each other.
    across0, across1, across2 = size[b, 6], size[b, 7], size[b, 8]
    for i in range(3):
        half, along = 0.0, d0 * pose[a, i] + d1 * pose[a, 3 + i] + d2 * pose[a, 6 + i]
        for j in range(3):
            c = pose[a, i] * pose[b, j] + pose[a, 3 + i] * pose[b, 3 + j] + pose[a, 6 + i] * pose[b, 6 + j]
            half += abs(c) * size[b, 6 + j]
            if j == 0:
                across0 += abs(c) * size[a, 6 + i]
            elif j == 1:
                across1 += abs(c) * size[a, 6 + i]
            else:
                across2 += abs(c) * size[a, 6 + i]
        if abs(along) > half + size[a, 6 + i] + reach:
            return True
    for j in range(3):
        along = d0 * pose[b, j] + d1 * pose[b, 3 + j] + d2 * pose[b, 6 + j]
        if abs(along) > (across0, across1, across2)[j] + reach:
            return True
    return False
