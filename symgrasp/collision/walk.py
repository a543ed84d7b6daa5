"""The walk through the tree of the static pieces to those near a piece, nearest first. Compiled."""

from __future__ import annotations

import math

from symgrasp.collision.boxes import boxes_apart
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.simplex import FAST
from symgrasp.compiling import njit

__all__ = ["WAITING", "next_near"]

WAITING = 64
"""Nodes that wait at most: as many as a tree is deep, which halves its pieces at each node."""

FEW = 8
"""Nodes of more pieces are also told apart by the faces of the box around the piece, in its own frame."""


@njit(**FAST)
def next_near(pieces, tree, scratch, k, sure, reach, waiting):
    """Return the next static piece whose box comes near that of piece k.

    Where a node has a hull of all its pieces, that decides before they are tried one by one.

    Args:
        pieces: see `PackedPieces`.
        tree: see `Tree`.
        scratch: see `Scratch`; its stack holds the nodes that wait.
        k: index of a piece.
        sure: distance (m) at which a solid is free; that of its hull is then returned instead of its pieces.
        reach: what is further away (m) than this does not count; it may become less during a walk.
        waiting: number of nodes that wait: what the last call returned; at first 1, node 0, or 0 if the tree
            is empty.

    Returns:
        Index of the piece, -1 at the end of the walk, the number of nodes that wait, and a lower bound (m) of
        the distance of a solid that is free, -inf of all others.
    """
    stack, box = scratch.stack, tree.box
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if boxes_apart(scratch.box, k, node, box, reach):
            continue
        if tree.piece[node] >= 0:
            return tree.piece[node], waiting, -math.inf
        if tree.skip[node] - node > 2 * FEW and _box_apart(pieces.size, scratch.pose, k, node, box, reach):
            continue
        hull = tree.hull[node]
        if hull >= 0:
            enough = sure if tree.solid[node] else reach
            lower, _ = distance_bounds(pieces, scratch.pose, k, hull, reach, enough, enough, scratch.simplex)
            if lower >= reach:
                continue
            if lower >= enough:
                return hull, waiting, lower
        near, far = node + 1, tree.skip[node + 1]
        if _square(scratch.box, k, far, box) < _square(scratch.box, k, near, box):
            near, far = far, near
        stack[waiting], stack[waiting + 1] = far, near
        waiting += 2
    return -1, 0, -math.inf


@njit(**FAST)
def _square(own, k, node, box):
    """Return four times the square of the distance (m²) of the middles of two boxes."""
    d0 = own[k, 0] + own[k, 3] - box[node, 0] - box[node, 3]
    d1 = own[k, 1] + own[k, 4] - box[node, 1] - box[node, 4]
    d2 = own[k, 2] + own[k, 5] - box[node, 2] - box[node, 5]
    return d0 * d0 + d1 * d1 + d2 * d2


@njit(**FAST)
def _box_apart(size, pose, k, node, box, reach):
    """Whether a node is further from piece k than ``reach`` (m) along an axis of the piece's own box."""
    reach += size[k, 0]
    h0 = 0.5 * (box[node, 3] - box[node, 0])
    h1 = 0.5 * (box[node, 4] - box[node, 1])
    h2 = 0.5 * (box[node, 5] - box[node, 2])
    d0, d1, d2 = (
        box[node, 0] + h0 - pose[k, 9],
        box[node, 1] + h1 - pose[k, 10],
        box[node, 2] + h2 - pose[k, 11],
    )
    for i in range(3):
        r0, r1, r2 = pose[k, i], pose[k, 3 + i], pose[k, 6 + i]
        half = h0 * abs(r0) + h1 * abs(r1) + h2 * abs(r2) + size[k, 6 + i]
        if abs(d0 * r0 + d1 * r1 + d2 * r2 - size[k, 3 + i]) > half + reach:
            return True
    return False
