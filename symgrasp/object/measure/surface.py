"""The outer surface of a mesh around its axis of revolution, over a grid of heights and angles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from symgrasp.object.measure.axis import frame_along
from symgrasp.object.measure.meridian import cut, envelope, in_frame
from symgrasp.poses import Array

__all__ = ["COLUMNS", "EDGE", "OuterSurface", "orient_upright", "sample_surface"]

COLUMNS = 240
"""Number of angles at which the surface is sampled."""

STEP, FEWEST_ROWS, MOST_ROWS = 1e-4, 200, 4000
"""Distance (m) of the evenly spaced heights at which it is sampled, and the bounds of their number."""

RINGS = 96
"""Number of radii at which the two ends are sampled."""

EDGE = 1e-6
"""The profile is sampled this far (m) below and above every ring of vertices."""

UPRIGHT = np.cos(np.deg2rad(10.0))
"""An axis within 10° of the file's vertical (this is the cosine) is taken to point up in the file."""


class OuterSurface(NamedTuple):
    """The outer surface of a mesh in its object frame, over a grid.

    Attributes:
        levels: (k,) heights of the rows.
        even: (k,) bool, which of them are evenly spaced.
        radius: (k, COLUMNS) distance of the outermost surface from the axis, 0 where there is none.
        rho: (k, COLUMNS) the same with the faceting of the mesh undone, see `Cuts`; 0 where there is none.
        rings: (RINGS,) radii.
        ends: (2, RINGS) height of the bottom and of the top at those radii, NaN where the end is open.
        corners: (n, 3) height, distance from the axis and angle of the vertices.
    """

    levels: Array
    even: np.ndarray
    radius: Array
    rho: Array
    rings: Array
    ends: Array
    corners: Array


def sample_surface(mesh: trimesh.Trimesh, T_mesh_object: Array) -> OuterSurface:
    """Sample the outer surface of a mesh around the z axis of its object frame ``T_mesh_object`` (4, 4)."""
    vertices = in_frame(np.asarray(mesh.vertices), T_mesh_object)
    cuts = cut(vertices, np.asfortranarray(mesh.faces), COLUMNS)
    levels, even = _levels(vertices[:, 2])
    radius, rho = envelope(cuts.column, cuts.h, cuts.r, levels, COLUMNS, cuts.rho)
    rings = (np.arange(RINGS) + 0.5) * (np.hypot(vertices[:, 0], vertices[:, 1]).max() / RINGS)
    ends = []
    for sign in (-1.0, 1.0):
        heights, _ = envelope(cuts.column, cuts.r, sign * cuts.h, rings, COLUMNS)
        ends.append(np.where(np.isfinite(heights).all(axis=1), sign * np.median(heights, axis=1), np.nan))
    x, y, h = vertices.T
    corners = np.column_stack([h, np.hypot(x, y), np.arctan2(y, x)])
    return OuterSurface(
        levels, even, np.maximum(radius, 0.0), np.nan_to_num(rho), rings, np.array(ends), corners
    )


def _levels(heights: Array) -> tuple[Array, np.ndarray]:
    """Return the heights (k,) to sample at, given those of the vertices, and which are evenly spaced (k,).

    Where many vertices share a height the profile may bend or jump, so it is sampled just below and
    just above: that keeps shoulders sharp.
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


def orient_upright(mesh: trimesh.Trimesh, T_mesh_axis: Array) -> Array:
    """Return an axis frame (4, 4) whose z axis points from the bottom to the top of the object.

    Args:
        mesh: the mesh.
        T_mesh_axis: pose (4, 4) whose z axis is the axis of revolution, pointing either way.
    """
    axis, origin = T_mesh_axis[:3, 2], T_mesh_axis[:3, 3]
    if abs(axis[2]) >= UPRIGHT:
        return frame_along(axis * np.sign(axis[2]), origin)
    surface = sample_surface(mesh, T_mesh_axis)
    upright = _points_up(surface)
    if upright is None:
        upright = bool(axis[2] >= 0)
    return frame_along(axis if upright else -axis, origin)


def _points_up(surface: OuterSurface) -> bool | None:
    """Whether the end with the lower h is the bottom, see `Measurement`; None where both ends look alike."""
    low, high = surface.levels[0], surface.levels[-1]
    height = high - low
    # Depth of the hollow around the axis at each end, as in a glass; an open end counts as a through hole.
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
