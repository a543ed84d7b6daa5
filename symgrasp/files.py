"""Files: parsing YAML and JSON, and writing atomically."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import yaml

try:
    from yaml import CSafeLoader as SafeLoader  # ten times as fast, but not built everywhere
except ImportError:
    from yaml import SafeLoader

__all__ = [
    "LARGEST_YAML",
    "SCENES_DIR",
    "TEMPORARY",
    "check_size",
    "file_sha256",
    "parse_json",
    "parse_yaml",
    "read_file",
    "temporary_folder",
    "write_atomically",
]

_PACKAGE = Path(__file__).resolve().parent

TEMPORARY = ".symgrasp-tmp-"
"""How the names of temporary files and folders begin."""

ABANDONED_AGE = 60.0
"""Temporary files younger than this (s) may not be locked yet by the process that makes them."""

SCENES = "static_scenes"
"""Name of the folder of the shipped scenes, and of the package in ``package://static_scenes/…``."""

SCENES_DIR = (_PACKAGE if (_PACKAGE / SCENES).is_dir() else _PACKAGE.parent) / SCENES
"""The shipped scenes and their meshes: inside this package where it is installed, beside it in a checkout."""


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content.

    Raises:
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class _Loader(SafeLoader):  # pyright: ignore[reportGeneralTypeIssues]
    """YAML loader that accepts plain data only and rejects duplicate keys."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict:
        mapping = super().construct_mapping(node, deep=deep)
        if len(mapping) != len(node.value):
            seen = set()
            for key_node, _ in node.value:
                key = self.construct_object(key_node, deep=True)
                if key in seen:
                    raise ValueError(f"the key {key!r} twice")
                seen.add(key)
        return mapping


LARGEST_YAML = 1_000_000
"""Largest YAML document (bytes) that is read."""

MOST_VALUES = 100_000
"""Largest number of values in a YAML document with its aliases expanded, which can make a small file huge."""

DEEPEST = 50
"""Deepest nesting of a YAML document."""

LONGEST = 10_000
"""Most characters of a value in a YAML document: reading a number takes the square of its length."""


def read_file(path: Path, largest: int) -> bytes:
    """Return the content of a file.

    Args:
        path: the file.
        largest: most bytes that it may have.

    Raises:
        OSError: it cannot be read.
        ValueError: it is larger; no more than that is read.
    """
    with path.open("rb") as file:
        content = file.read(largest + 1)
    check_size(content, largest)
    return content


def check_size(content: str | bytes, largest: int) -> None:
    """Raise ValueError if the content of a file has more than so many bytes or characters."""
    if len(content) > largest:
        raise ValueError(f"more than {largest / 1e6:g} MB")


def parse_json(text: str | bytes) -> Any:
    """Parse a JSON document.

    Raises:
        ValueError: it is not one, has a key twice in one object, or a number that JSON does not have.
        RecursionError: it is nested too deeply.
    """
    return json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice!r} twice")
    return found


def _no_constant(name: str) -> Any:
    raise ValueError(f"the number {name}")


def parse_yaml(text: str) -> Any:
    """Parse a YAML document of plain data.

    Raises:
        ValueError: it is not such a document, or is too large; the text says why in one line.
    """
    try:
        _check_extent(text)
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ValueError(f"{where}{error.problem}") from error
    except Exception as error:  # a malformed scalar can raise any exception
        raise ValueError(" ".join(f"{error or type(error).__name__}".split())) from error


def _check_extent(text: str) -> None:
    """Raise ValueError if a YAML document is too large, before anything is built of it."""
    check_size(text, LARGEST_YAML)
    count = 0
    begun: list[tuple[str | None, int]] = []  # the anchor of each open collection, and the count before it
    sizes: dict[str | None, int] = {}  # anchor → number of values that an alias of it stands for
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, before = begun.pop()
            sizes[anchor] = count - before
        elif isinstance(event, yaml.NodeEvent):
            if isinstance(event, yaml.CollectionStartEvent):
                begun.append((event.anchor, count))
            if isinstance(event, yaml.ScalarEvent):
                sizes[event.anchor] = 1
                if len(event.value) > LONGEST:
                    raise ValueError(f"a value of more than {LONGEST:,} characters")
            if isinstance(event, yaml.AliasEvent) and event.anchor not in sizes:
                raise ValueError(f"the alias *{event.anchor} before the end of what it stands for")
            count += sizes[event.anchor] if isinstance(event, yaml.AliasEvent) else 1
            if count > MOST_VALUES:
                raise ValueError(f"more than {MOST_VALUES:,} values")
            if len(begun) > DEEPEST:
                raise ValueError(f"nested more than {DEEPEST} deep")


@contextmanager
def write_atomically(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file that replaces ``path`` when the ``with`` block ends without an exception.

    Raises:
        OSError: it cannot be written; the error names ``path``.
    """
    path = Path(path).resolve()  # replace the file that a symbolic link points to
    try:
        if path.exists() and not path.is_file():  # a device or a pipe cannot be replaced
            with path.open("wb") as file:
                yield file
            return
        mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
        with _temporary(path.parent, _make_file) as temporary:
            with temporary.open("wb") as file:
                yield file
            temporary.chmod(mode)
            temporary.replace(path)
    except BrokenPipeError:  # of a pipe whose reader has gone
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Make an empty folder, which is removed when the ``with`` block ends."""
    with _temporary(
        Path(tempfile.gettempdir()), lambda folder: tempfile.mkdtemp("", TEMPORARY, folder)
    ) as path:
        yield path


@contextmanager
def _temporary(folder: Path, make: Callable[[Path], str]) -> Iterator[Path]:
    """Make a temporary file or folder in a folder, and remove it at the end if it is still there.

    It is locked meanwhile: what a killed process left behind has no lock any more, and is removed first.
    """
    for left in folder.glob(f"{TEMPORARY}*"):
        with suppress(OSError):  # another user's, or one in use
            if time.time() - left.stat().st_mtime > ABANDONED_AGE:
                with _open(left) as handle:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    _remove(left)
    path = Path(make(folder))
    try:
        with _open(path) as handle:
            with suppress(OSError):  # of a file system that knows no locks
                fcntl.flock(handle, fcntl.LOCK_EX)
            yield path
    finally:
        _remove(path)


@contextmanager
def _open(path: Path) -> Iterator[int]:
    """Open a file or folder, to lock it."""
    handle = os.open(path, os.O_RDONLY)
    try:
        yield handle
    finally:
        os.close(handle)


def _make_file(folder: Path) -> str:
    handle, name = tempfile.mkstemp("", TEMPORARY, folder)
    os.close(handle)
    return name


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _umask() -> int:
    """Return the file mode mask of the process, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
