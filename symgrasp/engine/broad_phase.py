"""Broad phase: which pieces come near those that an arm moves, by their bounding boxes. Compiled."""

from __future__ import annotations

from symgrasp.compiling import njit
from symgrasp.engine.boxes import boxes_apart, oriented_boxes_apart
from symgrasp.engine.simplex import FAST

__all__ = ["mark_near"]


@njit(**FAST)
def mark_near(moving, size, tree, scratch, reach, near, near_pairs):
    """Mark the pieces and pairs whose boxes are within ``reach`` (m), among those that must not collide.

    Args:
        moving: see `MovingPieces`.
        size: (P, 9) see `PackedPieces`.
        tree: the tree of boxes of the static pieces.
        scratch: poses and boxes of the moving pieces.
        reach: the distance (m).
        near: (P,) bool, receives the marks of the object's and the static pieces that are near a moving one.
        near_pairs: (.,) bool, receives the marks of the pairs of the robot's own pieces: ``hand_pairs``,
            then ``base_pairs``, then ``arm_pairs``.
    """
    box, hands = scratch.box, moving.hand.shape[1]
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
        if k >= hands or not moving.touch[k]:
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
