"""Compiling with numba: on first use, with the result cached on disk for later runs."""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config, event

__all__ = ["COMPILING_MESSAGE", "SOURCES", "njit", "notify_on_compile"]

SOURCES = (
    "engine/*.py",
    "feasibility/margins.py",
    "ik/*.py",
    "object/manifold.py",
    "planners/*.py",
)
"""Files of this package that hold compiled functions, or constants that are compiled into them."""

COMPILING_MESSAGE = "compiling what this needs, once on this machine; it takes up to a minute"
"""Shown to the user while something is compiled."""

# By default OpenMP threads spin while they wait for each other. Where another program, such as a browser,
# occupies a core, spinning makes a map take three times as long; otherwise it gains next to nothing.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

log = logging.getLogger(__name__)

_config: Any = config  # numba sets its attributes at import time, where type checkers do not see them


class _FirstCompilation(event.Listener):
    """Listens to numba and calls a function at the first compilation."""

    def __init__(self, notify: Callable[[], None]) -> None:
        self._notify, self._notified = notify, False

    def on_start(self, event: event.Event) -> None:
        """Call the function, unless it has been called."""
        if not self._notified:
            self._notified = True
            self._notify()

    def on_end(self, event: event.Event) -> None:
        """Do nothing: only the start of a compilation matters."""


@contextmanager
def notify_on_compile(notify: Callable[[], None]) -> Iterator[None]:
    """Call a function once if something has to be compiled inside the ``with`` block.

    Reading the result of an earlier compilation from the disk does not count.
    """
    with event.install_listener("numba:compile", _FirstCompilation(notify)):
        yield


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile like `numba.njit`, with a separate disk cache for every state of the files in `SOURCES`.

    numba's own cache checks only the file that a function stands in. Compiled functions contain copies
    of those that they call, so after a change in one file, callers in other files would run old code.
    Where the folder of the cache cannot be written, nothing is cached. With ``NUMBA_DISABLE_JIT`` set,
    functions are interpreted.
    """

    def compile_later(function: Callable[..., Any]) -> Any:
        if _config.DISABLE_JIT:
            return function
        before = _config.CACHE_DIR
        _config.CACHE_DIR = _cache_dir(before)
        folder = _config.CACHE_DIR
        settings: dict[str, Any] = {**options, "cache": options.get("cache", False) and _is_writable(folder)}
        try:
            compiled: Any = numba.njit(**settings)(function)
        finally:
            _config.CACHE_DIR = before
        if settings["cache"]:
            compiled._cache.save_overload = _saving(compiled._cache.save_overload, folder)
        return compiled

    return compile_later


@cache
def _is_writable(folder: str) -> bool:
    """Whether files can be written in a folder, which is made; if not, a warning says so."""
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        _warn_uncached(folder, error.strerror)
        return False
    return True


def _saving(save: Callable[..., None], folder: str) -> Callable[..., None]:
    """Return numba's function that writes what was compiled, which may fail now: disks may be full."""

    def save_if_possible(*overload: Any) -> None:
        try:
            save(*overload)
        except OSError as error:
            _warn_uncached(folder, error.strerror)

    return save_if_possible


@cache
def _warn_uncached(folder: str, reason: str) -> None:
    """Warn once, and not in the processes of the page too, that what is compiled is not kept."""
    if multiprocessing.parent_process() is None:
        log.warning(
            "what is compiled cannot be kept in %s (%s): every start compiles it anew", folder, reason
        )


@cache
def _cache_dir(chosen: str) -> str:
    """Return the cache folder for the present state of the files in `SOURCES`.

    Args:
        chosen: the folder that the user chose through ``NUMBA_CACHE_DIR``, if any.
    """
    package = Path(__file__).parent
    base = Path(chosen) if chosen else package / "__pycache__"
    if not chosen and not os.access(base if base.is_dir() else package, os.W_OK):
        base = Path.home() / ".cache" / "symgrasp"
    stamp = hashlib.sha256()
    for path in sorted(path for pattern in SOURCES for path in package.glob(pattern)):
        stamp.update(path.read_bytes())
    return str(base / f"compiled-{stamp.hexdigest()[:16]}")
