"""The surface of a mesh as convex polygons, which are fewer than its triangles."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.poses import Array

if TYPE_CHECKING:
    import trimesh

__all__ = ["convex_faces", "few_triangles", "fills_hull"]

FLATNESS = 1e-7
"""Vertices within this distance (m) of a plane lie in it. It is far below what
distances are certain up to, so merged triangles are checked as they would be one by one."""

AREA_TOLERANCE = 1e-9
"""Relative difference of the areas of triangles and of their hull below which they fill it."""


HULL_TOLERANCE = 1e-6
"""Relative difference of volume, and of area, from those of its hull below which a mesh is its surface."""


def convex_faces(mesh: trimesh.Trimesh) -> list[Array]:
    """Return convex polygons (n, 3), with their corners in order, that together are the surface of a mesh.

    Triangles that share edges and lie in a plane are one polygon where they fill their convex hull.
    """
    import trimesh

    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    return list(_convex_faces(vertices.tobytes(), faces.tobytes()))


@lru_cache(maxsize=64)
def _convex_faces(vertices: bytes, triangles: bytes) -> tuple[Array, ...]:
    """Return the faces of a mesh with vertices (n, 3) and triangles (m, 3): the worlds and engines of a scene
    all need them."""
    import trimesh

    corners, indices = np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(triangles, dtype=np.int64)
    mesh = trimesh.Trimesh(corners, indices.reshape(-1, 3), process=False)
    single = np.ones(len(mesh.faces), dtype=bool)
    faces = []
    for group in mesh.facets:
        polygon = _polygon(np.asarray(mesh.triangles[group]))
        if polygon is not None:
            faces.append(polygon)
            single[group] = False
    return (*faces, *np.asarray(mesh.triangles)[single])


def few_triangles(mesh: trimesh.Trimesh) -> tuple[Array, np.ndarray]:
    """Return vertices (n, 3) and triangles (m, 3) of the surface of a mesh, with few on its flat parts."""
    faces = convex_faces(mesh)
    vertices, index = np.unique(np.concatenate(faces), axis=0, return_inverse=True)
    first = np.cumsum([0, *map(len, faces)])
    fans = [[(k, k + i, k + i + 1) for i in range(1, end - k - 1)] for k, end in pairwise(first.tolist())]
    return vertices, index.ravel()[np.concatenate(fans)]


def fills_hull(mesh: trimesh.Trimesh) -> bool:
    """Whether a mesh is the surface of its convex hull."""
    import trimesh
    from scipy.spatial import ConvexHull, QhullError

    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    if not mesh.is_watertight:
        return False
    try:
        hull = ConvexHull(mesh.vertices)
    except QhullError:
        return False
    return bool(
        abs(abs(mesh.volume) - hull.volume) <= HULL_TOLERANCE * hull.volume
        and abs(mesh.area - hull.area) <= HULL_TOLERANCE * hull.area
    )


def _polygon(triangles: Array) -> Array | None:
    """Return the corners (n, 3) of the convex polygon that triangles (k, 3, 3) form, None if they do not."""
    from scipy.spatial import ConvexHull, QhullError

    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    points = np.unique(triangles.reshape(-1, 3), axis=0)
    centred = points - points.mean(axis=0)
    across, along, normal = np.linalg.svd(centred, full_matrices=False)[2]
    if abs(centred @ normal).max() > FLATNESS:
        return None
    try:
        hull = ConvexHull(centred @ np.column_stack([across, along]))
    except QhullError:  # the triangles have no area
        return None
    if abs(areas.sum() - hull.volume) > AREA_TOLERANCE * hull.volume:
        return None
    return points[hull.vertices]
