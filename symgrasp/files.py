"""Finding the files that scenes and robots refer to, and writing files in one piece."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import IO

__all__ = ["SCENES_DIR", "package_dir", "resolve", "write_atomically"]

SCENES_DIR = Path(__file__).resolve().parent.parent / "static_scenes"
"""The shipped scenes and their meshes; beside the package, in a checkout and when installed."""


def package_dir(name: str) -> Path | None:
    """Return the folder of an importable Python package without importing it, or None."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def resolve(reference: str, folder: Path) -> Path | None:
    """Find the file that a reference means.

    Args:
        reference: ``package://<package>/<path>``, ``file://<path>``, or a path relative to
            ``folder``. Where no Python package of that name holds the file, the folders above
            ``folder`` are searched for ``<package>/<path>``, as ROS packages are laid out.
        folder: where the file that holds the reference lies.

    Returns:
        The existing file, or None.
    """
    if not reference.startswith("package://"):
        path = folder / reference.removeprefix("file://")
        return path if path.is_file() else None
    rest = reference.removeprefix("package://")
    package, _, inner = rest.partition("/")
    root = package_dir(package)
    candidates = [root / inner] if root else []
    candidates += [parent / rest for parent in (folder, *folder.parents)]
    return next((path for path in candidates if path.is_file()), None)


@contextmanager
def write_atomically(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file beside ``path`` that takes its name once the block succeeded."""
    path = Path(path)
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
    mask = os.umask(0)
    os.umask(mask)
    return mask
