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
from symgrasp.scene.field_errors import describe_error
from symgrasp.scene.format import SceneFile, xacro_texts
from symgrasp.scene.scene import Scene

from ..choices.uploaded_scene import UploadedScene
from .archives import pack, unpack
from .robot_files import plain_urdf

__all__ = [
    "MAX_NAME",
    "SCENE_LIMIT",
    "read_scene",
    "read_scene_archive",
    "refuse_foreign_files",
    "scene_archive",
    "scene_yaml",
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
    beside = beside or {}
    content = scene.file.model_dump(mode="json", exclude_none=True)
    elsewhere = []
    for _, holder, key in _references(content):
        path = Path(holder[key])
        found = next((folder for folder in beside if path.is_relative_to(folder)), None)
        if found is not None:
            holder[key] = f"{beside[found]}/{path.relative_to(found).as_posix()}"
        elif path.is_absolute() and path.is_relative_to(SCENES_DIR):
            holder[key] = SHIPPED + path.relative_to(SCENES_DIR).as_posix()
        elif not holder[key].startswith("package://"):
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
    for field, holder, key in _references(plain):
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
    files = unpack(name, content, folder)
    scenes = [path for path in files if path.suffix.lower() in (".yaml", ".yml")]
    least = min((len(path.parts) for path in scenes), default=0)
    scenes = [path for path in scenes if len(path.parts) == least]
    if len(scenes) != 1:
        found = [path.relative_to(folder).as_posix() for path in scenes]
        raise InputError(name, "files", found or "no .yaml file", "one scene, with the robots it refers to")
    inside = folder.resolve()

    def check(content: dict[str, Any]) -> None:
        for field, holder, key in _references(content):
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

    content = read_file(scenes[0], SCENE_LIMIT + 1)
    uploaded = read_scene(scenes[0].name, content, (scenes[0].parent.resolve(), *folders), check)
    return replace(uploaded, option=f"{name[:MAX_NAME]} (upload)")


def scene_archive(scene: Scene, name: str, folders: Sequence[Path]) -> bytes:
    """Return a ZIP file with a scene and the uploaded robots that it refers to.

    Args:
        scene: the scene.
        name: of the scene file in it.
        folders: where the files of uploaded robots are.
    """
    inner = {folder.resolve(): f"files{k}" for k, folder in enumerate(folders, 1)}
    files = [(name, scene_yaml(scene, inner).encode())]
    for folder, called in inner.items():
        paths = sorted(path for path in folder.rglob("*") if path.is_file())
        files += [(f"{called}/{path.relative_to(folder).as_posix()}", path.read_bytes()) for path in paths]
    return pack(files)


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
    for field, holder, key in _references(plain):
        reference = holder[key]
        if not reference.startswith("package://") and not Path(reference).is_absolute():
            raise SceneError(source, field, reference, "package://<package>/<path>, or an absolute path")
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


def _references(content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yield every reference to a file in the content of a scene: field, the mapping it is in, its key."""
    holders: list[tuple[str, dict[str, Any]]] = [("object", content["object"])]
    for i, robot in enumerate(content["robots"]):
        holders.append((f"robots[{i}]", robot))
        arms = [(f"robots[{i}]", robot)]
        arms += [(f"robots[{i}].arms[{k}]", arm) for k, arm in enumerate(robot.get("arms", []))]
        holders += [
            (f"{field}.hand", arm["hand"]) for field, arm in arms if isinstance(arm.get("hand"), dict)
        ]
    holders += [(f"obstacles[{i}]", obstacle) for i, obstacle in enumerate(content["obstacles"])]
    for field, holder in holders:
        for key in ("urdf", "srdf", "mesh"):
            if key in holder:
                yield f"{field}.{key}", holder, key
