"""What takes long to compute and depends on the content of files alone, kept on the disk for later runs."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from symgrasp.files import write_atomically

__all__ = ["cache_folder", "kept", "make_folder"]

SOURCES = (
    "collision/**/*.py",
    "descriptions/**/*.py",
    "engine/clearance_bound.py",
    "engine/kinematics.py",
    "meshes/**/*.py",
    "poses.py",
    "robot/**/*.py",
    "world/**/*.py",
)
"""Files of this package with what is computed, and with what it is computed from."""

LIBRARIES = ("numba", "numpy", "pybullet", "scipy", "trimesh")
"""Packages that compute it."""

MOST_BYTES = 200_000_000
"""When more than this is kept, the oldest half is removed: people may bring any number of robots."""

STATES = 4
"""Number of states of the files of this package whose folders are left, the present one among them."""


def cache_folder(kind: str, sources: Iterable[str], versions: Iterable[str] = (), chosen: str = "") -> Path:
    """Return the folder for what depends on the present state of some files of this package.

    Args:
        kind: how the name of the folder begins.
        sources: patterns of the files.
        versions: what else it depends on.
        chosen: the folder that the user chose to hold it, if any.
    """
    package = Path(__file__).parent
    base = Path(chosen) if chosen else package / "__pycache__"
    if not chosen and not os.access(base if base.is_dir() else package, os.W_OK):
        base = Path.home() / ".cache" / "symgrasp"
    stamp = hashlib.sha256(repr(tuple(versions)).encode())
    for path in sorted(path for pattern in sources for path in package.glob(pattern)):
        stamp.update(path.read_bytes())
    return base / f"{kind}-{stamp.hexdigest()[:16]}"


def make_folder(folder: Path) -> None:
    """Make a folder of `cache_folder` if it is not there; then the oldest of its kind go, but for `STATES`.

    Raises:
        OSError: it cannot be made.
    """
    if folder.is_dir():
        return
    folder.mkdir(parents=True, exist_ok=True)
    kind = folder.name.rpartition("-")[0]
    with suppress(OSError):  # another process may do the same
        others = [path for path in folder.parent.glob(f"{kind}-{'[0-9a-f]' * 16}") if path != folder]
        others.sort(key=lambda path: path.stat().st_mtime)
        for path in others[: -(STATES - 1)]:
            shutil.rmtree(path, ignore_errors=True)


def kept(key: tuple[object, ...], compute: Callable[[], tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
    """Return arrays that were computed in this or an earlier run; compute and keep them if they were not.

    Where nothing can be read or written, they are computed every time.

    Args:
        key: what they are, and the SHA-256 of all content that they depend on.
        compute: computes them.
    """
    file = _folder() / f"{hashlib.sha256(repr(key).encode()).hexdigest()}.npz"
    # The archive has checksums, so that a damaged one is not taken for what was kept.
    with suppress(OSError, ValueError, KeyError, EOFError, BadZipFile), np.load(file) as found:
        return tuple(found[f"arr_{k}"] for k in range(len(found.files)))
    arrays = compute()
    with suppress(OSError):
        make_folder(file.parent)
        with write_atomically(file) as stream:
            np.savez(stream, *arrays)
        _make_room(file.parent)
    return arrays


@cache
def _folder() -> Path:
    return cache_folder("kept", SOURCES, map(version, LIBRARIES))


def _make_room(folder: Path) -> None:
    """Remove the oldest files of a folder if there is too much in it."""
    found = sorted((stat.st_mtime, stat.st_size, path) for path in folder.iterdir() if (stat := path.stat()))
    excess = sum(size for _, size, _ in found) - MOST_BYTES
    if excess > 0:
        for _, size, path in found:
            path.unlink(missing_ok=True)
            excess -= size
            if excess <= -MOST_BYTES // 2:
                break
