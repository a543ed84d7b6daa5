"""Loading objects of revolution: from the shipped library by name, from a YAML profile, or from a mesh."""

from __future__ import annotations

from pathlib import Path

from symgrasp.errors import ProfileError, one_of
from symgrasp.files import LARGEST_YAML, SCENES_DIR, parse_yaml, read_file
from symgrasp.meshes import MESH_ENDINGS
from symgrasp.object.profile import Profile

__all__ = ["library_objects", "load_object"]

OBJECTS_DIR = SCENES_DIR / "objects"


def library_objects() -> dict[str, Path]:
    """Return the objects that come with the package: name → file, in alphabetical order."""
    return {path.stem: path for path in sorted(OBJECTS_DIR.glob("*.yaml"))}


def load_object(name: str | Path, scale: float = 1.0) -> tuple[str, Profile]:
    """Load an object of the library by name, or any object from a file.

    Args:
        name: a name of the library; a YAML file with the keys ``name`` and ``profile``, knots
            [height, radius] in metres; or a mesh (DAE, GLB, OBJ, OFF, PLY or STL).
        scale: metres in one unit of a mesh.

    Returns:
        Its name (of a mesh, the file's without its ending) and its profile.

    Raises:
        ProfileError: there is no such object, or the YAML file is unusable.
        MeshError: the mesh is unusable or shows no object of revolution.
    """
    path = Path(name)
    if path.suffix.lower() in MESH_ENDINGS:
        return path.stem, Profile.from_mesh(path, scale)
    if path.suffix not in (".yaml", ".yml"):
        library = library_objects()
        if str(name) not in library:
            endings = ", ".join((".yaml", *MESH_ENDINGS))
            raise ProfileError("object", "name", str(name), f"{one_of(library, name)}, or a file ({endings})")
        path = library[str(name)]
    return _read(path)


def _read(path: Path) -> tuple[str, Profile]:
    """Read the name and the profile of an object from a YAML file.

    Raises:
        ProfileError: it cannot be read, or is not a mapping of ``name`` and ``profile``.
    """
    try:
        content = parse_yaml(read_file(path, LARGEST_YAML).decode("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ProfileError(path, "file", str(error), "a text file that can be read") from error
    except ValueError as error:
        raise ProfileError(path, "file", str(error), "a YAML document") from error
    if not isinstance(content, dict):
        raise ProfileError(path, "file", content, "a YAML mapping with name and profile")
    for key in content:
        if key not in ("name", "profile"):
            raise ProfileError(path, str(key), content[key], "only name and profile; check its spelling")
    label = content.get("name")
    if not isinstance(label, str) or not label:
        raise ProfileError(path, "name", label, "a name")
    return label, Profile(content.get("profile", []), str(path))
