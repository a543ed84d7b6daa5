"""Reading triangle meshes, with one clear error for everything that can be wrong with the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from symgrasp.errors import MeshError

__all__ = ["read_mesh"]


def read_mesh(path: Path, field: str = "mesh") -> trimesh.Trimesh:
    """Read all triangles of a mesh file as one mesh.

    Args:
        path: the file.
        field: what refers to it, for messages.

    Raises:
        MeshError: the file cannot be parsed, has no triangles, or has vertices that are not finite.
    """
    try:
        mesh = trimesh.load_mesh(str(path), skip_materials=True, process=False)
        if isinstance(mesh, trimesh.Scene):
            mesh = mesh.to_mesh()
    except Exception as error:  # trimesh raises whatever its many parsers raise
        raise MeshError(path, field, str(error), "a readable mesh file") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise MeshError(path, field, type(mesh).__name__, "a mesh with triangles")
    if not np.isfinite(mesh.vertices).all():
        raise MeshError(path, field, "NaN or infinite", "finite vertices")
    return mesh
