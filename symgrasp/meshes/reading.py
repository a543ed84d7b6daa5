"""Reading triangle meshes from files: completely, in metres and with z up, or not at all."""

from __future__ import annotations

import io
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.errors import MeshError, one_of
from symgrasp.meshes.declared import Declared
from symgrasp.meshes.formats import FORMATS, ending_of_content
from symgrasp.meshes.placed import collada_up
from symgrasp.poses import Array

if TYPE_CHECKING:
    import trimesh

__all__ = ["MESH_ENDINGS", "check_size", "joined", "read_groups", "read_mesh", "read_parts", "read_up"]

MESH_ENDINGS = tuple(FORMATS)
"""File endings of the mesh formats that are read."""

MOST_BYTES = 500_000_000
"""Largest file that is read."""

MOST_TRIANGLES = 2_000_000
"""Largest number of triangles in a file, once for each time that they are placed."""

MOST_INSTANCES = 5_000
"""Largest number of times that a file places a mesh."""

UNITS = (0.001, 0.01, 0.0254)
"""Millimetre, centimetre and inch (m): units that a mesh may be in by mistake."""

POINTER = b"version https://git-lfs.github.com/spec/"
"""How a file begins that only stands for one which Git LFS has not fetched."""

# What trimesh warns of is found below, and said in one line.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def read_mesh(path: Path, field: str = "mesh", *, upright: bool = True) -> trimesh.Trimesh:
    """Read all triangles of a mesh file as one mesh, in metres with z up.

    The units and the vertical of formats that state them are followed: COLLADA has both, glTF is in metres
    with y up. The others are taken to be in metres with z up.

    Args:
        path: the file; `MESH_ENDINGS` are known.
        field: what refers to it, for error messages.
        upright: whether to turn it so that z is up. A mesh in a URDF is not turned, because other programs
            do not turn it either, and some that export COLLADA always state the same vertical.

    Raises:
        MeshError: the file is missing, of another kind than its ending says, damaged or too large, holds
            something that cannot be read, has no triangles, or vertices that are not finite.
    """
    return joined(_parts(path, field, upright=upright))


def read_parts(
    path: Path, field: str = "mesh", tell: Callable[[], None] | None = None
) -> list[trimesh.Trimesh]:
    """Read a mesh of a URDF as `read_mesh` does, as one mesh for each material, with their colours.

    Args:
        path: the file.
        field: what refers to it, for error messages.
        tell: called once what the file says of itself is known, which takes half of the time; may raise
            `Cancelled`.
    """
    return _parts(path, field, upright=False, materials=True, tell=tell)


def read_groups(path: Path, field: str = "mesh") -> list[trimesh.Trimesh]:
    """Read a mesh of a URDF as `read_mesh` does, as one mesh for each object and group of an OBJ file."""
    parts = _parts(path, field, upright=False, groups=True)
    return parts if path.suffix.lower() == ".obj" else [joined(parts)]


