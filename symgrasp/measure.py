"""Measuring an object of revolution from a mesh: its axis, its profile and how symmetric it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

from symgrasp.axis import find_axis, frame_along
from symgrasp.errors import MeshError
from symgrasp.meridian import column_angles, cut, envelope
from symgrasp.mesh_io import read_body
from symgrasp.outline import distance_outside, simplify
from symgrasp.poses import Array, inverse, translation

__all__ = ["SIMPLIFIED", "Measurement", "measure_mesh"]

SIMPLIFIED = 1.5e-4
"""Largest difference (m) of r(h) between a measured profile and the few knots that stand for it."""

COLUMNS = 240
"""Angles at which the surface is measured."""

STEP, FEWEST_ROWS, MOST_ROWS = 1e-4, 200, 4000
"""Distance (m) of the heights at which it is measured, and how many they are."""

RINGS = 96
"""Radii at which the ends are measured."""

EDGE = 1e-6
"""Distance (m) from a ring of vertices at which the profile is measured on either side of it."""

COVERED = 0.9
"""Share of the angles at which an open mesh must have a surface, at every height."""

UPRIGHT = np.cos(np.deg2rad(10.0))
"""An axis this near to the file's own vertical is taken to stand in the file as it stands."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a mesh says about the object of revolution it shows.

    The object frame stands at the bottom end of the axis, z along it. Which end is the bottom: the
    lower one where the axis is within 10° of the file's vertical (y in GLB, z otherwise); else
    the end that is not hollow; else the wider end; else the one that is lower along z.

    Attributes:
        source: the file.
        points: (n, 2) knots [h, r] of the profile (m). r is the radius of the outer surface,
            averaged over the angle (median), with the facets of the mesh undone: the radius that
            its vertices lie on. A flat step becomes two knots a few micrometres apart in height.
        T_mesh_object: (4, 4) pose of the object frame in the file's frame, in metres.
        heights: (k,) heights of the rows of `deviation` (m).
        angles: (m,) angles of its columns (rad).
        deviation: (k, m) how far the surface lies outside the profile (m), negative inside;
            measured at right angles to the profile, so on a wall along the axis it is the radial
            deviation, and a shoulder that is tilted counts for what it is. NaN where an open mesh
            has no surface.
        tolerance: largest deviation that was accepted (m).
        simplification: largest difference (m) of r(h) between the measured profile and ``points``.
    """

    source: str
    points: Array
    T_mesh_object: Array
    heights: Array
    angles: Array
    deviation: Array
    tolerance: float
    simplification: float

    @property
    def largest(self) -> Array:
        """Largest absolute deviation (k,) over the angle at each height (m)."""
        return np.nanmax(np.abs(self.deviation), axis=1)

    @property
    def rms(self) -> Array:
        """Root mean square deviation (k,) over the angle at each height (m)."""
        return np.sqrt(np.nanmean(self.deviation**2, axis=1))

    @property
    def worst(self) -> tuple[float, float, float]:
        """The largest absolute deviation (m), with its height (m) and angle (rad)."""
        row, column = np.unravel_index(np.nanargmax(np.abs(self.deviation)), self.deviation.shape)
        at = self.deviation[row, column]
        return float(abs(at)), float(self.heights[row]), float(self.angles[column])

    @property
    def overall_rms(self) -> float:
        """Root mean square deviation (m) over the whole surface."""
        return float(np.sqrt(np.nanmean(self.deviation**2)))


class _Surface(NamedTuple):
    """The outer surface of a mesh in its object frame, over a grid.

    Attributes:
        levels: (k,) heights of the rows.
        even: (k,) bool, which of them are evenly spaced.
        radius: (k, COLUMNS) distance of the outermost surface from the axis, 0 where there is none.
        rho: (k, COLUMNS) the same with facets undone, 0 where there is none.
        rings: (RINGS,) radii.
        ends: (2, RINGS) height of the bottom and of the top at those radii, NaN where open.
    """

    levels: Array
    even: np.ndarray
    radius: Array
    rho: Array
    rings: Array
    ends: Array


def measure_mesh(path: str | Path, *, scale: float = 1.0, tolerance: float | None = None) -> Measurement:
    """Measure the object of revolution that a mesh shows, wherever it lies in its file.

    Only the outer surface counts; the inside of a hollow object may look as it likes.

    Args:
        path: an STL, OBJ, PLY, OFF or GLB file.
        scale: metres in one unit of the file.
        tolerance: largest deviation from symmetry (m); the larger of 1.5 mm and 3 % of the largest
            radius if not given.

    Raises:
        MeshError: the file is unusable (see `symgrasp.mesh_io.read_body`), its surface is not
            closed around an axis, or it deviates from symmetry by more than the tolerance.
    """
    source = str(path)
    if tolerance is not None and not tolerance > 0:
        raise MeshError(source, "tolerance", tolerance, "a length in metres above zero")
    mesh = read_body(path, scale)
    T_mesh_object = _stand_up(mesh, find_axis(mesh), vertical=1 if source.lower().endswith(".glb") else 2)
    surface = _survey(mesh, T_mesh_object)
    _check_closed(source, mesh, surface)
    curve = _curve(surface)
    points = simplify(curve, SIMPLIFIED)
    bottom = points[0, 0]
    deviation = _deviation(surface, curve, mesh.is_watertight)
    limit = max(1.5e-3, 0.03 * float(points[:, 1].max())) if tolerance is None else tolerance
    angles = (column_angles(COLUMNS) + np.pi) % (2 * np.pi) - np.pi
    _check_symmetric(source, deviation, surface.levels - bottom, angles, limit)
    rows = surface.even & (surface.levels > points[0, 0]) & (surface.levels < points[-1, 0])
    order = np.argsort(angles)
    return _frozen(
        Measurement(
            source,
            points - [bottom, 0.0],
            T_mesh_object @ translation([0.0, 0.0, bottom]),
            surface.levels[rows] - bottom,
            angles[order],
            deviation[rows][:, order],
            limit,
            float(np.abs(curve[:, 1] - np.interp(curve[:, 0], *points.T)).max()),
        )
    )


def _frozen(measurement: Measurement) -> Measurement:
    for name in ("points", "T_mesh_object", "heights", "angles", "deviation"):
        getattr(measurement, name).setflags(write=False)
    return measurement


def _survey(mesh: trimesh.Trimesh, T_mesh_object: Array) -> _Surface:
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
    return _Surface(levels, even, np.maximum(radius, 0.0), np.nan_to_num(rho), rings, np.array(ends))


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
    levels = np.concatenate([evenly, beside, bottom + closer, top - closer])
    order = np.argsort(levels, kind="stable")
    return levels[order], (np.arange(len(levels)) < count)[order]


def _stand_up(mesh: trimesh.Trimesh, T_mesh_axis: Array, vertical: int) -> Array:
    """Turn an axis frame so that its z points from the bottom to the top of the object."""
    axis, origin = T_mesh_axis[:3, 2], T_mesh_axis[:3, 3]
    if abs(axis[vertical]) >= UPRIGHT:
        return frame_along(axis * np.sign(axis[vertical]), origin)
    surface = _survey(mesh, T_mesh_axis)
    upright = _points_up(surface)
    if upright is None:
        upright = bool(axis[2] >= 0)
    return frame_along(axis if upright else -axis, origin)


def _points_up(surface: _Surface) -> bool | None:
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


def _check_closed(source: str, mesh: trimesh.Trimesh, surface: _Surface) -> None:
    """Refuse an open mesh with heights at which no surface goes around the axis."""
    if mesh.is_watertight:
        return
    low, high = surface.levels[0], surface.levels[-1]
    margin = 0.02 * (high - low)
    rows = (surface.levels > low + margin) & (surface.levels < high - margin)
    covered = (surface.radius[rows] > 0).mean(axis=1)
    worst = int(np.argmin(covered))
    if covered[worst] < COVERED:
        at = surface.levels[rows][worst] - low
        raise MeshError(
            source, "surface", f"open: found at {covered[worst]:.0%} of the angles at height {at:.3f} m",
            "an outer surface that is closed around an axis",
        )  # fmt: skip


def _check_symmetric(source: str, deviation: Array, heights: Array, angles: Array, tolerance: float) -> None:
    size = np.nan_to_num(np.abs(deviation))
    row, column = np.unravel_index(np.argmax(size), size.shape)
    if size[row, column] > tolerance:
        where = f"height {heights[row]:.3f} m, angle {np.rad2deg(angles[column]):.0f}°"
        raise MeshError(
            source, "symmetry", f"{1e3 * deviation[row, column]:+.1f} mm at {where}",
            f"a surface of revolution to within {1e3 * tolerance:.2g} mm",
        )  # fmt: skip


def _curve(surface: _Surface) -> Array:
    """Return the measured profile (n, 2) as [h, r], before it is simplified."""
    # The median treats both ways of noise alike: on walls it averages radii, and beside a flat end
    # or shoulder, where some angles already have a surface and others not yet, it finds the height.
    radii = np.median(surface.rho, axis=1)
    beside = np.abs(surface.rho - radii[:, None])[surface.rho > 0]
    noise = 1.4826 * float(np.median(beside))
    solid = np.flatnonzero(radii > 0)
    curve = np.column_stack([surface.levels, radii])[solid[0] : solid[-1] + 1]
    curve = _smooth_end(curve, surface.rings, surface.ends[0], noise)
    mirror = np.array([-1.0, 1.0])
    return (_smooth_end((curve * mirror)[::-1], surface.rings, -surface.ends[1], noise) * mirror)[::-1]


def _smooth_end(curve: Array, rings: Array, end: Array, noise: float) -> Array:
    """Replace the first end of a profile, where it is flat but for noise, by a smooth one.

    Near the axis few vertices share all angles, so the median does not average their noise.

    Args:
        curve: (n, 2) as [h, r].
        rings: (m,) radii.
        end: (m,) height of the end surface at those radii.
        noise: standard deviation of the surface (m).
    """
    spread = np.maximum.accumulate(end) - np.minimum.accumulate(end)  # NaN from the first gap on
    flat = spread <= np.minimum(6.0 * noise, 2.5 * noise + rings / 20.0) + 2.0 * EDGE
    disc = slice(0, len(flat) if flat.all() else int(np.argmin(flat)))
    if not flat[0] or abs(end[0] - curve[0, 0]) > 6.0 * noise + 2.0 * EDGE:
        return curve
    radii, width = rings[disc], rings[disc][-1]
    height = float(np.average(end[disc], weights=radii))
    near, far = (curve[np.searchsorted(curve[:, 0], height + k * noise, side="right")] for k in (3, 6))
    if far[1] > 1.3 * width:
        return _round_end(curve, radii, end[disc])
    slope = (far[1] - near[1]) / (far[0] - near[0]) if far[0] > near[0] else 0.0
    edge = max(0.0, near[1] + slope * (height - near[0]))
    return np.concatenate([[[height, edge]], curve[curve[:, 0] >= near[0]]])


def _round_end(curve: Array, rings: Array, end: Array) -> Array:
    """Replace the tip of a profile by the paraboloid that fits its rings, by their area."""
    columns = np.column_stack([np.ones_like(rings), rings**2])
    root = np.sqrt(rings)
    (apex, bend), *_ = np.linalg.lstsq(columns * root[:, None], end * root, rcond=None)
    r = np.linspace(0.0, rings[-1], 12)
    beyond = (curve[:, 0] > apex + bend * r[-1] ** 2) & (np.maximum.accumulate(curve[:, 1]) > r[-1])
    if bend <= 0 or not beyond.any():
        return curve
    return np.concatenate([np.column_stack([apex + bend * r**2, r]), curve[beyond]])


def _deviation(surface: _Surface, curve: Array, closed: bool) -> Array:
    """Return how far (levels, COLUMNS) the surface lies outside the measured profile (m)."""
    points = np.column_stack([np.repeat(surface.levels, COLUMNS), surface.radius.ravel()])
    distance = distance_outside(points, simplify(curve, 0.05 * SIMPLIFIED)).reshape(surface.radius.shape)
    missing = surface.radius == 0
    beyond = (surface.levels < curve[0, 0]) | (surface.levels > curve[-1, 0])
    distance[missing & beyond[:, None]] = 0.0
    return distance if closed else np.where(missing, np.nan, distance)
