"""Scenes as files of the page: saving a changed scene, and reading an uploaded one safely.

An uploaded scene is not trusted: it must not make the server read arbitrary files. It may refer to
files of installed packages (``package://…``; not to what merely lies in a folder above) and to files in
the server's own folders of scenes; anything else is an error, which does not reveal whether there is
such a file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from symgrasp.descriptions.srdf import find_srdf
from symgrasp.errors import InputError, SceneError, as_written
from symgrasp.files import LARGEST_YAML, SCENES_DIR, TEMPORARY, parse_yaml, read_file
from symgrasp.references import package_dirs, portable, resolve
from symgrasp.scene.content import file_references
from symgrasp.scene.field_errors import describe_error
from symgrasp.scene.format import SceneFile, xacro_texts
from symgrasp.scene.scene import Scene

from ..choices.uploaded_scene import UploadedScene
from .archives import pack, unpack
from .robot_files import plain_urdf

__all__ = [
    "MAX_NAME",
    "SCENE_LIMIT",
    "names_beside",
    "only_file",
    "read_scene",
    "read_scene_archive",
    "refer_beside",
    "refuse_foreign_files",
    "scene_archive",
    "scene_yaml",
    "unpacked_robots",
    "upload_files",
]

SCENE_LIMIT = LARGEST_YAML
"""Largest scene file (bytes) that is read."""

MAX_NAME = 100
"""Characters of a file name that are kept."""

SHIPPED = f"package://{SCENES_DIR.name}/"


def scene_yaml(scene: Scene, beside: Mapping[Path, str] | None = None) -> str:
    """Return a scene as a YAML document that the page and the command line read back as the same scene.

    Files that come with this software are written as ``package://``; others keep their absolute
    paths, and the first lines say so.

    Args:
        scene: the scene.
        beside: folders that the document is given along with → their names beside it.
    """
    content = scene.file.model_dump(mode="json", exclude_none=True)
    refer_beside(content, beside or {})
    elsewhere = []
    for _, holder, key in file_references(content):
        path = Path(holder[key])
        if path.is_absolute() and path.is_relative_to(SCENES_DIR):
            holder[key] = SHIPPED + path.relative_to(SCENES_DIR).as_posix()
        elif path.is_absolute():
            elsewhere.append(holder[key])
    lines = ["# A scene of symgrasp: `symgrasp app FILE` opens it."]
    if elsewhere:
        lines.append(
            "# It needs these files; on another machine, put them beside it and write their names only:"
        )
        lines += [f"#   {as_written(path)}" for path in dict.fromkeys(elsewhere)]
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)
    return "\n".join([*lines, text])


def read_scene(
    name: str,
    content: bytes,
    folders: Iterable[Path],
    check: Callable[[dict[str, Any]], None] = lambda _: None,
) -> UploadedScene:
    """Build the scene in an uploaded file.

    Args:
        name: of the file.
        content: what it holds.
        folders: of the server's own scenes; relative paths are looked up there, in this order.
        check: called with the content of the scene, its references absolute, before any of them is read.

    Raises:
        SceneError: the file is too large or no scene, or refers to a file that it may not.
        UrdfError, ProfileError, MeshError: as `symgrasp.scene.scene.Scene.load`.
    """
    source = name[:MAX_NAME]
    if len(content) > SCENE_LIMIT:
        size = f"{len(content) / 1e6:.1f} MB"
        raise SceneError(source, "size of the file", size, f"a scene of at most {SCENE_LIMIT / 1e6:g} MB")
    try:
        data = parse_yaml(content.decode("utf-8"))
    except ValueError as error:
        raise SceneError(source, "file", str(error), "a YAML document") from None
    if not isinstance(data, dict):
        raise SceneError(source, "file", data, "a YAML mapping with schema_version, name, robots, …")
    try:
        plain = SceneFile.model_validate(data).model_dump(mode="json", exclude_none=True)
    except ValidationError as error:
        raise SceneError(source, *describe_error(error, data)) from None
    roots = [folder.resolve() for folder in folders]
    for field, holder, key in file_references(plain):
        holder[key] = _allowed(source, field, holder[key], roots)
    check(plain)
    _check_xacro_args(source, plain)
    return UploadedScene(f"{source} (upload)", Scene.from_content(plain, source))


def read_scene_archive(name: str, content: bytes, folder: Path, folders: Iterable[Path]) -> UploadedScene:
    """Build the scene in an uploaded archive, which `scene_archive` may have made.

    Its robots may have their URDFs and meshes in the archive.

    Args:
        name: of the archive.
        content: of the archive.
        folder: an empty one to unpack it into.
        folders: of the server's own scenes.

    Raises:
        InputError: see `app.files.archives.unpack`; or there is not exactly one scene in its first folder.
        SceneError, UrdfError, ProfileError, MeshError: see `read_scene`.
    """
    path = only_file(name, unpack(name, content, folder), folder, (".yaml", ".yml"), "scene")
    uploaded = read_scene(
        path.name,
        read_file(path, SCENE_LIMIT + 1),
        (path.parent.resolve(), *folders),
        lambda content: unpacked_robots(name, content, folder),
    )
    return replace(uploaded, option=f"{name[:MAX_NAME]} (upload)")


def only_file(name: str, files: Iterable[Path], folder: Path, endings: tuple[str, ...], what: str) -> Path:
    """Return the file with one of some endings that no other one of an unpacked archive stands above.

    Args:
        name: of the archive.
        files: of the archive.
        folder: that it was unpacked into.
        endings: of the file's name.
        what: is sought, for errors.

    Raises:
        InputError: there is none, or there are several.
    """
    found = [path for path in files if path.suffix.lower() in endings]
    least = min((len(path.parts) for path in found), default=0)
    found = [path for path in found if len(path.parts) == least]
    if len(found) != 1:
        names = [path.relative_to(folder).as_posix() for path in found]
        expected = f"one {what}, with the robots it refers to"
        raise InputError(name, "files", names or f"no {endings[0]} file", expected)
    return found[0]


def unpacked_robots(name: str, content: dict[str, Any], folder: Path) -> None:
    """Check the files of an unpacked archive that the content of a scene refers to, before any is read.

    The content refers to the URDF that is made of a xacro or MJCF file from then on.

    Args:
        name: of the archive.
        content: with absolute references; is changed.
        folder: that it was unpacked into.

    Raises:
        SceneError: an obstacle refers to one.
        UrdfError: see `app.files.robot_files.plain_urdf`.
    """
    inside = folder.resolve()
    for field, holder, key in file_references(content):
        path = Path(holder[key])
        if not path.is_absolute() or not path.is_relative_to(inside):
            continue
        if field.startswith("obstacles"):
            expected = "a file of an installed package, or one of the server's scenes"
            raise SceneError(name, field, path.name, expected)
        if key == "urdf":
            plain = plain_urdf(path, folder, xacro_texts(holder.pop("xacro_args", None)))
            if plain != path and "srdf" not in holder and (srdf := find_srdf(path)):
                holder["srdf"] = str(srdf)
            holder[key] = str(plain)


def scene_archive(scene: Scene, name: str, folders: Sequence[Path]) -> bytes:
    """Return a ZIP file with a scene and the uploaded robots that it refers to.

    Args:
        scene: the scene.
        name: of the scene file in it.
        folders: where the files of uploaded robots are.
    """
    beside = names_beside(folders)
    return pack([(name, scene_yaml(scene, beside).encode()), *upload_files(beside)])


def names_beside(folders: Sequence[Path]) -> dict[Path, str]:
    """Return folders of uploaded files, resolved → their names beside a file that refers to them."""
    return {folder.resolve(): f"files{k}" for k, folder in enumerate(folders, 1)}


def refer_beside(content: dict[str, Any], beside: Mapping[Path, str]) -> None:
    """Make the content of a scene refer to the files of some folders by the folders' names beside it."""
    for _, holder, key in file_references(content):
        path = Path(holder[key])
        for folder, name in beside.items():
            if path.is_relative_to(folder):
                holder[key] = f"{name}/{path.relative_to(folder).as_posix()}"


