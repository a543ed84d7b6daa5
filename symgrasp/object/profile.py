"""The radius profile r(h) of an object of revolution (section 3.1 of the paper)."""

from __future__ import annotations

from collections.abc import Sized
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import ProfileError
from symgrasp.poses import Array

if TYPE_CHECKING:
    import trimesh

    from symgrasp.object.measure.measurement import Measurement

__all__ = ["COLLISION_FACETS", "MOST_KNOTS", "Profile"]

MOST_KNOTS = 10_000
"""Most knots of a profile."""

COLLISION_FACETS = 48
"""Sides of the polygons that stand for circles in the object's collision shape. They are circumscribed,
so the shape contains the object and exceeds it by at most 0.22 % of the radius (0.07 mm on a bottle)."""


class Profile:
    """Outer radius r(h) of an object of revolution over the height along its axis, piecewise linear.

    Args:
        points: (n, 2) array of ``[h, r]`` in metres, 2 <= n <= `MOST_KNOTS`, heights strictly increasing,
            radii not negative and not all zero.
        source: what to call this profile in error messages.

    Attributes:
        T_mesh_object: for a profile measured from a mesh, the pose (4, 4) of the object frame in
            the mesh; otherwise None.

    Raises:
        ProfileError: the points are not such an array.
    """

    T_mesh_object: Array | None = None

    def __init__(self, points: ArrayLike, source: str = "profile") -> None:
        if isinstance(points, Sized) and len(points) > MOST_KNOTS:
            raise ProfileError(source, "profile", f"{len(points):,} knots", f"at most {MOST_KNOTS:,} knots")
        try:
            array = np.array(points, dtype=float)
        except (TypeError, ValueError):
            raise ProfileError(
                source, "profile", points, "a list of [height, radius] pairs in metres"
            ) from None
        if array.ndim != 2 or array.shape[1:] != (2,) or len(array) < 2:
            raise ProfileError(source, "profile", points, "at least two [height, radius] pairs in metres")
        for i, (h, r) in enumerate(array):
            if not (np.isfinite(h) and np.isfinite(r)):
                raise ProfileError(source, f"profile[{i}]", [h, r], "finite numbers")
            if r < 0:
                raise ProfileError(source, f"profile[{i}]", float(r), "a radius that is not negative")
            if i and h <= array[i - 1, 0]:
                raise ProfileError(
                    source,
                    f"profile[{i}]",
                    float(h),
                    f"a height above the one before it ({array[i - 1, 0]:g})",
                )
        if not array[:, 1].any():
            raise ProfileError(source, "profile", points, "a radius above zero somewhere")
        array.setflags(write=False)
        self._points = array

    @classmethod
    def from_mesh(
        cls, path: str | Path, scale: float = 1.0, *, tolerance: float | None = None, flip: bool = False
    ) -> Profile:
        """Measure the object of revolution that a mesh shows, in any orientation and place.

        Args:
            path: a DAE, GLB, OBJ, OFF, PLY or STL file.
            scale: metres in one unit of the file.
            tolerance: largest deviation from symmetry (m), see
                `symgrasp.object.measure.measurement.measure_mesh`.
            flip: whether the object is to stand on its other end.

        Raises:
            MeshError: the file is unusable, or what it shows is no object of revolution; see
                `symgrasp.object.measure.measurement.measure_mesh`, which also returns the deviations.
        """
        from symgrasp.object.measure.measurement import measure_mesh

        return cls.measured(measure_mesh(path, scale=scale, tolerance=tolerance, flip=flip))

    @classmethod
    def measured(cls, measurement: Measurement) -> Profile:
        """Return the profile that a measurement found."""
        profile = cls(measurement.points, measurement.source)
        profile.T_mesh_object = measurement.T_mesh_object
        return profile

    def __repr__(self) -> str:
        return f"Profile({self._points.tolist()})"

    @property
    def points(self) -> Array:
        """The knots (n, 2) as ``[h, r]``, read-only."""
        return self._points

    @property
    def h_min(self) -> float:
        """Lowest height (m)."""
        return float(self._points[0, 0])

    @property
    def h_max(self) -> float:
        """Highest height (m)."""
        return float(self._points[-1, 0])

    @property
    def r_max(self) -> float:
        """Largest radius (m)."""
        return float(self._points[:, 1].max())

    def radius(self, h: ArrayLike) -> Array:
        """Return r(h) (m) for heights of any shape.

        Raises:
            ProfileError: a height lies outside [h_min, h_max].
        """
        h = np.asarray(h, dtype=float)
        outside = ~((h >= self.h_min) & (h <= self.h_max))
        if outside.any():
            worst = float(h[outside].flat[0])
            raise ProfileError("profile", "height", worst, f"within [{self.h_min:g}, {self.h_max:g}] m")
        return np.asarray(np.interp(h, self._points[:, 0], self._points[:, 1]))

    @property
    def centre_of_mass(self) -> float:
        """Height (m) of the centre of mass of a body of this outline and of even density."""
        (bottom, a), (top, b) = self.points[:-1].T, self.points[1:].T
        volume = (top - bottom) * (a * a + a * b + b * b)
        moment = bottom * volume + (top - bottom) ** 2 * (a * a + 2 * a * b + 3 * b * b) / 4
        return float(moment.sum() / volume.sum())

    def radius_span(self, low: float, high: float) -> tuple[float, float]:
        """Return the smallest and largest radius (m) between two heights, clipped to the object."""
        low, high = np.clip([low, high], self.h_min, self.h_max)
        inside = (self._points[:, 0] > low) & (self._points[:, 0] < high)
        radii = np.concatenate([self._points[inside, 1], self.radius(np.array([low, high]))])
        return float(radii.min()), float(radii.max())

    def convex_pieces(self) -> list[Array]:
        """Cut the object into convex pieces whose union is exactly the object (convex decomposition).

        Neighbouring segments of the profile are joined as long as r(h) stays concave, because a solid
        of revolution is convex exactly where its profile is concave.

        Returns:
            One (m, 3) vertex array in the object frame for each piece; the convex hull of the vertices
            is the piece, with every circle replaced by a circumscribed polygon.
        """
        knots = self._points
        slopes = np.diff(knots[:, 1]) / np.diff(knots[:, 0])
        cuts = [0, *(np.flatnonzero(np.diff(slopes) > 1e-12) + 1), len(knots) - 1]
        angles = np.arange(COLLISION_FACETS) * (2 * np.pi / COLLISION_FACETS)
        circle = np.column_stack([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / COLLISION_FACETS)
        pieces = []
        for first, last in pairwise(cuts):
            piece = knots[first : last + 1]
            if not piece[:, 1].any():
                continue
            rings = [
                np.column_stack([r * circle, np.full(len(circle), h)]) if r > 0 else np.array([[0.0, 0.0, h]])
                for h, r in piece
            ]
            pieces.append(np.concatenate(rings))
        return pieces

    def mesh(self, facets: int = 96) -> trimesh.Trimesh:
        """Return the closed surface as a mesh in the object frame, with every circle as ``facets`` sides."""
        import trimesh

        outline = np.column_stack([self._points[:, 1], self._points[:, 0]])
        ends = [(0.0, self.h_min)] if outline[0, 0] > 0 else []
        tail = [(0.0, self.h_max)] if outline[-1, 0] > 0 else []
        return trimesh.creation.revolve(np.array([*ends, *outline, *tail]), sections=facets)
