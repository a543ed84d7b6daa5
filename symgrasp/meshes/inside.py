"""Asking whether a point lies inside a closed mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import trimesh

__all__ = ["depth_inside"]


def depth_inside(mesh: trimesh.Trimesh, point: np.ndarray) -> float:
    """Return the distance (m) of a point (3,) inside a closed mesh from its surface, 0 for a point outside.

    The signed solid angles of all triangles seen from the point add up to 4π inside and to 0 outside.
    """
    import trimesh

    if not ((point >= mesh.bounds[0]) & (point <= mesh.bounds[1])).all():
        return 0.0
    corners = mesh.triangles - point
    a, b, c = np.moveaxis(corners, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
    angles = 2 * np.arctan2(volume, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
    if abs(angles.sum()) < 2 * np.pi:
        return 0.0
    nearest = trimesh.triangles.closest_point(mesh.triangles, np.tile(point, (len(corners), 1)))
    return float(np.linalg.norm(nearest - point, axis=1).min())
