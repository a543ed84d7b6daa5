"""Sections of a mesh by half-planes through an axis (meridian sections), and their outer envelopes.

A half-plane that ends in the axis and stands at angle θ cuts a mesh in line segments of (h, r).
The upper envelope of r over h is the outer radius; the envelope of h over r is the height of an
end. Both are exact for the triangles: unlike ray casting, no ray can slip through between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array, inverse

__all__ = ["Cuts", "column_angles", "cut", "envelope", "in_frame"]


class Cuts(NamedTuple):
    """The segments of a mesh cut by half-planes.

    Attributes:
        column: (n,) index of the half-plane.
        h: (n, 2) heights of both ends.
        r: (n, 2) distances of both ends from the axis.
        rho: (n, 2) the radius interpolated linearly from those of the triangle's corners. Corners lie
            on the true surface and flat facets inside it, so this undoes the faceting of a mesh.
    """

    column: np.ndarray
    h: Array
    r: Array
    rho: Array


def column_angles(columns: int) -> Array:
    """Return the angles (columns,) (rad) of evenly spaced half-planes."""
    return np.linspace(0.0, 2 * np.pi, columns, endpoint=False) + np.pi / columns


def in_frame(points: Array, pose: Array) -> Array:
    """Return points (n, 3) in the coordinates of a frame ``pose`` (4, 4).

    The result lies in memory coordinate by coordinate, which makes the reading of one of them fast.
    """
    to_frame = inverse(pose)
    # einsum, because a product with so small a matrix is no work for the threads of a BLAS.
    return (np.einsum("ij,nj->in", to_frame[:3, :3], points) + to_frame[:3, 3, None]).T


def cut(vertices: Array, faces: np.ndarray, columns: int) -> Cuts:
    """Cut triangles by the half-planes at `column_angles`.

    Args:
        vertices: (n, 3), z being the axis.
        faces: (m, 3) vertex indices.
        columns: number of half-planes.
    """
    face, column = _overlapping(vertices, faces, columns)
    corners = vertices[faces[face]]
    angle = column_angles(columns)[column][:, None]
    side = corners[..., 1] * np.cos(angle) - corners[..., 0] * np.sin(angle)
    along = corners[..., 0] * np.cos(angle) + corners[..., 1] * np.sin(angle)
    rho = np.hypot(corners[..., 0], corners[..., 1])
    crossing, ends = _crossings(side, np.stack([along, corners[..., 2], rho], axis=-1))
    outside = np.maximum(ends[:, 0, 0], ends[:, 1, 0]) >= 0
    ends = _clip_at_axis(ends[outside])
    return Cuts(column[crossing][outside], ends[..., 1], ends[..., 0], ends[..., 2])


def _overlapping(vertices: Array, faces: np.ndarray, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (face (k,), column (k,)): every pair of triangle and half-plane whose angles overlap."""
    angle = np.arctan2(vertices[:, 1], vertices[:, 0])
    # Corner by corner, since numpy is slow along an axis of three.
    start, *others = (angle[corner] for corner in faces.T)
    second, third = (_wrap(other - start) for other in others)
    low, high = np.minimum(np.minimum(second, third), 0.0), np.maximum(np.maximum(second, third), 0.0)
    step = 2 * np.pi / columns
    first = np.ceil((start + low) / step - 0.5 - 1e-6).astype(int)
    last = np.floor((start + high) / step - 0.5 + 1e-6).astype(int)
    # Corners on more than half a circle: the axis runs through the triangle.
    count = np.where(high - low >= np.pi, columns, last - first + 1)
    face = np.repeat(np.arange(len(faces)), count)
    offset = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    return face, (first[face] + offset) % columns


def _wrap(angle: Array) -> Array:
    """Wrap angles (rad) into [-π, π]."""
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def _crossings(side: Array, values: Array) -> tuple[np.ndarray, Array]:
    """Interpolate the values at the corners of triangles along the line ``side == 0``.

    Args:
        side: (n, 3) signed distances of the corners from the plane.
        values: (n, 3, v) values at the corners.

    Returns:
        Indices (m,) of the triangles that cross, and the values (m, 2, v) at both ends of the crossing.
    """
    above = side >= 0
    count = np.count_nonzero(above, axis=1)
    crossing = np.flatnonzero((count == 1) | (count == 2))
    side, values, above, count = side[crossing], values[crossing], above[crossing], count[crossing]
    # One corner lies alone on its side of the plane; the crossing runs between its two edges.
    alone = np.argmax(above == (count == 1)[:, None], axis=1)
    row = np.arange(len(crossing))
    ends = np.empty((len(crossing), 2, values.shape[2]))
    for k in (0, 1):
        other = (alone + 1 + k) % 3
        s = (side[row, alone] / (side[row, alone] - side[row, other]))[:, None]
        ends[:, k] = values[row, alone] + s * (values[row, other] - values[row, alone])
    return crossing, ends


def _clip_at_axis(ends: Array) -> Array:
    """Cut off the part of segments (m, 2, v) that lies behind the axis, where the first value is negative."""
    for k in (0, 1):
        behind = ends[:, k, 0] < 0
        inner, outer = ends[behind, k], ends[behind, 1 - k]
        s = inner[:, :1] / (inner[:, :1] - outer[:, :1])
        ends[behind, k] = inner + s * (outer - inner)
        ends[behind, k, 0] = 0.0
    return ends


def envelope(
    column: np.ndarray, x: Array, y: Array, levels: Array, columns: int, companion: Array | None = None
) -> tuple[Array, Array]:
    """Return the upper envelope of segments: the largest y at given x, for every column.

    Args:
        column: (n,) column of each segment.
        x: (n, 2) of both ends.
        y: (n, 2) of both ends.
        levels: (k,) values of x, increasing.
        columns: number of columns.
        companion: (n, 2) a second value of both ends, y itself if not given.

    Returns:
        y (k, columns), -inf where there is no segment, and the companion at the same point, NaN where
        there is none.
    """
    companion = y if companion is None else companion
    first = np.searchsorted(levels, np.minimum(*x.T), side="left")
    count = np.searchsorted(levels, np.maximum(*x.T), side="right") - first
    segment = np.repeat(np.arange(len(x)), count)
    level = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count) + first[segment]
    start, run = x[segment, 0], x[segment, 1] - x[segment, 0]
    # A vertical segment contributes its larger end.
    upright = np.where(y[segment, 1] > y[segment, 0], 1.0, 0.0)
    s = np.where(run == 0, upright, (levels[level] - start) / np.where(run == 0, 1.0, run))
    found = y[segment, 0] + s * (y[segment, 1] - y[segment, 0])
    second = companion[segment, 0] + s * (companion[segment, 1] - companion[segment, 0])
    cell = level * columns + column[segment]
    largest = np.full(len(levels) * columns, -np.inf)
    np.maximum.at(largest, cell, found)
    beside = np.full(len(levels) * columns, np.nan)
    winner = found >= largest[cell]
    beside[cell[winner]] = second[winner]
    return largest.reshape(len(levels), columns), beside.reshape(len(levels), columns)
