"""Scenes as files of the page: saving a changed scene, and reading an uploaded one safely.

An uploaded scene is not trusted: it must not make the server read arbitrary files. It may refer to
files of installed packages (``package://…``; not to what merely lies in a folder above) and to files in
the server's own folders of scenes; anything else is an error, which does not reveal whether there is
such a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from symgrasp.errors import SceneError
from symgrasp.files import LARGEST_YAML, SCENES_DIR, parse_yaml
from symgrasp.references import package_dirs, portable, resolve
from symgrasp.scene.format import SceneFile, describe_error
from symgrasp.scene.scene import Scene

from ..state.uploaded_scene import UploadedScene

__all__ = ["SCENE_LIMIT", "read_scene", "refuse_foreign_files", "scene_yaml"]

SCENE_LIMIT = LARGEST_YAML
"""Largest scene file (bytes) that is read."""

MAX_NAME = 100
"""Characters of a file name that are kept."""

SHIPPED = f"package://{SCENES_DIR.name}/"


def scene_yaml(scene: Scene) -> str:
    """Return a scene as a YAML document that the page and the command line read back as the same scene.

    Files that come with this software are written as ``package://``; others keep their absolute
    paths, and the first lines say so.
    """
    content = scene.file.model_dump(mode="json", exclude_none=True)
    elsewhere = []
    for _, holder, key in _references(content):
        path = Path(holder[key])
        if path.is_absolute() and path.is_relative_to(SCENES_DIR):
            holder[key] = SHIPPED + path.relative_to(SCENES_DIR).as_posix()
        elif not holder[key].startswith("package://"):
            elsewhere.append(holder[key])
    lines = ["# A scene of symgrasp: `symgrasp app FILE` opens it."]
    if elsewhere:
        lines.append(
            "# It needs these files; on another machine, put them beside it and write their names only:"
        )
        lines += [f"#   {path!r}" for path in dict.fromkeys(elsewhere)]
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)
    return "\n".join([*lines, text])


def read_scene(name: str, content: bytes, folders: Iterable[Path]) -> UploadedScene:
    """Build the scene in an uploaded file.

    Args:
        name: of the file.
        content: what it holds.
        folders: of the server's own scenes; relative paths are looked up there, in this order.

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
    return UploadedScene(f"{source} (upload)", Scene.from_content(plain, source))


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
    """Return the path with links and ``..`` resolved, if it is inside one of the folders, else None."""
    if path is None:
        return None
    path = path.resolve()
    return path if any(path.is_relative_to(root) for root in roots) else None


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
