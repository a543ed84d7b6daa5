"""A tree of bounding boxes over the static pieces, to find those near a box."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.engine.boxes import box_of
from symgrasp.engine.pieces import PackedPieces
from symgrasp.poses import Array

__all__ = ["Tree", "build"]


class Tree(NamedTuple):
    """A binary tree of axis-aligned boxes, its N nodes in preorder.

    Where a box misses a node, the walk goes on at ``skip``, else at the next node.

    Attributes:
        box: (N, 6) lower and upper corner of each node.
        skip: (N,) index of the node after the whole subtree.
        piece: (N,) index of the piece of a leaf, -1 for inner nodes.
    """

    box: Array
    skip: np.ndarray
    piece: np.ndarray


def build(pieces: PackedPieces, pose: Array, indices: np.ndarray) -> Tree:
    """Build the tree over some of the pieces.

    Args:
        pieces: all P pieces.
        pose: (P, 12) their poses.
        indices: indices of the pieces to put into the tree.
    """
    boxes = np.zeros((len(indices), 6))
    for row, k in enumerate(indices):
        box_of(pieces.size, pose, k, boxes[row])
    return Tree(*_build(boxes, np.asarray(indices, dtype=np.int32)))


@njit(cache=True)
def _build(boxes, indices):
    """Return the arrays of `Tree`, splitting at the median along the axis of the widest spread."""
    count = len(indices)
    nodes = max(2 * count - 1, 0)
    box = np.empty((nodes, 6))
    skip = np.empty(nodes, dtype=np.int32)
    piece = np.full(nodes, -1, dtype=np.int32)
    order = np.arange(count)
    stack = np.empty((64, 3), dtype=np.int64)
    height = 0
    if count:
        stack[0, 0], stack[0, 1], stack[0, 2] = 0, 0, count
        height = 1
    while height:
        height -= 1
        node, first, end = stack[height, 0], stack[height, 1], stack[height, 2]
        for i in range(3):
            box[node, i] = boxes[order[first:end], i].min()
            box[node, 3 + i] = boxes[order[first:end], 3 + i].max()
        skip[node] = node + 2 * (end - first) - 1
        if end - first == 1:
            piece[node] = indices[order[first]]
            continue
        axis = 0
        widest = -1.0
        for i in range(3):
            middles = boxes[order[first:end], i] + boxes[order[first:end], 3 + i]
            width = middles.max() - middles.min()
            if width > widest:
                widest, axis = width, i
        middles = boxes[order[first:end], axis] + boxes[order[first:end], 3 + axis]
        order[first:end] = order[first:end][np.argsort(middles)]
        half = first + (end - first) // 2
        left = 2 * (half - first) - 1
        # The left child is pushed last and popped next: depth first, so the stack stays shallow.
        stack[height, 0], stack[height, 1], stack[height, 2] = node + 1 + left, half, end
        stack[height + 1, 0], stack[height + 1, 1], stack[height + 1, 2] = node + 1, first, half
        height += 2
    return box, skip, piece
