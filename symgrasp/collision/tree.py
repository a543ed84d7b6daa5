"""A tree of bounding boxes over the static pieces, to find those near a box."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.collision.boxes import boxes_of
from symgrasp.poses import Array

__all__ = ["Tree", "build", "grafted"]


class Tree(NamedTuple):
    """A binary tree of axis-aligned boxes, its N nodes in preorder.

    Where a box misses a node, the walk goes on at ``skip``, else at the next node.

    Attributes:
        box: (N, 6) lower and upper corner of each node.
        skip: (N,) index of the node after the whole subtree.
        piece: (N,) index of the piece of a leaf, -1 for inner nodes.
        hull: (N,) index of a piece that is the hull of all pieces of a node, -1 where there is none.
        solid: (N,) whether these pieces are all of the hull's surface, so that they are as near as it is to
            what is outside.
    """

    box: Array
    skip: np.ndarray
    piece: np.ndarray
    hull: np.ndarray
    solid: np.ndarray


def build(size: Array, pose: Array, indices: np.ndarray) -> Tree:
    """Build the tree over some of the pieces, splitting at the median along the axis of the widest spread.

    Args:
        size: (P, 9) see `PackedPieces`.
        pose: (P, 12) poses of all P pieces.
        indices: indices of the pieces to put into the tree.
    """
    return _build(boxes_of(size[indices], pose[indices]), indices)


def grafted(trees: Sequence[Tree]) -> Tree:
    """Return a tree over the pieces of several, none of which is empty, with these as its branches."""
    top = _build(np.array([tree.box[0] for tree in trees]).reshape(-1, 6), np.arange(len(trees)))
    length = np.array([len(trees[k].skip) if k >= 0 else 1 for k in top.piece], dtype=np.int64)
    start = np.concatenate([[0], np.cumsum(length)]).astype(np.int64)
    parts = []
    for node, k in enumerate(top.piece):
        if k >= 0:
            parts.append(trees[k]._replace(skip=trees[k].skip + start[node]))
        else:
            row = Tree(*(values[node : node + 1] for values in top))
            parts.append(row._replace(skip=start[row.skip]))
    return Tree(*(np.concatenate(values) for values in zip(*parts, strict=True))) if parts else top


def _build(boxes: Array, indices: np.ndarray) -> Tree:
    """Build the tree over pieces of some indices with boxes (n, 6)."""
    count = len(indices)
    nodes = max(2 * count - 1, 0)
    none = np.full(nodes, -1, dtype=np.int64)
    tree = Tree(np.empty((nodes, 6)), np.empty(nodes, dtype=np.int64), none, none.copy(), none >= 0)
    middles = boxes[:, :3] + boxes[:, 3:]
    order = np.arange(count)
    # Level by level: the nodes of a level have all pieces between them, leaves of earlier levels included.
    first, node = np.zeros(min(count, 1), dtype=np.int64), np.zeros(min(count, 1), dtype=np.int64)
    while len(first):
        length = np.diff(first, append=count)
        tree.box[node, :3] = np.minimum.reduceat(boxes[order, :3], first)
        tree.box[node, 3:] = np.maximum.reduceat(boxes[order, 3:], first)
        tree.skip[node] = node + 2 * length - 1
        is_leaf = length == 1
        if is_leaf.all():
            tree.piece[node] = indices[order]
            break
        spread = np.maximum.reduceat(middles[order], first) - np.minimum.reduceat(middles[order], first)
        owner = np.repeat(np.arange(len(first)), length)
        order = order[np.lexsort((middles[order, spread.argmax(axis=1)[owner]], owner))]
        half = first + length // 2
        # A node's left child comes right after it, the right one after all of the left one's.
        node = np.column_stack([np.where(is_leaf, node, node + 1), node + 2 * (half - first)])
        first = np.column_stack([first, half])
        stays = np.column_stack([np.ones_like(is_leaf), ~is_leaf])
        first, node = first[stays], node[stays]
    return tree
