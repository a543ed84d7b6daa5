"""Reading the mesh of one object that is to be measured, refusing what cannot be one."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from symgrasp.errors import MeshError, one_of
from symgrasp.meshes import read_mesh
from symgrasp.poses import Array

__all__ = ["LARGEST", "MESH_ENDINGS", "SMALLEST", "read_body"]

MESH_ENDINGS = (".glb", ".obj", ".off", ".ply", ".stl")
"""File endings of the mesh formats that objects are measured from."""

SMALLEST, LARGEST = 0.005, 10.0
"""Sizes (m) that an object to be grasped may have; anything else is in other units."""

CONTACT = 1e-4
"""Parts whose convex hulls come closer than this (m) are one body."""

MOST_PARTS = 1000
"""More unconnected parts than this are not sorted into bodies one by one."""

FLAT = 1e-4
"""A mesh that is thinner than this (m) is a sheet."""


def read_body(path: str | Path, scale: float = 1.0) -> trimesh.Trimesh:
    """Read the mesh of a single object, in metres, with coinciding vertices merged.

    Args:
        path: an STL, OBJ, PLY, OFF or GLB file.
        scale: metres in one unit of the file.

    Raises:
        MeshError: the file is missing, of another kind than its ending says, or damaged; it holds
            no triangles, numbers that are not finite, a flat sheet, several bodies, or a body that
            is too large or too small to be meant in metres.
    """
    path = Path(path)
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(path, "scale", scale, "a number above zero: metres in one unit of the file")
    _check_content(path)
    mesh = read_mesh(path, "content")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise MeshError(path, "faces", int(mesh.faces.max()), f"vertices numbered below {len(mesh.vertices)}")
    mesh = trimesh.Trimesh(scale * mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices(digits_vertex=7)
    mesh.update_faces(mesh.area_faces > 0)
    if not len(mesh.faces):
        raise MeshError(path, "surface", "no area", "triangles that enclose an object")
    mesh.remove_unreferenced_vertices()
    _check_size(path, mesh, scale)
    _check_solid(path, mesh)
    _check_single(path, mesh)
    return mesh


def _check_content(path: Path) -> None:
    """Compare what the file holds with what its ending says."""
    ending = path.suffix.lower()
    if ending not in MESH_ENDINGS:
        raise MeshError(path, "ending", path.suffix, one_of(MESH_ENDINGS, ending))
    try:
        content = path.read_bytes()
    except OSError as error:
        raise MeshError(path, "file", error.strerror or str(error), "a mesh file that can be read") from error
    if not content.strip():
        raise MeshError(path, "content", "empty file", f"a mesh in {ending[1:].upper()} format")
    kind = _kind(content)
    if kind != ending:
        found = f"{kind[1:].upper()} data" if kind else f"other or incomplete data ({len(content)} bytes)"
        raise MeshError(path, "content", found, f"a complete {ending[1:].upper()} file, as its ending says")


def _kind(content: bytes) -> str | None:
    """Return the ending that fits the content of a mesh file, or None."""
    if content.startswith(b"glTF"):
        return ".glb"
    if re.match(rb"ply\s", content):
        return ".ply"
    if re.match(rb"\s*(#[^\n]*\n\s*)*(ST)?C?N?4?n?OFF\b", content):
        return ".off"
    # Some binary STL files begin with "solid" as well, so their length is what tells.
    if len(content) >= 84 and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return ".stl"
    if re.match(rb"\s*solid\b", content) and b"endsolid" in content:
        return ".stl"
    if re.search(rb"^\s*v\s+[-+.\dnN]", content, re.MULTILINE):
        return ".obj"
    return None


def _check_size(path: Path, mesh: trimesh.Trimesh, scale: float) -> None:
    size = float(mesh.extents.max())
    if size > LARGEST:
        raise MeshError(
            path, "size", f"{size:.4g} m",
            f"an object of at most {LARGEST:g} m; for a mesh in millimetres use --scale {scale / 1000:g}",
        )  # fmt: skip
    if size < SMALLEST:
        raise MeshError(
            path, "size", f"{size:.4g} m",
            f"an object of at least {SMALLEST:g} m; lengths are in metres unless --scale says otherwise",
        )  # fmt: skip


def _check_solid(path: Path, mesh: trimesh.Trimesh) -> None:
    offset = mesh.vertices - mesh.vertices.mean(axis=0)
    thinnest = np.linalg.eigh(offset.T @ offset)[1][:, 0]
    if np.ptp(offset @ thinnest) < FLAT:
        raise MeshError(path, "surface", "a flat sheet", "triangles that enclose an object")


def _check_single(path: Path, mesh: trimesh.Trimesh) -> None:
    """Refuse bodies that lie apart; parts that touch, overlap or enclose each other are one."""
    labels = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
    count = int(labels.max()) + 1
    # Faces that only share a vertex are not adjacent, but their hulls touch.
    if count > MOST_PARTS:
        raise MeshError(path, "bodies", f"{count} unconnected parts", "one connected body")
    areas = np.bincount(labels, mesh.area_faces)
    parts = [mesh.vertices[np.unique(mesh.faces[labels == k])] for k in np.argsort(-areas)]
    body, apart = _corners(parts[0]), [_corners(part) for part in parts[1:]]
    absorbed = True
    while apart and absorbed:
        touching = [not _separable(body, part) for part in apart]
        absorbed = any(touching)
        body = np.concatenate([body, *(p for p, t in zip(apart, touching, strict=True) if t)])
        apart = [p for p, t in zip(apart, touching, strict=True) if not t]
    if apart:
        where = ", ".join(f"{x:.3g}" for x in apart[0].mean(axis=0))
        raise MeshError(
            path, "bodies", len(apart) + 1, f"one body; another one lies apart, around ({where}) m"
        )


def _corners(points: Array) -> Array:
    """Return the corners (m, 3) of the convex hull of points, also of flat ones."""
    return points[ConvexHull(points, qhull_options="QJ").vertices] if len(points) > 4 else points


def _separable(a: Array, b: Array) -> bool:
    """Whether a plane keeps two point sets (n, 3) apart by more than `CONTACT` (m)."""
    centre = a.mean(axis=0)
    # Find n, c with n·a - c >= 1 and n·b - c <= -1: the gap is 2 / |n|, so |n| is bounded.
    rows = np.concatenate([-(a - centre), b - centre])
    sign = np.concatenate([np.ones(len(a)), -np.ones(len(b))])
    bound = 2.0 / CONTACT
    result = linprog(
        np.zeros(4),
        A_ub=np.column_stack([rows, sign]),
        b_ub=-np.ones(len(rows)),
        bounds=[(-bound, bound)] * 3 + [(None, None)],
    )
    return bool(result.success)
