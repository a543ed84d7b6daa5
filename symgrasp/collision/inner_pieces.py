"""Smaller bodies inside the pieces, by whose distance it is known how deep two pieces collide.

A convex body K that contains a ball of radius r about a point c contains its own copy, smaller about c by a
share λ and enlarged by a ball of radius λ r: ``K ⊇ (1 − λ) K + λ c ⊕ B(λ r)``. Of boxes and cylinders, all
extents become smaller by λ r only. So two pieces overlap by at least the sum of those radii, less the
distance of the copies. Small copies tell how deep pieces are inside each other, large ones that their
corners are.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np

from symgrasp.caching import kept
from symgrasp.collision.pieces import PackedPieces
from symgrasp.poses import Array

__all__ = ["inner_pieces"]

SHARES = (0.5, 0.15, 0.03, 0.0)
"""The shares λ."""


def inner_pieces(pieces: PackedPieces) -> tuple[PackedPieces, ...]:
    """Return the bodies inside each of P pieces, for every share λ."""
    content = hashlib.sha256()
    for part in (pieces.vertices, pieces.ranges, pieces.size[:, 2]):
        content.update(np.ascontiguousarray(part).tobytes())
    centre, radius, boxes = kept(("balls", content.hexdigest()), lambda: _balls(pieces))
    count = pieces.ranges[:, 1] - pieces.ranges[:, 0]
    half = pieces.size[:, 6:9]
    found = []
    for share in SHARES:
        less = np.full_like(half, share)
        less[boxes] *= radius[boxes, None] / half[boxes]
        size = pieces.size.copy()
        size[:, 0] += share * radius
        size[:, 3:6] += less * (centre - size[:, 3:6])
        size[:, 6:9] *= 1.0 - less
        shrunk = np.repeat(less, count, axis=0)
        vertices = pieces.vertices + shrunk * (np.repeat(centre, count, axis=0) - pieces.vertices)
        found.append(pieces._replace(vertices=vertices, size=size))
    return tuple(found)


def _balls(pieces: PackedPieces) -> tuple[Array, Array, np.ndarray]:
    """Return what `_ball` does of P pieces: centres (P, 3), radii (P,) (m), and which are boxes."""
    revolved = pieces.size[:, 2] > 0.0
    balls = [
        _ball(pieces.vertices[first:end].tobytes(), turned)
        for (first, end, _), turned in zip(pieces.ranges.tolist(), revolved, strict=True)
    ]
    centre, radius = np.array([b[0] for b in balls]).reshape(-1, 3), np.array([b[1] for b in balls])
    return centre, radius, np.array([b[2] for b in balls], dtype=bool)


@lru_cache(maxsize=4096)
def _ball(data: bytes, revolved: bool) -> tuple[Array, float, bool]:
    """Return a ball inside the hull of vertices: centre (3,) and radius (m), 0 where the hull is flat.

    Returns:
        These, and whether the hull is a box or a cylinder along its axes.
    """
    from scipy.spatial import ConvexHull, QhullError

    vertices = np.frombuffer(data).reshape(-1, 3)
    points = vertices
    if revolved:
        flat = vertices[:, [0, 2]]
        points = np.concatenate([flat, flat * [-1.0, 1.0]])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    centre, radius = middle, 0.0
    if len(points) > points.shape[1]:
        try:
            planes = ConvexHull(points).equations
        except QhullError:
            pass
        else:
            for at in (middle, points.mean(axis=0)):
                inside = float(-(planes[:, :-1] @ at + planes[:, -1]).max())
                if inside > radius:
                    centre, radius = at, inside
    full = radius > 0.0 and bool(np.isclose(np.abs(points - middle), np.ptp(points, axis=0) / 2).all())
    return (np.array([0.0, 0.0, centre[1]]) if revolved else centre), radius, full