def read_up(path: Path, field: str = "mesh") -> Array:
    """Return the rotation (4, 4) that takes a mesh to z up by what its file states; none unless COLLADA.

    Raises:
        MeshError: the file is missing, of another kind than its ending says, or states no vertical.
    """
    if path.suffix.lower() != ".dae":
        return np.eye(4)
    try:
        return collada_up(_content(path, field))
    except ValueError as error:
        raise MeshError(path, field, str(error), "a COLLADA file with an up_axis") from error


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several meshes as one, without colours."""
    import trimesh

    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return trimesh.Trimesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces), process=False)


def check_size(
    path: Path,
    field: str,
    mesh: trimesh.Trimesh,
    limits: tuple[float, float],
    scale: float = 1.0,
    option: str = "scale",
) -> None:
    """Check that a mesh can be meant to be as large as it is.

    Args:
        path: its file.
        field: what refers to it, for error messages.
        mesh: the mesh, scaled.
        limits: the smallest and the largest plausible extent (m).
        scale: what it was scaled by.
        option: what sets the scale; the message names values of it that would do.

    Raises:
        MeshError: its largest extent is outside the limits.
    """
    size, (smallest, largest) = float(mesh.extents.max()), limits
    if smallest <= size <= largest:
        return
    factors = [unit if size > largest else 1 / unit for unit in UNITS]
    remedies = [
        f"{option} {scale * factor:.4g} would make it {size * factor:.3g} m"
        for factor in factors
        if smallest <= size * factor <= largest
    ]
    expected = "; ".join([f"a size of {smallest:g} to {largest:g} m", *remedies])
    raise MeshError(path, field, f"{size:.4g} m", expected)


def _parts(
    path: Path,
    field: str,
    *,
    upright: bool,
    materials: bool = False,
    groups: bool = False,
    tell: Callable[[], None] | None = None,
) -> list[trimesh.Trimesh]:
    """Read the parts of a mesh, and compare them with what the file says of itself.

    An OBJ file is divided by its materials, or by its groups if these are asked for.
    """
    import trimesh
    from trimesh.resolvers import FilePathResolver

    declared = _declared(path, field)
    if tell:
        tell()
    kind = path.suffix.lower()[1:]
    try:
        with np.errstate(all="ignore"):  # numbers that are not finite are refused below
            scene = trimesh.load_scene(
                io.BytesIO(declared.content),
                file_type=kind,
                resolver=FilePathResolver(str(path)) if materials else None,
                skip_materials=not materials,
                group_material=not groups,
                split_objects=groups,
                split_groups=groups,
                process=False,
            )
            parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    except Exception as error:  # trimesh raises whatever its many parsers raise
        raise MeshError(path, field, str(error), f"a {kind.upper()} file that can be read") from error
    count = sum(len(part.faces) for part in parts)
    if count != declared.triangles:
        value = f"only {count} of its {declared.triangles} triangles can be read"
        raise MeshError(path, field, value, f"a complete {kind.upper()} file with triangles of common kinds")
    if not count:
        raise MeshError(path, field, "no triangles", "a mesh with triangles")
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise MeshError(path, field, "a corner that is no vertex", "faces between the vertices")
        if declared.unit != 1.0:
            part.apply_scale(declared.unit)
        if upright and declared.upright is not None:
            part.apply_transform(declared.upright)
        if not np.isfinite(part.vertices).all():
            raise MeshError(path, field, "NaN or infinite", "finite vertices")
    return parts


def _declared(path: Path, field: str) -> Declared:
    """Return what a file says of itself; raise MeshError where that is not what can be read."""
    content = _content(path, field)
    kind = path.suffix.lower()[1:].upper()
    try:
        declared = FORMATS[path.suffix.lower()](content)
    except Exception as error:  # damaged files break it in any way
        raise MeshError(path, field, str(error) or type(error).__name__, f"a complete {kind} file") from error
    if declared.triangles > MOST_TRIANGLES:
        value = f"{declared.triangles} triangles"
        raise MeshError(path, field, value, f"at most {MOST_TRIANGLES}; simplify the mesh")
    if declared.instances > MOST_INSTANCES:
        value = f"{declared.instances} placed meshes"
        raise MeshError(path, field, value, f"at most {MOST_INSTANCES}; join them")
    return declared


def _content(path: Path, field: str) -> bytes:
    """Return the content of a file if it is of the format that its ending says."""
    ending = path.suffix.lower()
    if ending not in MESH_ENDINGS:
        raise MeshError(path, "ending", path.suffix, one_of(MESH_ENDINGS, ending))
    kind = ending[1:].upper()
    try:
        if path.stat().st_size > MOST_BYTES:
            size = f"{path.stat().st_size / 1e6:.0f} MB"
            raise MeshError(path, field, size, f"a mesh file of at most {MOST_BYTES / 1e6:.0f} MB")
        content = path.read_bytes()
    except OSError as error:
        raise MeshError(path, "file", error.strerror or str(error), "a mesh file that can be read") from error
    if not content.strip():
        raise MeshError(path, field, "empty file", f"a mesh in {kind} format")
    if content.startswith(POINTER):
        raise MeshError(path, field, "a pointer of Git LFS", "the mesh itself; `git lfs pull` fetches it")
    found = ending_of_content(content)
    if found != ending:
        shown = f"{found[1:].upper()} data" if found else f"other or incomplete data ({len(content)} bytes)"
        raise MeshError(path, field, shown, f"a complete {kind} file, as its ending says")
    return content
