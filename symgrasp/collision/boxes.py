"""Bounding boxes of pieces, and tests whether two of them are further apart than a distance. Compiled."""

from __future__ import annotations

import numpy as np

from symgrasp.collision.simplex import FAST
from symgrasp.compiling import njit
from symgrasp.poses import Array

__all__ = ["box_of", "boxes_apart", "boxes_of", "oriented_boxes_apart"]


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
def oriented_boxes_apart(size, pose, a, b, reach):
    """Whether two pieces are further apart than ``reach`` (m), by their boxes in their own frames.

    Only the faces of the boxes are tried as separating planes, not pairs of their edges.

    Args:
        size: (P, 9) see `PackedPieces`.
        pose: (P, 12) poses of the pieces.
        a: index of a piece.
        b: index of another piece.
        reach: the distance (m).
    """
    reach += size[a, 0] + size[b, 0]
    d0, d1, d2 = pose[b, 9] - pose[a, 9], pose[b, 10] - pose[a, 10], pose[b, 11] - pose[a, 11]
    for i in range(3):
        d = (d0, d1, d2)[i]
        for j in range(3):
            d += pose[b, 3 * i + j] * size[b, 3 + j] - pose[a, 3 * i + j] * size[a, 3 + j]
        if i == 0:
            d0 = d
        elif i == 1:
            d1 = d
        else:
            d2 = d
    # Half extents of both boxes along the axes of b, from the products of their axes.
    across0, across1, across2 = size[b, 6], size[b, 7], size[b, 8]
    for i in range(3):
        half, along = 0.0, d0 * pose[a, i] + d1 * pose[a, 3 + i] + d2 * pose[a, 6 + i]
        for j in range(3):
            c = pose[a, i] * pose[b, j] + pose[a, 3 + i] * pose[b, 3 + j] + pose[a, 6 + i] * pose[b, 6 + j]
            half += abs(c) * size[b, 6 + j]
            if j == 0:
                across0 += abs(c) * size[a, 6 + i]
            elif j == 1:
                across1 += abs(c) * size[a, 6 + i]
            else:
                across2 += abs(c) * size[a, 6 + i]
        if abs(along) > half + size[a, 6 + i] + reach:
            return True
    for j in range(3):
        along = d0 * pose[b, j] + d1 * pose[b, 3 + j] + d2 * pose[b, 6 + j]
        if abs(along) > (across0, across1, across2)[j] + reach:
            return True
    return False
