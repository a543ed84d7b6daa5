"""Reading the mesh of a single object of plausible size from a file."""

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

__all__ = ["LARGEST", "MESH_ENDINGS", "SMALLEST", "read_single_object"]

MESH_ENDINGS = (".glb", ".obj", ".off", ".ply", ".stl")
"""File endings of the mesh formats that objects are measured from."""

SMALLEST, LARGEST = 0.005, 10.0
"""Range of sizes (m) of an object to be grasped; a mesh outside it is taken to be in other units."""

CONTACT_GAP = 1e-4
"""Parts whose convex hulls come closer than this (m) belong to one object."""

MOST_PARTS = 1000
"""Meshes with more unconnected parts than this are refused rather than sorted into objects."""

FLAT_THICKNESS = 1e-4
"""A mesh that is thinner than this (m) is a flat sheet."""


def read_single_object(path: str | Path, scale: float = 1.0) -> trimesh.Trimesh:
    """Read the mesh of a single object, in metres, with coinciding vertices and repeated faces merged.

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
    mesh.update_faces(mesh.unique_faces())  # exporters write a face twice to show both of its sides
    mesh.update_faces(mesh.area_faces > 0)
    if not len(mesh.faces):
        raise MeshError(path, "surface", "no area", "triangles that enclose an object")
    mesh.remove_unreferenced_vertices()
    _check_size(path, mesh, scale)
    _check_not_flat(path, mesh)
    _check_one_object(path, mesh)
    return mesh


def _check_content(path: Path) -> None:
    """Raise MeshError unless the file can be read and its content is of the format that its ending says."""
    ending = path.suffix.lower()
    if ending not in MESH_ENDINGS:
        raise MeshError(path, "ending", path.suffix, one_of(MESH_ENDINGS, ending))
    try:
        content = path.read_bytes()
    except OSError as error:
        raise MeshError(path, "file", error.strerror or str(error), "a mesh file that can be read") from error
    if not content.strip():
        raise MeshError(path, "content", "empty file", f"a mesh in {ending[1:].upper()} format")
    kind = _ending_of_content(content)
    if kind != ending:
        found = f"{kind[1:].upper()} data" if kind else f"other or incomplete data ({len(content)} bytes)"
        raise MeshError(path, "content", found, f"a complete {ending[1:].upper()} file, as its ending says")


def _ending_of_content(content: bytes) -> str | None:
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
    """Raise MeshError if the largest extent of the mesh is outside `SMALLEST` to `LARGEST`."""
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


def _check_not_flat(path: Path, mesh: trimesh.Trimesh) -> None:
    """Raise MeshError if the mesh is a flat sheet."""
    offset = mesh.vertices - mesh.vertices.mean(axis=0)
    thinnest = np.linalg.eigh(offset.T @ offset)[1][:, 0]
    if np.ptp(offset @ thinnest) < FLAT_THICKNESS:
        raise MeshError(path, "surface", "a flat sheet", "triangles that enclose an object")


def _check_one_object(path: Path, mesh: trimesh.Trimesh) -> None:
    """Raise MeshError if the mesh shows several objects: parts that neither touch nor enclose each other."""
    # Parts that share a vertex touch. (Edges would not do: where walls meet, more than two faces share one.)
    first, *others = mesh.faces.T
    links = np.concatenate([np.column_stack([first, other]) for other in others])
    labels = trimesh.graph.connected_component_labels(links, node_count=len(mesh.vertices))
    count = int(labels.max()) + 1
    if count == 1:
        return
    if count > MOST_PARTS:
        raise MeshError(path, "bodies", f"{count} unconnected parts", "one connected body")
    areas = np.bincount(labels[first], mesh.area_faces)
    parts = [mesh.vertices[labels == k] for k in np.argsort(-areas)]
    largest, apart = _corners(parts[0]), [_corners(part) for part in parts[1:]]
    absorbed = True
    while apart and absorbed:
        touching = [not _separable(largest, part) for part in apart]
        absorbed = any(touching)
        largest = np.concatenate([largest, *(p for p, t in zip(apart, touching, strict=True) if t)])
        apart = [p for p, t in zip(apart, touching, strict=True) if not t]
    if apart:
        where = ", ".join(f"{x:.3g}" for x in apart[0].mean(axis=0))
        raise MeshError(
            path, "bodies", len(apart) + 1, f"one body; another one lies apart, around ({where}) m"
        )


def _corners(points: Array) -> Array:
    """Return the corners (m, 3) of the convex hull of points (n, 3), which may lie in a plane."""
    return points[ConvexHull(points, qhull_options="QJ").vertices] if len(points) > 4 else points


def _separable(a: Array, b: Array) -> bool:
    """Whether a plane separates two point sets (n, 3) by more than `CONTACT_GAP` (m): a linear program."""
    centre = a.mean(axis=0)
    # Find n, c with n·a - c >= 1 and n·b - c <= -1: the gap is 2 / |n|, so |n| is bounded.
    rows = np.concatenate([-(a - centre), b - centre])
    sign = np.concatenate([np.ones(len(a)), -np.ones(len(b))])
    bound = 2.0 / CONTACT_GAP
    result = linprog(
        np.zeros(4),
        A_ub=np.column_stack([rows, sign]),
        b_ub=-np.ones(len(rows)),
        bounds=[(-bound, bound)] * 3 + [(None, None)],
    )
    return bool(result.success)
