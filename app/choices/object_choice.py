"""Objects that can replace a scene's own: those of the library, and uploaded meshes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from symgrasp.errors import InputError, MeshError, one_of
from symgrasp.files import temporary_folder
from symgrasp.meshes import MESH_ENDINGS
from symgrasp.object.library import library_objects, load_object
from symgrasp.object.measure.measurement import Measurement, measure_mesh
from symgrasp.object.measure.mesh_io import SIZES
from symgrasp.object.profile import Profile

__all__ = [
    "OWN",
    "UNITS",
    "UPLOAD_LIMIT",
    "ObjectChoice",
    "check_size",
    "from_library",
    "from_mesh",
    "object_options",
]

OWN = "the scene's own"
"""The option for the scene's own object."""

UPLOAD_LIMIT = 20_000_000
"""Largest mesh file (bytes) that is read."""

UNITS: Mapping[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Name of a unit that a mesh may be in → its length in metres."""


@dataclass(frozen=True, eq=False)
class ObjectChoice:
    """An object that is put into a scene.

    Attributes:
        option: its name in the menu of the page.
        name: what the scene calls it.
        profile: its radius over height.
        measurement: that of its mesh, if it was uploaded.
    """

    option: str
    name: str
    profile: Profile
    measurement: Measurement | None = None

    def flipped(self) -> ObjectChoice:
        """Return the same object standing on its other end; one without a measurement stays as it is."""
        if self.measurement is None:
            return self
        measurement = self.measurement.flipped()
        return replace(self, profile=Profile.measured(measurement), measurement=measurement)


@cache
def _library() -> tuple[str, ...]:
    """Return the names of the library's objects, which every picture of a state needs."""
    return tuple(library_objects())


def object_options(uploaded: ObjectChoice | None = None) -> tuple[str, ...]:
    """Return all options: the scene's own object, the library, and the uploaded one if any."""
    return (OWN, *_library(), *([uploaded.option] if uploaded else []))


def from_library(choice: str) -> ObjectChoice:
    """Load an object of the library.

    Raises:
        InputError: there is none of that name.
        ProfileError: its profile is unusable.
    """
    if choice not in library_objects():  # else a browser could open any file of the server
        raise InputError("library", "object", choice, one_of(library_objects(), choice))
    return ObjectChoice(choice, *load_object(choice))


def check_size(name: str, content: bytes) -> None:
    """Check the size of a mesh file.

    Raises:
        MeshError: it is larger than `UPLOAD_LIMIT`.
    """
    if len(content) > UPLOAD_LIMIT:
        size, limit = f"{len(content) / 1e6:.1f} MB", f"{UPLOAD_LIMIT / 1e6:g} MB"
        raise MeshError(name, "size of the file", size, f"a mesh file of at most {limit}")


def from_mesh(name: str, content: bytes, scale: float, tolerance: float | None = None) -> ObjectChoice:
    """Measure the object of revolution in the content of a mesh file.

    Args:
        name: of the file; its ending is that of its format.
        content: of the file.
        scale: length (m) of one of its units.
        tolerance: largest deviation from symmetry (m), see
            `symgrasp.object.measure.measurement.measure_mesh`.

    Raises:
        MeshError: the file is too large or unusable, or is not a solid of revolution.
    """
    check_size(name, content)
    file = Path(Path(name).name)
    if file.suffix.lower() not in MESH_ENDINGS:
        raise MeshError(name, "ending", file.suffix, one_of(MESH_ENDINGS, file.suffix.lower()))
    # In an empty folder, since a mesh may refer to files beside it.
    with temporary_folder() as folder:
        path = folder / f"mesh{file.suffix.lower()}"
        path.write_bytes(content)
        try:
            measurement = measure_mesh(path, scale=scale, tolerance=tolerance)
        except MeshError as error:
            expected = error.expected
            if error.field == "size":
                expected = f"{SIZES[0]:g} to {SIZES[1]:g} m; choose the unit of the mesh"
            elif error.field == "symmetry":
                expected = expected.partition(" (")[0] + "; choose it"
            raise MeshError(name, error.field, error.value, expected) from None
    measurement = replace(measurement, source=name)
    return ObjectChoice(f"{file.name} (upload)", file.stem[:100], Profile.measured(measurement), measurement)
