"""Which pieces come near those that an arm moves: all others are certified free. Compiled."""

from __future__ import annotations

from symgrasp.collision.boxes import boxes_apart
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.simplex import FAST
from symgrasp.collision.walk import next_near
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.kinematics import place_arm, place_hand
from symgrasp.ik.vectors import STRICT

__all__ = ["mark_near"]


@njit(**ENTRY)
def mark_near(moving, pieces, tree, scratch, T_world_base, T, row, q, reach, near, near_pairs):
    """Mark pieces and pairs that must not collide and are not certified to be ``reach`` (m) apart.

    Args:
        moving: see `MovingPieces`.
        pieces: see `PackedPieces`.
        tree: the tree of boxes of the static pieces.
        scratch: receives poses and boxes of the moving pieces.
        T_world_base: (4, 4) pose of the robot's base.
        T: (4, 4) tool pose in the base.
        row: row of the grasp.
        q: (n,) joint values.
        reach: the distance (m).
        near: (P,) bool, receives the marks of the object's and the static pieces that are near a moving one,
            and of the moving ones that are near those.
        near_pairs: (.,) bool, receives the marks of the pairs of the robot's own pieces: ``hand_pairs``,
            then ``base_pairs``, then ``arm_pairs``.
    """
    _place(moving, pieces, scratch, T_world_base, T, row, q)
    _mark(moving, pieces, tree, scratch, reach, near, near_pairs)


@njit(**STRICT)
def _place(moving, pieces, scratch, T_world_base, T, row, q):
    """Place all moving pieces."""
    place_hand(moving, pieces, scratch, T_world_base, T, row)
    place_arm(moving, pieces, scratch, q)


@njit(**FAST)
def _mark(moving, pieces, tree, scratch, reach, near, near_pairs):
    """Mark what is near the moving pieces where they are; see `mark_near`."""
    for k in range(len(moving.frame)):
        scratch.stack[0], waiting = 0, min(1, len(tree.skip))
        while True:
            i, waiting, _ = next_near(pieces, tree, scratch, k, reach, reach, waiting)
            if i < 0:
                break
            _mark_near(pieces, scratch, k, i, reach, near)
        if not moving.touch[k]:
            for i in moving.objects:
                _mark_near(pieces, scratch, k, i, reach, near)
    first = _mark_pairs(pieces, scratch, moving.hand_pairs, reach, near_pairs, 0)
    first = _mark_pairs(pieces, scratch, moving.base_pairs, reach, near_pairs, first)
    _mark_pairs(pieces, scratch, moving.arm_pairs, reach, near_pairs, first)


@njit(**FAST)
def _mark_near(pieces, scratch, k, i, reach, near):
    """Mark a moving piece k and another one i where they are near."""
    if not (near[k] and near[i]) and _is_near(pieces, scratch, k, i, reach):
        near[k] = near[i] = True


@njit(**FAST)
def _mark_pairs(pieces, scratch, pairs, reach, near, first):
    """Mark the near ones of some pairs, from index ``first`` of the marks on; return the next index."""
    for i in range(len(pairs)):
        near[first + i] = _is_near(pieces, scratch, pairs[i, 0], pairs[i, 1], reach)
    return first + len(pairs)


@njit(**FAST)
def _is_near(pieces, scratch, a, b, reach):
    """Whether two pieces are not certified further apart than ``reach`` (m)."""
    if boxes_apart(scratch.box, a, b, scratch.box, reach):
        return False
    lower, _ = distance_bounds(pieces, scratch.pose, a, b, reach, reach, reach, scratch.simplex)
    return lower < reach