def upload_files(beside: Mapping[Path, str]) -> Iterator[tuple[str, bytes]]:
    """Yield the files of some folders for an archive: name in it, content."""
    for folder, name in beside.items():
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            yield f"{name}/{path.relative_to(folder).as_posix()}", path.read_bytes()


def refuse_foreign_files(source: str, content: dict[str, Any], folders: Iterable[Path]) -> None:
    """Raise an error if the scene in an uploaded plan refers to a file that it may not use.

    A plan is verified exactly as written, so its paths have to be absolute.

    Raises:
        SceneError: it does, or the content is no scene.
    """
    try:
        plain = SceneFile.model_validate(content).model_dump(mode="json", exclude_none=True)
    except ValidationError as error:
        raise SceneError(source, *describe_error(error, content)) from None
    roots = [folder.resolve() for folder in folders]
    for field, holder, key in file_references(plain):
        reference = holder[key]
        if not reference.startswith("package://") and not Path(reference).is_absolute():
            expected = (
                "package://<package>/<path>, an absolute path, or a file in the same ZIP file as the plan"
            )
            raise SceneError(source, field, reference, expected)
        _allowed(source, field, reference, roots)
    _check_xacro_args(source, plain)


def _check_xacro_args(source: str, content: dict[str, Any]) -> None:
    """Check that what an uploaded scene gives to xacro files of the server names no files in them.

    Raises:
        SceneError: an argument holds more than a plain word or number.
    """
    for i, robot in enumerate(content["robots"]):
        for name, value in xacro_texts(robot.get("xacro_args")).items():
            if ".." in value or not re.fullmatch(r"[\w+\-. ]*", value):
                raise SceneError(source, f"robots[{i}].xacro_args.{name}", value, "words or numbers")


def _allowed(source: str, field: str, reference: str, roots: list[Path]) -> str:
    """Return an allowed reference, made valid from any folder."""
    packages = package_dirs(reference)
    for root in packages or roots:
        found = resolve(reference, root)
        path = _inside(found, [root.resolve()] if packages else roots)
        if found and path:
            return portable(reference, found) or str(path)
    expected = "a file of an installed package (package://<package>/<path>), or one of the server's scenes"
    raise SceneError(source, field, reference, expected)


def _inside(path: Path | None, roots: list[Path]) -> Path | None:
    """Return the path with links and ``..`` resolved, if it is inside one of the folders, else None.

    What lies in a temporary folder in there, such as what others uploaded, is not.
    """
    if path is None:
        return None
    path = path.resolve()
    inner = [path.relative_to(root).parts for root in roots if path.is_relative_to(root)]
    own = [parts for parts in inner if not any(part.startswith(TEMPORARY) for part in parts)]
    return path if own else None
