"""Measuring an object of revolution from a mesh: its axis, its profile and how symmetric it is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from symgrasp.errors import MeshError
from symgrasp.object.measure.axis import find_axis
from symgrasp.object.measure.meridian import column_angles
from symgrasp.object.measure.mesh_io import read_single_object
from symgrasp.object.measure.outline import distance_outside, simplify
from symgrasp.object.measure.surface import COLUMNS, EDGE, OuterSurface, orient_upright, sample_surface
from symgrasp.poses import Array, from_rotation, translation

__all__ = ["SIMPLIFY_TOLERANCE", "Measurement", "measure_mesh"]

SIMPLIFY_TOLERANCE = 1.5e-4
"""Largest difference (m) of r(h) between the measured profile and its simplification to few knots."""

SLACK = (5e-4, 1.5e-3)
"""Smallest and largest length (m), six times the noise between them, by which a flat end or shoulder may be
too high or too low at an angle without this counting as a difference in radius."""

LEAST_COVERED = 0.9
"""Smallest share of the angles at which an open mesh must have a surface, at every height."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """The object of revolution measured from a mesh: its profile, its pose and its deviation from symmetry.

    The object frame stands at the bottom end of the axis, z along it. Which end is the bottom: the
    lower one where the axis is within 10° of the file's vertical; else
    the end that is not hollow; else the wider end; else the one that is lower along z. `flipped` stands it
    on its other end.

    Attributes:
        source: the file.
        points: (n, 2) knots [h, r] of the profile (m). r is the radius of the outer surface,
            averaged over the angle (median), with the facets of the mesh undone: the radius that
            its vertices lie on. A flat step becomes two knots a few micrometres apart in height.
            The object sticks out of it by as much as `deviation` says, and nothing that is
            computed from the profile keeps a distance for that.
        T_mesh_object: (4, 4) pose of the object frame in the mesh's: metres, with z up whatever the file has.
        heights: (k,) heights of the rows of `deviation` (m).
        angles: (m,) angles of its columns (rad).
        deviation: (k, m) how far the surface lies outside the profile (m), negative inside: measured
            perpendicular to the profile, or in radius where that is more even after moving the surface along
            the axis by half a millimetre (up to 1.5 mm for noisy meshes). On a wall parallel to the axis
            both are the same. The surface is that of the facets, so a polygon of n sides around the axis
            deviates by r (1 - cos π/n) in the middle of each side. NaN where an open mesh has no surface.
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
    def worst(self) -> tuple[float, float, float]:
        """The largest absolute deviation (m), with its height (m) and angle (rad)."""
        row, column = np.unravel_index(np.nanargmax(np.abs(self.deviation)), self.deviation.shape)
        at = self.deviation[row, column]
        return float(abs(at)), float(self.heights[row]), float(self.angles[column])

    @property
    def overall_rms(self) -> float:
        """Root mean square deviation (m) over the whole surface."""
        return float(np.sqrt(np.nanmean(self.deviation**2)))

    def flipped(self) -> Measurement:
        """Return the same object standing on its other end, turned about its x axis."""
        height = self.points[-1, 0]
        turn = from_rotation(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, height])
        flipped = replace(
            self,
            points=np.column_stack([height - self.points[::-1, 0], self.points[::-1, 1]]),
            T_mesh_object=self.T_mesh_object @ turn,
            heights=height - self.heights[::-1],
            angles=-self.angles[::-1],
            deviation=self.deviation[::-1, ::-1].copy(),
        )
        return _read_only(flipped)


