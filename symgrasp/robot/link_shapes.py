"""The collision shapes of links, as their file describes them and as convex hulls."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
import yourdfpy

from symgrasp.errors import UrdfError
from symgrasp.meshes import check_size, read_mesh
from symgrasp.poses import Array

__all__ = ["CollisionShape", "collision_hull", "link_shape", "shape_mesh"]

LARGEST_SIZE = 1e4
"""No size of a shape is larger (m), nor is a scale."""

SIZES = (0.001, 50.0)
"""Smallest and largest size (m) of a mesh that is a link or an obstacle; others are taken to be in other
units."""


class CollisionShape(NamedTuple):
    """A collision shape of a link or an obstacle.

    Attributes:
        kind: box, cylinder, sphere or mesh.
        size: box: full sizes (3,); cylinder: radius, height along z; sphere: radius; mesh: factors for x, y
            and z, negative ones mirror it.
        path: the file of a mesh, otherwise None.
        pose: pose (4, 4) in the frame of the link or obstacle; boxes, cylinders and spheres are centred.
        upright: whether a mesh is turned to z up; see `symgrasp.meshes.read_mesh`.
    """

    kind: str
    size: tuple[float, ...]
    path: Path | None
    pose: Array
    upright: bool = False

    def mesh(self, field: str) -> trimesh.Trimesh:
        """Read the mesh of a shape that is one, scaled, in the shape's own frame.

        Args:
            field: what the shape belongs to, for error messages.

        Raises:
            MeshError: it cannot be read, or is too large or too small to be meant in metres.
        """
        assert self.path is not None
        mesh = read_mesh(self.path, field, upright=self.upright)
        vertices, faces = mesh.vertices * self.size, mesh.faces
        if np.prod(self.size) < 0:  # a mirror image is inside out
            faces = faces[:, ::-1]
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        check_size(self.path, field, mesh, SIZES, float(np.abs(self.size).max()))
        return mesh


def link_shape(path: Path, link: str, shape: yourdfpy.Collision) -> CollisionShape:
    """Return a collision shape of a URDF.

    Args:
        path: the URDF file, for error messages.
        link: the link that the shape belongs to.
        shape: the shape as the parser has it; a mesh by its path.

    Raises:
        UrdfError: the shape has no geometry, a size is not a positive number, or a scale is zero.
    """
    geometry, field = shape.geometry, f"link {link}: collision"
    if geometry is None:
        raise UrdfError(path, field, None, "a geometry")
    mesh = None
    if geometry.box is not None:
        kind, sizes = "box", np.ravel(geometry.box.size)
    elif geometry.cylinder is not None:
        kind, sizes = "cylinder", [geometry.cylinder.radius, geometry.cylinder.length]
    elif geometry.sphere is not None:
        kind, sizes = "sphere", [geometry.sphere.radius]
    elif geometry.mesh is not None:
        mesh, scale = Path(geometry.mesh.filename), geometry.mesh.scale
        kind, sizes = "mesh", np.broadcast_to(np.ravel(1.0 if scale is None else scale), 3)
    else:
        raise UrdfError(path, field, None, "a box, cylinder, sphere or mesh")
    size = tuple(float(value) for value in sizes)
    if not all(0 < (abs(value) if mesh else value) < LARGEST_SIZE for value in size):
        raise UrdfError(path, field, list(size), "sizes that are positive numbers")
    pose = np.eye(4) if shape.origin is None else np.asarray(shape.origin, dtype=float)
    if not np.isfinite(pose).all():
        raise UrdfError(path, f"{field}: origin", pose[:3, 3].tolist(), "finite numbers")
    return CollisionShape(kind, size, mesh, pose)


def shape_mesh(shape: CollisionShape, field: str, sides: int = 48) -> trimesh.Trimesh:
    """Return a collision shape as a mesh to be looked at, in the frame of its link or obstacle.

    Args:
        shape: the shape.
        field: what it belongs to, for error messages.
        sides: of the polygon that is drawn for a circle.

    Raises:
        MeshError: its mesh is unusable.
    """
    if shape.kind == "box":
        mesh = trimesh.creation.box(extents=shape.size)
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(*shape.size, sections=sides)
    elif shape.kind == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=shape.size[0])
    else:
        mesh = shape.mesh(field)
    return mesh.apply_transform(shape.pose)


def collision_hull(shape: CollisionShape, link: str) -> Array:
    """Return the vertices (n, 3) of a convex hull that contains a collision shape, in the link frame.

    Args:
        shape: the shape.
        link: the link that it belongs to, for error messages.

    Raises:
        MeshError: its mesh is unusable.
    """
    if shape.kind == "box":
        mesh = trimesh.creation.box(extents=shape.size)
    elif shape.kind == "cylinder":
        # Circumscribed, so that the hull contains the round shape.
        sides, (radius, height) = 48, shape.size
        mesh = trimesh.creation.cylinder(radius=radius / np.cos(np.pi / sides), height=height, sections=sides)
    elif shape.kind == "sphere":
        ball = trimesh.creation.icosphere(subdivisions=3)
        inradius = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center).min()
        mesh = ball.apply_scale(shape.size[0] / inradius)
    else:
        mesh = shape.mesh(f"link {link}")
    return np.asarray(mesh.convex_hull.vertices) @ shape.pose[:3, :3].T + shape.pose[:3, 3]
