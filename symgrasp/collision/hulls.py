"""Hulls of neighbouring faces of a mesh: one that is certified free spares its faces."""

from __future__ import annotations

import numpy as np

from symgrasp.collision.pieces import PackedPieces, Piece
from symgrasp.collision.tree import Tree
from symgrasp.poses import Array

__all__ = ["with_hulls"]

LEVELS = (3, 6, 9)
"""Nodes of 2^(n-1) + 1 to 2^n pieces have a hull for these n. Hulls of more take long to search."""


def with_hulls(tree: Tree, pieces: PackedPieces, pose: Array, solid: bool) -> tuple[Tree, list[Piece]]:
    """Give hulls to some nodes of a tree over the faces of a mesh.

    Args:
        tree: the tree.
        pieces: all P pieces.
        pose: (P, 12) their poses.
        solid: whether the faces are all of the surface of their hull, see `fills_hull`.

    Returns:
        The tree, with the indices of the hulls in the list, and the list of hulls, in the world.
    """
    leaves = tree.piece >= 0
    order, before = tree.piece[leaves], np.cumsum(leaves) - leaves
    counts = (tree.skip - np.arange(len(tree.skip)) + 1) // 2
    level = np.ceil(np.log2(counts)).astype(int)
    chosen = np.isin(level, LEVELS)
    if solid and level[0] <= max(LEVELS):
        chosen[0], tree.solid[0] = True, True
    hulls, hull = [], tree.hull.copy()
    for node in np.flatnonzero(chosen):
        members = order[before[node] : before[node] + counts[node]]
        hull[node] = len(hulls)
        corners = np.concatenate([_corners(pieces, pose[k], k) for k in members])
        hulls.append(Piece(np.unique(corners, axis=0)))
    return tree._replace(hull=hull), hulls


def _corners(pieces: PackedPieces, pose: Array, k: int) -> Array:
    """Return the vertices (n, 3) of piece k in the world, at a pose (12,)."""
    first, end, _ = pieces.ranges[k]
    return pieces.vertices[first:end] @ pose[:9].reshape(3, 3).T + pose[9:]