def measure_mesh(
    path: str | Path, *, scale: float = 1.0, tolerance: float | None = None, flip: bool = False
) -> Measurement:
    """Measure the object of revolution that a mesh shows, in any pose within its file.

    Only the outer surface counts; the inside of a hollow object may have any shape.

    Args:
        path: a DAE, GLB, OBJ, OFF, PLY or STL file.
        scale: metres in one unit of the file.
        tolerance: largest deviation from symmetry (m). If not given, the larger of 1.5 mm and 3 % of the
            largest radius, but no more than 9 % of that radius: no polygon of 7 sides or fewer is taken
            for a circle, one of 8 sides up to a radius of 19 mm, and one of 13 sides or more always.
        flip: whether the object is to stand on the end other than the one that `Measurement` says.

    Raises:
        MeshError: the file is unusable (see `symgrasp.object.measure.mesh_io.read_single_object`), its
            surface is not closed around an axis, or it deviates from symmetry by more than the tolerance.
    """
    source = str(path)
    if tolerance is not None and not 0 < tolerance < np.inf:
        raise MeshError(source, "tolerance", tolerance, "a length in metres above zero")
    mesh = read_single_object(path, scale)
    T_mesh_object = orient_upright(mesh, find_axis(mesh))
    surface = sample_surface(mesh, T_mesh_object)
    _check_closed(source, mesh, surface)
    curve = _measured_profile(surface)
    points = simplify(curve, SIMPLIFY_TOLERANCE)
    bottom = points[0, 0]
    outline = simplify(curve, 0.05 * SIMPLIFY_TOLERANCE)
    slack = float(np.clip(6.0 * _noise(surface), *SLACK))
    deviation = _deviation(surface, outline, slack, mesh.is_watertight)
    limit = _default_tolerance(float(points[:, 1].max())) if tolerance is None else tolerance
    angles = _wrap(column_angles(COLUMNS))
    _check_symmetric(source, surface, outline, deviation, limit)
    rows = surface.even & (surface.levels > points[0, 0]) & (surface.levels < points[-1, 0])
    order = np.argsort(angles)
    found = _read_only(
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
    return found.flipped() if flip else found


def _default_tolerance(r: float) -> float:
    """Return the tolerance (m) for an object of largest radius ``r`` (m).

    A polygon of n sides deviates by r (1 - cos π/n) from the circle through its corners: 9.9 % of r for 7
    sides, 7.6 % for 8. So the upper bound is what keeps thin prisms of up to 7 sides from being round.
    """
    return float(np.clip(1.5e-3, 0.03 * r, 0.09 * r))


def _read_only(measurement: Measurement) -> Measurement:
    """Make the arrays of a measurement read-only, and return it."""
    for name in ("points", "T_mesh_object", "heights", "angles", "deviation"):
        getattr(measurement, name).setflags(write=False)
    return measurement


def _check_closed(source: str, mesh: trimesh.Trimesh, surface: OuterSurface) -> None:
    """Raise MeshError if an open mesh has a height at which its surface does not go around the axis."""
    if mesh.is_watertight:
        return
    low, high = surface.levels[0], surface.levels[-1]
    margin = 0.02 * (high - low)
    rows = (surface.levels > low + margin) & (surface.levels < high - margin)
    covered = (surface.radius[rows] > 0).mean(axis=1)
    worst = int(np.argmin(covered))
    if covered[worst] < LEAST_COVERED:
        at = surface.levels[rows][worst] - low
        raise MeshError(
            source, "surface", f"open: found at {covered[worst]:.0%} of the angles at height {at:.3f} m",
            "an outer surface that is closed around an axis",
        )  # fmt: skip


def _check_symmetric(
    source: str, surface: OuterSurface, outline: Array, deviation: Array, tolerance: float
) -> None:
    """Raise MeshError if the surface deviates by more than the tolerance, at a grid point or at a vertex."""
    grid = np.nan_to_num(deviation).ravel()
    # Vertices between the columns can stick out further than the grid shows. Those inside the profile are
    # left out, because they may belong to the inner wall of a hollow object.
    corners = np.maximum(distance_outside(surface.corners[:, :2], outline), 0.0)
    at = np.column_stack(
        [np.repeat(surface.levels, COLUMNS), np.tile(column_angles(COLUMNS), len(deviation))]
    )
    values = np.concatenate([grid, corners])
    positions = np.concatenate([at, surface.corners[:, [0, 2]]])
    worst = int(np.argmax(np.abs(values)))
    if abs(values[worst]) > tolerance:
        # From the lowest point of the mesh, since the outline of what is no object may begin further up.
        height = max(0.0, positions[worst, 0] - surface.corners[:, 0].min())
        angle = np.rad2deg(_wrap(positions[worst, 1]))
        enough = _rounded_up(abs(values[worst]))
        raise MeshError(
            source, "symmetry", f"{1e3 * values[worst]:+.1f} mm at height {height:.3f} m, angle {angle:.0f}°",
            f"a surface of revolution to within {1e3 * tolerance:.3g} mm; a tolerance of {1e3 * enough:g} mm "
            f"would accept it (--tolerance {enough:g}, or tolerance: {enough:g} in a scene)",
        )  # fmt: skip


def _rounded_up(length: float) -> float:
    """Return a positive length (m) rounded up to two digits, of which the last is not below 0.1 mm."""
    digit = max(1e-4, 10.0 ** (np.floor(np.log10(length)) - 1))
    return float(np.ceil(length / digit) * digit)


def _wrap(angle: Array) -> Array:
    """Wrap angles (rad) into [-π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _measured_profile(surface: OuterSurface) -> Array:
    """Return the measured profile (n, 2) as [h, r], before it is simplified."""
    # The median over θ suits noise in r and in h alike: on walls it averages radii, and at a flat end or
    # shoulder, where only some angles have a surface at a height, it switches where half of them do.
    radii, noise = np.median(surface.rho, axis=1), _noise(surface)
    solid = np.flatnonzero(radii > 0)
    curve = np.column_stack([surface.levels, radii])[solid[0] : solid[-1] + 1]
    curve = _smooth_end(curve, surface.rings, surface.ends[0], noise)
    mirror = np.array([-1.0, 1.0])
    return (_smooth_end((curve * mirror)[::-1], surface.rings, -surface.ends[1], noise) * mirror)[::-1]


def _noise(surface: OuterSurface) -> float:
    """Return the standard deviation of the radius over the angle (m), unmoved by bumps."""
    beside = np.abs(surface.rho - np.median(surface.rho, axis=1, keepdims=True))[surface.rho > 0]
    return 1.4826 * float(np.median(beside))


def _smooth_end(curve: Array, rings: Array, end: Array, noise: float) -> Array:
    """Replace the lower end of a profile by a disc or a paraboloid, where it is one up to noise.

    Near the axis the same few vertices are seen at all angles, so the median over θ does not average
    out their noise.

    Args:
        curve: (n, 2) as [h, r].
        rings: (m,) radii.
        end: (m,) height of the end surface at those radii.
        noise: standard deviation of the surface (m).

    Returns:
        The profile (m, 2) with the new end, or the given one where its end is neither.
    """
    spread = np.maximum.accumulate(end) - np.minimum.accumulate(end)  # NaN from the first gap on
    flat = spread <= np.minimum(6.0 * noise, 2.5 * noise + rings / 20.0) + 2.0 * EDGE
    disc = slice(0, len(flat) if flat.all() else int(np.argmin(flat)))
    if not flat[0] or abs(end[0] - curve[0, 0]) > 6.0 * noise + 2.0 * EDGE:
        return curve
    radii, width = rings[disc], rings[disc][-1]
    height = float(np.average(end[disc], weights=radii))
    # At the rim of a flat disc the wall begins, so r stays; at a round end r goes on growing.
    beyond = np.interp(end[disc][-1] + 3.0 * noise, *curve.T)
    if beyond > 1.15 * width + (rings[1] - rings[0]):
        return _round_end(curve, radii, end[disc])
    beside = np.searchsorted(curve[:, 0], [height + 3.0 * noise, height + 6.0 * noise], side="right")
    if beside[1] == len(curve):  # thinner than its noise
        return curve
    near, far = curve[beside]
    slope = (far[1] - near[1]) / (far[0] - near[0]) if far[0] > near[0] else 0.0
    edge = max(0.0, near[1] + slope * (height - near[0]))
    return np.concatenate([[[height, edge]], curve[curve[:, 0] >= near[0]]])


def _round_end(curve: Array, rings: Array, end: Array) -> Array:
    """Replace the tip of a profile by the paraboloid fitted to its rings, weighted by their areas."""
    columns = np.column_stack([np.ones_like(rings), rings**2])
    root = np.sqrt(rings)
    (apex, bend), *_ = np.linalg.lstsq(columns * root[:, None], end * root, rcond=None)
    r, rise = np.linspace(0.0, rings[-1], 12), bend * rings[-1] ** 2
    beyond = (curve[:, 0] > apex + rise) & (np.maximum.accumulate(curve[:, 1]) > rings[-1])
    if len(rings) < 3 or rise < 10 * EDGE or not beyond.any():
        return curve
    return np.concatenate([np.column_stack([apex + bend * r**2, r]), curve[beyond]])


def _deviation(surface: OuterSurface, outline: Array, slack: float, closed: bool) -> Array:
    """Return by how much (levels, COLUMNS) the surface lies outside the measured profile (m).

    Its size is the larger one of two: the distance of the surface from the profile, and the difference in
    radius. The distance alone is not enough, because every point of a thin square plate is near to the flat
    ends of the disc around it.

    NaN where an open mesh has no surface.
    """
    levels, radius, even = surface.levels, surface.radius, surface.even
    points = np.column_stack([np.repeat(levels, COLUMNS), radius.ravel()])
    deviation = distance_outside(points, outline).reshape(radius.shape)
    profile = np.interp(levels[even], *outline.T, left=0.0, right=0.0)
    difference = _radial_difference(levels[even], radius[even], profile, slack)
    deviation[even] = np.where(np.abs(difference) > np.abs(deviation[even]), difference, deviation[even])
    return deviation if closed else np.where(radius == 0, np.nan, deviation)


def _radial_difference(levels: Array, radius: Array, profile: Array, slack: float) -> Array:
    """Return how far (k, COLUMNS) the surface reaches beyond a profile in radius (m), negative inside it.

    At a flat end or shoulder no radius is right, as it moves up and down with the noise of the mesh. So
    only that difference counts which remains when the surface is moved along the axis by up to ``slack``.

    Args:
        levels: (k,) evenly spaced heights (m).
        radius: (k, COLUMNS) of the surface (m).
        profile: (k,) radii of the profile (m).
        slack: in m.
    """
    window = 2 * int(np.ceil(slack / (levels[1] - levels[0]))) + 1
    least, most = (
        of_window(radius, window, axis=0, mode="constant")
        for of_window in (minimum_filter1d, maximum_filter1d)
    )
    return np.maximum(least - profile[:, None], 0.0) + np.minimum(most - profile[:, None], 0.0)
