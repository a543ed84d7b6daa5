"""Reading the mesh of a single object of plausible size from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from symgrasp.errors import MeshError
from symgrasp.meshes import check_size, read_mesh
from symgrasp.poses import Array

__all__ = ["SIZES", "read_single_object"]

SIZES = (0.005, 10.0)
"""Smallest and largest size (m) of an object to be grasped; others are taken to be in other units."""

CONTACT_GAP = 1e-4
"""Parts whose convex hulls come closer than this (m) belong to one object."""

MOST_PARTS = 1000
"""Meshes with more unconnected parts than this are refused rather than sorted into objects."""

FLAT_THICKNESS = 1e-4
"""A mesh that is thinner than this (m) is a flat sheet."""


def read_single_object(path: str | Path, scale: float = 1.0) -> trimesh.Trimesh:
    """Read the mesh of a single object in metres with z up, coinciding vertices and repeated faces merged.

    Args:
        path: a file of a format that `symgrasp.meshes.read_mesh` knows.
        scale: metres in one unit of the file; of a format that states its unit, a factor on top of that.

    Raises:
        MeshError: the file is missing, of another kind than its ending says, or damaged; it holds
            no triangles, numbers that are not finite, a flat sheet, several bodies, or a body that
            is too large or too small to be meant in metres.
    """
    path = Path(path)
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(path, "scale", scale, "a number above zero: metres in one unit of the file")
    mesh = read_mesh(path, "content")
    mesh = trimesh.Trimesh(scale * mesh.vertices, mesh.faces, process=False)
    with np.errstate(invalid="ignore"):  # coordinates too large for it are refused below
        mesh.merge_vertices(digits_vertex=7)
    mesh.update_faces(mesh.unique_faces())  # exporters write a face twice to show both of its sides
    mesh.update_faces(mesh.area_faces > 0)
    if not len(mesh.faces):
        raise MeshError(path, "surface", "no area", "triangles that enclose an object")
    mesh.remove_unreferenced_vertices()
    check_size(path, "size", mesh, SIZES, scale)
    _check_not_flat(path, mesh)
    _check_one_object(path, mesh)
    return mesh


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
