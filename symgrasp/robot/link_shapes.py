"""The collision shapes of links: checked, and as convex hulls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
import yourdfpy

from symgrasp.errors import UrdfError
from symgrasp.meshes import read_mesh
from symgrasp.poses import Array

__all__ = ["check_shape", "collision_hull"]

LARGEST_SIZE = 1e4
"""No shape is larger (m), nor is a scale."""


def check_shape(path: Path, link: str, shape: yourdfpy.Collision) -> None:
    """Check that the sizes of a collision shape are positive; a mesh may be mirrored by a negative scale.

    Raises:
        UrdfError: the shape has no geometry, a size is not a positive number, or a scale is zero.
    """
    geometry = shape.geometry
    if geometry is None:
        raise UrdfError(path, f"link {link}: collision", None, "a geometry")
    sizes: list[float] = []
    if geometry.box is not None:
        sizes = list(np.ravel(geometry.box.size))
    elif geometry.cylinder is not None:
        sizes = [geometry.cylinder.radius, geometry.cylinder.length]
    elif geometry.sphere is not None:
        sizes = [geometry.sphere.radius]
    elif geometry.mesh is not None and geometry.mesh.scale is not None:
        sizes = list(np.abs(np.ravel(geometry.mesh.scale)))
    if not all(0 < size < LARGEST_SIZE for size in sizes):
        shown = [float(size) for size in sizes]
        raise UrdfError(path, f"link {link}: collision", shown, "sizes that are positive numbers")


def collision_hull(shape: yourdfpy.Collision, find: Callable[[str, str], Path], link: str) -> Array:
    """Return the vertices (n, 3) of a convex hull that contains a collision shape, in the shape's frame.

    Args:
        shape: the shape.
        find: returns the file of a mesh reference, given also the link for messages.
        link: the link that the shape belongs to.
    """
    geometry = shape.geometry
    assert geometry is not None  # the parser requires it
    if geometry.box is not None:
        mesh = trimesh.creation.box(extents=geometry.box.size)
    elif geometry.cylinder is not None:
        # Circumscribed, so that the hull contains the round shape.
        sides = 48
        mesh = trimesh.creation.cylinder(
            radius=geometry.cylinder.radius / np.cos(np.pi / sides),
            height=geometry.cylinder.length,
            sections=sides,
        )
    elif geometry.sphere is not None:
        ball = trimesh.creation.icosphere(subdivisions=3)
        inradius = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center).min()
        mesh = ball.apply_scale(geometry.sphere.radius / inradius)
    else:
        assert geometry.mesh is not None  # the parser knows no other shape
        mesh = read_mesh(find(geometry.mesh.filename, link), f"link {link}")
        scale = geometry.mesh.scale
        mesh.apply_scale(1.0 if scale is None else scale)
    return np.asarray(mesh.convex_hull.vertices)
