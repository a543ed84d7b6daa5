"""The XML of an MJCF model in one piece, with the files that it refers to found and everything else left out.

MuJoCo would read included files, meshes and textures itself, from anywhere. Here what a robot is made of
is kept: bodies, joints, geoms and sites with their classes, meshes as absolute paths, materials without
textures, and what couples joints or keeps bodies from colliding.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

from symgrasp.descriptions.xml_file import MOST_ELEMENTS, read_xml
from symgrasp.errors import UrdfError

__all__ = ["complete_mjcf"]

SECTIONS = ("compiler", "default", "asset", "worldbody", "contact", "equality", "tendon", "keyframe")
"""What is kept of a model."""

ASSETS = ("mesh", "material", "model")
"""Assets that are kept; a model is another file, which is refused."""

DROPPED = ("camera", "light")
"""Elements that are left out wherever they stand."""

DIRECTORIES = ("meshdir", "texturedir", "assetdir", "strippath", "discardvisual", "fusestatic")
"""Attributes of the compiler that are left out: paths are complete, and every link is kept."""


def complete_mjcf(path: Path, root: ET.Element, inside: Path | None = None) -> ET.Element:
    """Return the XML of a model that refers to no file but meshes, by absolute paths.

    Args:
        path: the file.
        root: what it holds, which is changed.
        inside: the folder that alone may be read from; None for a file of the user's own.

    Raises:
        UrdfError: a file is missing or may not be read, or the model is made of other models.
    """
    _include(path, root, inside, [path.resolve()])
    compiler: dict[str, str] = {}
    for element in root.iter("compiler"):
        compiler |= element.attrib
        for name in DIRECTORIES:
            element.attrib.pop(name, None)
    for section in list(root):
        if section.tag not in SECTIONS:
            root.remove(section)
    for key in root.iterfind("keyframe/key"):
        key.attrib = {name: key.get(name, "") for name in ("name", "qpos") if name in key.attrib}
    for assets in root.iterfind("asset"):
        for asset in list(assets):
            if asset.tag not in ASSETS:
                assets.remove(asset)
    for parent in root.iter():
        for child in list(parent):
            if child.tag in DROPPED or (parent.tag == "material" and child.tag == "layer"):
                parent.remove(child)
    for element in root.iter():
        if element.tag == "material":
            element.attrib.pop("texture", None)
        if "file" not in element.attrib:
            continue
        if element.tag != "mesh":
            expected = "parts joined by <include>, and no files but meshes"
            raise UrdfError(path, element.tag, element.get("file"), expected)
        if "name" not in element.attrib:
            element.set("name", Path(element.get("file", "")).stem)
        mesh = _found(path, "mesh", _mesh_file(path, element.get("file", ""), compiler), inside)
        element.set("file", str(mesh))
    return root


def _include(path: Path, element: ET.Element, inside: Path | None, seen: Sequence[Path]) -> None:
    """Put the content of included files in their places; paths are relative to the first file's folder."""
    children = []
    for child in element:
        if child.tag != "include":
            _include(path, child, inside, seen)
            children.append(child)
            continue
        file = _found(path, "include", path.parent / child.get("file", ""), inside)
        if file in seen:
            raise UrdfError(path, "include", child.get("file"), "a file that does not include itself")
        included = read_xml(file, "MJCF")
        _include(path, included, inside, [*seen, file])
        children += list(included)
        if len(children) > MOST_ELEMENTS:
            raise UrdfError(path, "include", child.get("file"), f"at most {MOST_ELEMENTS:,} elements")
    element[:] = children


def _mesh_file(path: Path, name: str, compiler: Mapping[str, str]) -> Path:
    """Return where MuJoCo takes a mesh from."""
    if compiler.get("strippath") == "true":
        name = Path(name).name
    return path.parent / compiler.get("meshdir", compiler.get("assetdir", "")) / name


def _found(path: Path, field: str, file: Path, inside: Path | None) -> Path:
    """Return a file that is there and may be read, as an absolute path."""
    resolved = file.resolve()
    if inside is not None and not resolved.is_relative_to(inside.resolve()):
        raise UrdfError(path, field, str(file), "a file of the archive")
    if not resolved.is_file():
        raise UrdfError(path, field, str(file), "an existing file")
    return resolved
