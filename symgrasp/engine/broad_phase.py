"""Broad phase: which pieces come near those that an arm moves, by their bounding boxes. Compiled."""

from __future__ import annotations

from symgrasp.collision.boxes import boxes_apart, oriented_boxes_apart
from symgrasp.collision.simplex import FAST
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.kinematics import place_arm, place_hand
from symgrasp.ik.vectors import STRICT

__all__ = ["mark_near"]


@njit(**ENTRY)
def mark_near(moving, pieces, tree, scratch, T_world_base, T, row, q, reach, near, near_pairs):
    """Mark the pieces and pairs whose boxes are within ``reach`` (m), among those that must not collide.

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
        near: (P,) bool, receives the marks of the object's and the static pieces that are near a moving one.
        near_pairs: (.,) bool, receives the marks of the pairs of the robot's own pieces: ``hand_pairs``,
            then ``base_pairs``, then ``arm_pairs``.
    """
    _place(moving, pieces, scratch, T_world_base, T, row, q)
    _mark(moving, pieces.size, tree, scratch, reach, near, near_pairs)


@njit(**STRICT)
def _place(moving, pieces, scratch, T_world_base, T, row, q):
    """Place all moving pieces."""
    place_hand(moving, pieces, scratch, T_world_base, T, row)
    place_arm(moving, pieces, scratch, q)


@njit(**FAST)
def _mark(moving, size, tree, scratch, reach, near, near_pairs):
    """Mark what is near the moving pieces where they are; see `mark_near`."""
    box = scratch.box
    for k in range(len(moving.frame)):
        node = 0
        while node < len(tree.skip):
            if boxes_apart(box, k, node, tree.box, reach):
                node = tree.skip[node]
                continue
            piece = tree.piece[node]
            if piece >= 0 and not near[piece]:
                near[piece] = not oriented_boxes_apart(size, scratch.pose, k, piece, reach)
            node += 1
        if not moving.touch[k]:
            for i in moving.objects:
                near[i] |= not boxes_apart(box, k, i, box, reach)
    first = _mark_pairs(box, moving.hand_pairs, reach, near_pairs, 0)
    first = _mark_pairs(box, moving.base_pairs, reach, near_pairs, first)
    _mark_pairs(box, moving.arm_pairs, reach, near_pairs, first)


@njit(**FAST)
def _mark_pairs(box, pairs, reach, near, first):
    """Mark the near ones of some pairs, from index ``first`` of the marks on; return the next index."""
    for i in range(len(pairs)):
        near[first + i] = not boxes_apart(box, pairs[i, 0], pairs[i, 1], box, reach)
    return first + len(pairs)
