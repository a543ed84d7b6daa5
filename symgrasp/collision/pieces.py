"""Convex pieces, of which all collision geometry is made, packed into arrays for compiled code.

A piece is the convex hull of its vertices, enlarged by a ball (its rounding); or, if revolved, the convex
hull of the circles that its vertices (r, 0, h) describe about its z axis. The shape that PyBullet has is
contained in the piece, and smaller by at most the slack.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from symgrasp.caching import kept
from symgrasp.poses import Array
from symgrasp.progress import Progress

__all__ = ["SEEDS", "PackedPieces", "Piece", "joined", "pack", "pose_rows"]

BRUTE = 12
"""Hulls of at most this many vertices are searched vertex by vertex for their extreme point; larger ones by
hill climbing along their edges."""

SEED_GRID = 4
"""Hill climbing starts from the extreme vertex for one of a set of directions: a grid of this many by this
many on each face of a cube."""

SEEDS = 6 * SEED_GRID * SEED_GRID
"""Number of these directions."""


class Piece(NamedTuple):
    """A convex piece, in the frame of the link or body that it belongs to.

    Attributes:
        vertices: (n, 3) vertices.
        rounding: radius (m) of the ball that the hull is enlarged by.
        slack: by how much (m) the true shape may be smaller; inf where that is unknown.
        revolved: whether the vertices are to be rotated about z.
    """

    vertices: Array
    rounding: float = 0.0
    slack: float = 0.0
    revolved: bool = False


class PackedPieces(NamedTuple):
    """P pieces with V vertices in all, as arrays.

    Attributes:
        vertices: (V, 3).
        edge_start: (V + 1,) where the neighbours of each vertex begin in ``edges``.
        edges: indices of the vertices that share an edge of the hull with each vertex.
        seeds: (S, SEEDS) vertices to start hill climbing from, see `SEED_GRID`; S hulls are large.
        ranges: (P, 3) first vertex, one past the last vertex, and row of ``seeds`` or -1.
        size: (P, 9) rounding, slack, whether revolved, and centre and half extents of the box around
            the piece in its own frame, without its rounding.
    """

    vertices: Array
    edge_start: np.ndarray
    edges: np.ndarray
    seeds: np.ndarray
    ranges: np.ndarray
    size: Array


def pack(pieces: Sequence[Piece], progress: Progress | None = None) -> PackedPieces:
    """Pack pieces into arrays; their vertices are reduced to those of their hulls where it pays.

    Args:
        pieces: the pieces.
        progress: called with the finished share; may raise `Cancelled`.
    """
    vertices: list[Array] = []
    starts: list[np.ndarray] = []
    edges: list[np.ndarray] = []
    seeds: list[np.ndarray] = []
    index, size = np.zeros((len(pieces), 3), dtype=np.int32), np.zeros((len(pieces), 9))
    first = edge = 0
    for k, piece in enumerate(pieces):
        if progress:
            progress(k / len(pieces))
        corners, triangles, count, neighbours = _shape(piece.vertices.tobytes(), piece.revolved)
        row = -1
        if triangles is not None:
            row = len(seeds)
            seeds.append(first + (corners @ _seed_directions().T).argmax(axis=0))
        starts.append(edge + np.concatenate([[0], np.cumsum(count)[:-1]]))
        edges.append(first + neighbours)
        vertices.append(corners)
        index[k] = first, first + len(corners), row
        low, high = corners.min(axis=0), corners.max(axis=0)
        if piece.revolved:
            low[:2], high[:2] = -high[0], high[0]
        size[k] = [piece.rounding, piece.slack, piece.revolved, *(0.5 * (low + high)), *(0.5 * (high - low))]
        first, edge = first + len(corners), edge + len(neighbours)
    return PackedPieces(
        np.concatenate(vertices) if vertices else np.zeros((0, 3)),
        np.concatenate([*starts, [edge]]).astype(np.uint32),
        np.concatenate([*edges, np.zeros(0)]).astype(np.uint32),
        np.array(seeds, dtype=np.uint32).reshape(-1, SEEDS),
        index,
        size,
    )


def joined(first: PackedPieces, second: PackedPieces) -> PackedPieces:
    """Return the pieces of two in one, in this order."""
    vertices, edges = np.uint32(len(first.vertices)), np.uint32(len(first.edges))
    ranges = second.ranges.copy()
    ranges[:, :2] += len(first.vertices)
    ranges[ranges[:, 2] >= 0, 2] += len(first.seeds)
    return PackedPieces(
        np.concatenate([first.vertices, second.vertices]),
        np.concatenate([first.edge_start[:-1], second.edge_start + edges]),
        np.concatenate([first.edges, second.edges + vertices]),
        np.concatenate([first.seeds, second.seeds + vertices]),
        np.concatenate([first.ranges, ranges]),
        np.concatenate([first.size, second.size]),
    )


def pose_rows(poses: Array) -> Array:
    """Return poses (..., 4, 4) as rows (..., 12): the rotation matrix row by row, then the position."""
    poses = np.asarray(poses, dtype=float)
    rotation = poses[..., :3, :3].reshape(*poses.shape[:-2], 9)
    return np.concatenate([rotation, poses[..., :3, 3]], axis=-1)


@lru_cache(maxsize=4096)
def _shape(vertices: bytes, revolved: bool) -> tuple[Array, np.ndarray | None, np.ndarray, np.ndarray]:
    """Return the corners of a piece, the triangles of its hull, and `_neighbours`.

    Links look the same in every engine and robot of their kind, and this is most of the work of packing.
    """
    points = np.frombuffer(vertices).reshape(-1, 3)
    corners, triangles = (points, None) if revolved else _hull(points)
    return corners, triangles, *_neighbours(len(corners), triangles)


def _hull(points: Array) -> tuple[Array, np.ndarray | None]:
    """Return the vertices of the hull of points and, where it is large enough to climb on, its triangles."""
    points = np.asarray(points, dtype=float)
    if len(points) > BRUTE:
        points = np.unique(points, axis=0)
    if len(points) <= BRUTE:
        return points, None
    key = ("hull", hashlib.sha256(points.tobytes()).hexdigest())
    corners, triangles = kept(key, lambda: _corners_and_triangles(points))
    return corners, triangles if len(triangles) else None


def _corners_and_triangles(points: Array) -> tuple[Array, np.ndarray]:
    """Return the vertices of the hull of points, and its triangles: none where the points lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return points, np.zeros((0, 3), dtype=int)
    order = np.full(len(points), -1)
    order[hull.vertices] = np.arange(len(hull.vertices))
    return points[hull.vertices], order[hull.simplices]


def _neighbours(count: int, triangles: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of neighbours of each vertex, and all neighbours in the same order."""
    if triangles is None:
        return np.zeros(count, dtype=int), np.zeros(0, dtype=int)
    sides = np.concatenate([triangles[:, [i, j]] for i in range(3) for j in range(3) if i != j])
    first, second = np.divmod(np.unique(sides[:, 0] * count + sides[:, 1]), count)  # faster than of rows
    return np.bincount(first, minlength=count), second


def _seed_directions() -> Array:
    """Return the centres (SEEDS, 3) of the cells on the cube, in the order of `distance._seed`."""
    middle = (np.arange(SEED_GRID) + 0.5) / SEED_GRID * 2.0 - 1.0
    u, v = (part.ravel() for part in np.meshgrid(middle, middle, indexing="ij"))
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.zeros((len(u), 3))
            face[:, axis], face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = sign, u, v
            faces.append(face)
    return np.concatenate(faces)
