"""The outer surface of a mesh around its axis of revolution, over a grid of heights and angles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from symgrasp.object.measure.axis import frame_along
from symgrasp.object.measure.meridian import cut, envelope
from symgrasp.poses import Array, inverse

__all__ = ["COLUMNS", "EDGE", "Surface", "stand_up", "survey"]

COLUMNS = 240
"""Angles at which the surface is measured."""

STEP, FEWEST_ROWS, MOST_ROWS = 1e-4, 200, 4000
"""Distance (m) of the heights at which it is measured, and how many they are."""

RINGS = 96
"""Radii at which the ends are measured."""

EDGE = 1e-6
"""Distance (m) from a ring of vertices at which the profile is measured on either side of it."""

UPRIGHT = np.cos(np.deg2rad(10.0))
"""An axis this near to the file's own vertical is taken to stand in the file as it stands."""


class Surface(NamedTuple):
    """The outer surface of a mesh in its object frame, over a grid.

    Attributes:
        levels: (k,) heights of the rows.
        even: (k,) bool, which of them are evenly spaced.
        radius: (k, COLUMNS) distance of the outermost surface from the axis, 0 where there is none.
        rho: (k, COLUMNS) the same with facets undone, 0 where there is none.
        rings: (RINGS,) radii.
        ends: (2, RINGS) height of the bottom and of the top at those radii, NaN where open.
        corners: (n, 3) height, distance from the axis and angle of the vertices.
    """

    levels: Array
    even: np.ndarray
    radius: Array
    rho: Array
    rings: Array
    ends: Array
    corners: Array


def survey(mesh: trimesh.Trimesh, T_mesh_object: Array) -> Surface:
    """Measure the outer surface of a mesh in an object frame."""
    to_object = inverse(T_mesh_object)
    vertices = mesh.vertices @ to_object[:3, :3].T + to_object[:3, 3]
    cuts = cut(vertices, np.asarray(mesh.faces), COLUMNS)
    levels, even = _levels(vertices[:, 2])
    radius, rho = envelope(cuts.column, cuts.h, cuts.r, levels, COLUMNS, cuts.rho)
    rings = (np.arange(RINGS) + 0.5) * (np.hypot(vertices[:, 0], vertices[:, 1]).max() / RINGS)
    ends = []
    for sign in (-1.0, 1.0):
        heights, _ = envelope(cuts.column, cuts.r, sign * cuts.h, rings, COLUMNS)
        ends.append(np.where(np.isfinite(heights).all(axis=1), sign * np.median(heights, axis=1), np.nan))
    x, y, h = vertices.T
    corners = np.column_stack([h, np.hypot(x, y), np.arctan2(y, x)])
    return Surface(levels, even, np.maximum(radius, 0.0), np.nan_to_num(rho), rings, np.array(ends), corners)


def _levels(heights: Array) -> tuple[Array, np.ndarray]:
    """Return heights to measure at, and which are even.

    Where many vertices share a height the profile may bend or jump there, so it is measured just
    below and just above: that is what keeps shoulders sharp.
    """
    bottom, top = heights.min(), heights.max()
    count = int(np.clip((top - bottom) / STEP, FEWEST_ROWS, MOST_ROWS))
    evenly = bottom + (np.arange(count) + 0.5) * ((top - bottom) / count)
    ordered = np.sort(heights)
    groups = np.split(ordered, np.flatnonzero(np.diff(ordered) > 5 * EDGE) + 1)
    rings = [g for g in groups if len(g) >= 8 and g[-1] - g[0] < 10 * EDGE]
    beside = [level for g in rings for level in (g[0] - EDGE, g[-1] + EDGE)]
    closer = EDGE * 1.25 ** np.arange(int(np.log(STEP * 10 / EDGE) / np.log(1.25)))
    levels, first = np.unique(
        np.concatenate([evenly, beside, bottom + closer, top - closer]), return_index=True
    )
    return levels, first < count


def stand_up(mesh: trimesh.Trimesh, T_mesh_axis: Array, vertical: int) -> Array:
    """Turn an axis frame so that its z points from the bottom to the top of the object."""
    axis, origin = T_mesh_axis[:3, 2], T_mesh_axis[:3, 3]
    if abs(axis[vertical]) >= UPRIGHT:
        return frame_along(axis * np.sign(axis[vertical]), origin)
    surface = survey(mesh, T_mesh_axis)
    upright = _points_up(surface)
    if upright is None:
        upright = bool(axis[2] >= 0)
    return frame_along(axis if upright else -axis, origin)


def _points_up(surface: Surface) -> bool | None:
    """Whether the bottom of an object is the end with the lower h; None where both look alike."""
    low, high = surface.levels[0], surface.levels[-1]
    height = high - low
    # How far an end lies back near the axis, as in the mouth of a glass; a hole goes all through.
    inner = np.median(surface.ends[:, : RINGS // 8], axis=1)
    hollow = np.nan_to_num(np.abs(inner - [low, high]), nan=height)
    if abs(hollow[0] - hollow[1]) > 0.1 * height:
        return bool(hollow[0] < hollow[1])
    radii = np.median(surface.rho, axis=1)
    near = min(1e-3, 0.02 * height)
    widths = [float(np.interp(h, surface.levels, radii)) for h in (low + near, high - near)]
    if abs(widths[0] - widths[1]) > 0.05 * max(widths):
        return widths[0] > widths[1]
    return None
