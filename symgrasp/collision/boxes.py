"""Bounding boxes of pieces, and tests whether two of them are further apart than a distance. Compiled."""

from __future__ import annotations

import math

import numpy as np

from symgrasp.collision.simplex import FAST
from symgrasp.compiling import njit
from symgrasp.poses import Array

__all__ = ["box_of", "boxes_apart", "boxes_of", "oriented_boxes_gap"]


def boxes_of(size: Array, pose: Array) -> Array:
    """Return the lower and upper corners (P, 6) of the axis-aligned boxes around pieces, rounding included.

    Args:
        size: (P, 9) see `PackedPieces`.
        pose: (P, 12) poses of the pieces.
    """
    R = pose[:, :9].reshape(-1, 3, 3)
    centre = (R @ size[:, 3:6, None])[..., 0] + pose[:, 9:]
    half = (np.abs(R) @ size[:, 6:9, None])[..., 0] + size[:, :1]
    return np.hstack([centre - half, centre + half])


@njit(**FAST)
def box_of(size, pose, k, box):
    """Write the lower and upper corner (6,) of the axis-aligned box around piece k, rounding included."""
    for i in range(3):
        r0, r1, r2 = pose[k, 3 * i], pose[k, 3 * i + 1], pose[k, 3 * i + 2]
        centre = r0 * size[k, 3] + r1 * size[k, 4] + r2 * size[k, 5] + pose[k, 9 + i]
        half = abs(r0) * size[k, 6] + abs(r1) * size[k, 7] + abs(r2) * size[k, 8] + size[k, 0]
        box[i] = centre - half
        box[3 + i] = centre + half


@njit(**FAST)
def boxes_apart(box, a, b, other, reach):
    """Whether two axis-aligned boxes are further apart than ``reach`` (m) along some coordinate axis.

    Args:
        box: (., 6) lower and upper corners, of which row a counts.
        a: a row of ``box``.
        b: a row of ``other``.
        other: (., 6) lower and upper corners, of which row b counts.
        reach: the distance (m).
    """
    return (
        box[a, 0] > other[b, 3] + reach
        or other[b, 0] > box[a, 3] + reach
        or box[a, 1] > other[b, 4] + reach
        or other[b, 1] > box[a, 4] + reach
        or box[a, 2] > other[b, 5] + reach
        or other[b, 2] > box[a, 5] + reach
    )


@njit(**FAST)
def oriented_boxes_gap(size, pose, a, b, enough):
    """Return a lower bound (m) of the distance of two pieces by the boxes around them in their own frames.

    Only the faces of the boxes are tried as separating planes, not pairs of their edges.

    Args:
        size: (P, 9) see `PackedPieces`.
        pose: (P, 12) poses of the pieces.
        a: index of a piece.
        b: index of another piece.
        enough: bound (m) at which to stop.

    Returns:
        The bound, which is negative where no face separates the boxes, and the unit vector (3,) from b to a
        across the face that gives it.
    """
    thick = size[a, 0] + size[b, 0]
    d0, d1, d2 = _between_centres(size, pose, a, b)
    # Half extents of both boxes along the axes of b, from the products of their axes.
    across0, across1, across2 = size[b, 6], size[b, 7], size[b, 8]
    best, side, owner, axis = -math.inf, 0.0, a, 0
    for i in range(3):
        along = d0 * pose[a, i] + d1 * pose[a, 3 + i] + d2 * pose[a, 6 + i]
        c0 = abs(pose[a, i] * pose[b, 0] + pose[a, 3 + i] * pose[b, 3] + pose[a, 6 + i] * pose[b, 6])
        c1 = abs(pose[a, i] * pose[b, 1] + pose[a, 3 + i] * pose[b, 4] + pose[a, 6 + i] * pose[b, 7])
        c2 = abs(pose[a, i] * pose[b, 2] + pose[a, 3 + i] * pose[b, 5] + pose[a, 6 + i] * pose[b, 8])
        across0 += c0 * size[a, 6 + i]
        across1 += c1 * size[a, 6 + i]
        across2 += c2 * size[a, 6 + i]
        half = c0 * size[b, 6] + c1 * size[b, 7] + c2 * size[b, 8] + size[a, 6 + i]
        if abs(along) - half - thick > best:
            best, side, axis = abs(along) - half - thick, along, i
            if best >= enough:
                break
    if best < enough:
        for j in range(3):
            along = d0 * pose[b, j] + d1 * pose[b, 3 + j] + d2 * pose[b, 6 + j]
            half = (across0, across1, across2)[j]
            if abs(along) - half - thick > best:
                best, side, owner, axis = abs(along) - half - thick, along, b, j
    sign = 1.0 if side >= 0.0 else -1.0
    return best, (sign * pose[owner, axis], sign * pose[owner, 3 + axis], sign * pose[owner, 6 + axis])


@njit(**FAST)
def _between_centres(size, pose, a, b):
    """Return the centre (3,) of the box of piece a relative to that of piece b, in the world."""
    d0, d1, d2 = pose[a, 9] - pose[b, 9], pose[a, 10] - pose[b, 10], pose[a, 11] - pose[b, 11]
    for j in range(3):
        d0 += pose[a, j] * size[a, 3 + j] - pose[b, j] * size[b, 3 + j]
        d1 += pose[a, 3 + j] * size[a, 3 + j] - pose[b, 3 + j] * size[b, 3 + j]
        d2 += pose[a, 6 + j] * size[a, 3 + j] - pose[b, 6 + j] * size[b, 3 + j]
    return d0, d1, d2
