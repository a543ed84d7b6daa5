"""The collision shapes of links, as their file describes them and as convex hulls."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symgrasp.caching import kept
from symgrasp.descriptions.urdf import UrdfShape
from symgrasp.errors import MeshError, UrdfError
from symgrasp.files import file_sha256
from symgrasp.meshes import check_size, joined, read_groups, read_mesh
from symgrasp.poses import Array

if TYPE_CHECKING:
    import trimesh

__all__ = ["CollisionShape", "collision_hulls", "link_shape", "shape_mesh"]

LARGEST_SIZE = 1e4
"""No size of a shape is larger (m), nor is a scale."""

SIZES = (0.001, 50.0)
"""Smallest and largest size (m) of a mesh that is a link or an obstacle; others are taken to be in other
units."""

THINNEST = 1e-6
"""Smallest mean thickness (m) of the convex hull of a mesh that is a link."""

MOST_HULLS = 256
"""A mesh of more groups than this is taken as one."""

SIDES = 48
"""Of the polygon that stands for a circle."""


class CollisionShape(NamedTuple):
    """A collision shape of a link or an obstacle.

    Attributes:
        kind: box, cylinder, sphere or mesh.
        size: box: full sizes (3,); cylinder: radius, height along z; sphere: radius; mesh: factors for x, y
            and z, negative ones mirror it.
        path: the file of a mesh, otherwise None.
        pose: pose (4, 4) in the frame of the link or obstacle; boxes, cylinders and spheres are centred.
        upright: whether a mesh is turned to z up; see `symgrasp.meshes.read_mesh`.
        sha256: SHA-256 of the mesh file of a link, as it was when the URDF was loaded.
    """

    kind: str
    size: tuple[float, ...]
    path: Path | None
    pose: Array
    upright: bool = False
    sha256: str = ""

    def mesh(self, field: str) -> trimesh.Trimesh:
        """Read the mesh of a shape that is one, scaled, in the shape's own frame.

        Args:
            field: what the shape belongs to, for error messages.

        Raises:
            MeshError: it cannot be read, or is too large or too small to be meant in metres.
        """
        assert self.path is not None
        mesh = _scaled(read_mesh(self.path, field, upright=self.upright), self.size)
        check_size(self.path, field, mesh, SIZES, float(np.abs(self.size).max()))
        return mesh


def link_shape(path: Path, link: str, shape: UrdfShape) -> CollisionShape:
    """Return a collision shape of a URDF.

    Args:
        path: the URDF file, for error messages.
        link: the link that the shape belongs to.
        shape: the shape as the URDF has it.

    Raises:
        UrdfError: a size is not a positive number, a scale is zero, or the file of a mesh cannot be read.
    """
    field, sha256 = f"link {link}: collision", ""
    if shape.path is not None:
        try:
            sha256 = file_sha256(shape.path)
        except OSError as error:
            raise UrdfError(path, f"link {link}: mesh", str(shape.path), "a readable mesh file") from error
    if not all(0 < (abs(value) if shape.path else value) < LARGEST_SIZE for value in shape.size):
        raise UrdfError(path, field, list(shape.size), "sizes that are positive numbers")
    if not np.isfinite(shape.origin).all():
        raise UrdfError(path, f"{field}: origin", shape.origin[:3, 3].tolist(), "finite numbers")
    return CollisionShape(shape.kind, shape.size, shape.path, shape.origin, sha256=sha256)


def shape_mesh(shape: CollisionShape, field: str, sides: int = SIDES) -> trimesh.Trimesh:
    """Return a collision shape as a mesh to be looked at, in the frame of its link or obstacle.

    Args:
        shape: the shape.
        field: what it belongs to, for error messages.
        sides: of the polygon that is drawn for a circle.

    Raises:
        MeshError: its mesh is unusable.
    """
    import trimesh

    if shape.kind == "box":
        mesh = trimesh.creation.box(extents=shape.size)
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(*shape.size, sections=sides)
    elif shape.kind == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=shape.size[0])
    else:
        mesh = shape.mesh(field)
    return mesh.apply_transform(shape.pose)


def collision_hulls(shape: CollisionShape, field: str) -> tuple[Array, ...]:
    """Return the vertices (n, 3) of the convex hulls that stand for a link's collision shape, in its frame.

    They contain the shape. A mesh is one hull; an OBJ file whose groups are closed surfaces, as programs
    write it that divide a body into convex parts, is one for each group. Groups that are not closed are
    patches of a surface, between whose hulls the inside would be left out.

    Args:
        shape: the shape.
        field: the link that it belongs to, for error messages.

    Raises:
        MeshError: its mesh is unusable, or has no volume.
    """
    if shape.path is not None:
        hulls = _mesh_hulls(shape.path, shape.sha256, shape.size, field)
    elif shape.kind == "box":
        hulls = ((np.array(list(np.ndindex(2, 2, 2))) - 0.5) * shape.size,)
    else:
        hulls = kept(("hulls", shape.kind, shape.size), lambda: (_around(shape.kind, shape.size),))
    return tuple(points @ shape.pose[:3, :3].T + shape.pose[:3, 3] for points in hulls)


def _around(kind: str, size: tuple[float, ...]) -> Array:
    """Return vertices (n, 3) whose hull contains a cylinder or a sphere: it is circumscribed."""
    import trimesh

    if kind == "cylinder":
        radius, height = size
        around = radius / np.cos(np.pi / SIDES)
        return np.asarray(trimesh.creation.cylinder(radius=around, height=height, sections=SIDES).vertices)
    ball = trimesh.creation.icosphere(subdivisions=3)
    inradius = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center).min()
    return np.asarray(ball.vertices * (size[0] / inradius))


@lru_cache(maxsize=1024)
def _mesh_hulls(path: Path, sha256: str, size: tuple[float, ...], field: str) -> tuple[Array, ...]:
    """Return the vertices (n, 3) of the convex hulls of a mesh, scaled; the SHA-256 tells if it changed."""

    def compute() -> tuple[Array, ...]:
        hulls = _computed_hulls(path, size, field)
        if file_sha256(path) != sha256:
            raise MeshError(path, field, "changed since the robot was loaded", "a file that stays as it is")
        return hulls

    return kept(("hulls", sha256, path.suffix.lower(), size), compute)


def _computed_hulls(path: Path, size: tuple[float, ...], field: str) -> tuple[Array, ...]:
    """Return the vertices (n, 3) of the convex hulls of a mesh, scaled."""
    groups = [_scaled(group, size) for group in read_groups(path, field)]
    whole = joined(groups)
    check_size(path, field, whole, SIZES, float(np.abs(size).max()))
    if 1 < len(groups) <= MOST_HULLS and all(_is_closed(group) for group in groups):
        hulls = [_hull(group) for group in groups]
        if all(hull is not None for hull in hulls):
            return tuple(hull for hull in hulls if hull is not None)
    hull = _hull(whole)
    if hull is None:
        value = f"a flat surface, less than {THINNEST:g} m thick"
        raise MeshError(path, field, value, "a body with a volume; a thin box does for a plate")
    return (hull,)


def _scaled(mesh: trimesh.Trimesh, size: tuple[float, ...]) -> trimesh.Trimesh:
    """Return a mesh scaled by factors for x, y and z."""
    import trimesh

    mirrored = np.prod(size) < 0  # a mirror image is inside out
    faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
    return trimesh.Trimesh(mesh.vertices * size, faces, process=False)


def _is_closed(mesh: trimesh.Trimesh) -> bool:
    mesh = mesh.copy()
    mesh.merge_vertices()  # a file may repeat them
    return mesh.is_watertight


def _hull(mesh: trimesh.Trimesh) -> Array | None:
    """Return the vertices (n, 3) of the convex hull of a mesh, None where it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(mesh.vertices)
    except QhullError:
        return None
    return hull.points[hull.vertices] if 2 * hull.volume > THINNEST * hull.area else None
