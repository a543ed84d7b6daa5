"""Files: resolving references between them, parsing YAML, and writing atomically."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any
from urllib.parse import unquote

import yaml

__all__ = ["SCENES_DIR", "file_sha256", "package_dir", "parse_yaml", "resolve", "write_atomically"]

_PACKAGE = Path(__file__).resolve().parent

SCENES = "static_scenes"
"""Name of the folder of the shipped scenes, and of the package in ``package://static_scenes/…``."""

SCENES_DIR = (_PACKAGE if (_PACKAGE / SCENES).is_dir() else _PACKAGE.parent) / SCENES
"""The shipped scenes and their meshes: inside this package where it is installed, beside it in a checkout."""


def package_dir(name: str) -> Path | None:
    """Return the folder of an importable Python package without importing it, or None.

    ``static_scenes``, which files refer to as a package, is the folder of the shipped scenes wherever
    that is.
    """
    if name == SCENES:
        return SCENES_DIR
    if "." in name:  # finding a subpackage would import its parent
        return None
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def resolve(reference: str, folder: Path) -> Path | None:
    """Resolve a reference to a file.

    Args:
        reference: ``package://<package>/<path>``, ``file://<path>``, or a path relative to
            ``folder``; as it is, or with ``%20`` for a space and the like. Where no Python package of
            that name holds the file, the folders above ``folder`` are searched for
            ``<package>/<path>``, as ROS packages are laid out.
        folder: folder of the file that holds the reference.

    Returns:
        The existing file, or None.
    """
    candidates = [path for text in (reference, unquote(reference)) for path in _candidates(text, folder)]
    return next((path for path in candidates if _is_file(path)), None)


def _candidates(reference: str, folder: Path) -> list[Path]:
    """Return the paths that a reference may stand for, in the order in which they are tried."""
    if not reference.startswith("package://"):
        return [folder / reference.removeprefix("file://")]
    rest = reference.removeprefix("package://")
    package, _, inner = rest.partition("/")
    root = package_dir(package)
    inside = [root / inner] if root else []
    return [*inside, *(parent / rest for parent in (folder, *folder.parents))]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, or has a null character
        return False


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content.

    Raises:
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class _Loader(yaml.SafeLoader):
    """YAML loader that accepts plain data only and rejects duplicate keys."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict:
        mapping = super().construct_mapping(node, deep=deep)
        if len(mapping) != len(node.value):
            keys = [self.construct_object(key, deep=True) for key, _ in node.value]
            raise ValueError(f"the key {next(k for k in keys if keys.count(k) > 1)!r} twice")
        return mapping


MOST_NODES = 1_000_000
"""Largest number of values in a YAML document with its aliases expanded, which can make a small file huge."""


def parse_yaml(text: str) -> Any:
    """Parse a YAML document of plain data.

    Raises:
        ValueError: it is not such a document; the text says why in one line.
    """
    try:
        content = yaml.load(text, Loader=_Loader)
        if _nodes(content, {}) > MOST_NODES:
            raise ValueError("aliases that stand for too much")
    except RecursionError:
        raise ValueError("nested too deeply") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ValueError(f"{where}{error.problem}") from error
    except Exception as error:  # a malformed scalar can raise any exception
        raise ValueError(" ".join(f"{error or type(error).__name__}".split())) from error
    return content


def _nodes(value: Any, known: dict[int, int]) -> int:
    """Count the values in plain data with every alias expanded.

    Args:
        value: the data.
        known: id of a mapping or list → its count; filled by the function.
    """
    if not isinstance(value, (dict, list)):
        return 1
    if id(value) not in known:
        known[id(value)] = MOST_NODES + 1  # for data that contains itself
        parts = value.values() if isinstance(value, dict) else value
        known[id(value)] = 1 + sum(_nodes(part, known) for part in parts)
    return known[id(value)]


@contextmanager
def write_atomically(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file that replaces ``path`` when the ``with`` block ends without an exception."""
    path = Path(path).resolve()  # replace the file that a symbolic link points to
    if path.exists() and not path.is_file():  # a device or a pipe cannot be replaced
        with path.open("wb") as file:
            yield file
        return
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
        Path(temporary).chmod(mode)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _umask() -> int:
    """Return the file mode mask of the process, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
