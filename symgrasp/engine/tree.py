"""A tree of boxes over everything that stands still: which pieces are near a box?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.engine.distance import FAST
from symgrasp.engine.solids import Solids
from symgrasp.poses import Array

__all__ = ["Tree", "box_of", "build"]


class Tree(NamedTuple):
    """A binary tree in preorder: after a node that is missed comes ``skip``, else the next one.

    Attributes:
        box: (N, 6) lower and upper corner of each node.
        skip: (N,) the node after the whole subtree.
        piece: (N,) the piece of a leaf, -1 for inner nodes.
    """

    box: Array
    skip: np.ndarray
    piece: np.ndarray


def build(solids: Solids, pose: Array, pieces: np.ndarray) -> Tree:
    """Build the tree over some pieces at rest.

    Args:
        solids: all pieces.
        pose: (P, 12) where they are.
        pieces: indices of those to put into the tree.
    """
    boxes = np.zeros((len(pieces), 6))
    for row, k in enumerate(pieces):
        box_of(solids.size, pose, k, boxes[row])
    return Tree(*_build(boxes, np.asarray(pieces, dtype=np.int32)))


@njit(**FAST)
def box_of(size, pose, k, box):
    """Write the box (6,) around a piece at its pose, rounding included."""
    for i in range(3):
        r0, r1, r2 = pose[k, 3 * i], pose[k, 3 * i + 1], pose[k, 3 * i + 2]
        centre = r0 * size[k, 3] + r1 * size[k, 4] + r2 * size[k, 5] + pose[k, 9 + i]
        half = abs(r0) * size[k, 6] + abs(r1) * size[k, 7] + abs(r2) * size[k, 8] + size[k, 0]
        box[i] = centre - half
        box[3 + i] = centre + half


@njit(cache=True)
def _build(boxes, pieces):
    count = len(pieces)
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
            piece[node] = pieces[order[first]]
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
        # Right first, so that the left child is taken off the stack next: the stack stays low.
        stack[height, 0], stack[height, 1], stack[height, 2] = node + 1 + left, half, end
        stack[height + 1, 0], stack[height + 1, 1], stack[height + 1, 2] = node + 1, first, half
        height += 2
    return box, skip, piece
