"""Compiled code: it is made on first use and kept on disk, so only the first run on a machine waits."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config, event

__all__ = ["COMPILING", "SOURCES", "njit", "telling_of_compiling"]

SOURCES = (
    "engine/*.py",
    "feasibility/margins.py",
    "ik/*.py",
    "object/manifold.py",
    "planners/*.py",
)
"""Where compiled code and the constants in it come from, inside this package."""

COMPILING = "compiling what this needs, once on this machine; it takes up to a minute"
"""What to tell people meanwhile."""

# OpenMP's threads would spin while they wait for each other. Where something else, such as a browser,
# has one of the cores, that makes a map take three times as long; else it gains next to nothing.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

_config: Any = config  # numba fills it in as it is imported, where type checkers do not see it


class _Once(event.Listener):
    """Calls a function when something is compiled for the first time."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell, self._told = tell, False

    def on_start(self, event: event.Event) -> None:
        if not self._told:
            self._told = True
            self._tell()

    def on_end(self, event: event.Event) -> None:
        """There may be more to compile."""


@contextmanager
def telling_of_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call a function once if something has to be compiled inside the ``with`` block.

    What was compiled in an earlier run and is read from the disk does not count.
    """
    with event.install_listener("numba:compile", _Once(tell)):
        yield


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile as `numba.njit`, and keep the result apart for every state of `SOURCES`.

    numba's own cache looks at the file of a function alone. Compiled functions hold copies of those
    that they call, so a change in one file would leave old code at work in another.
    """

    def compile_later(function: Callable[..., Any]) -> Any:
        before = _config.CACHE_DIR
        _config.CACHE_DIR = _cache_dir(before)
        try:
            return numba.njit(**options)(function)
        finally:
            _config.CACHE_DIR = before

    return compile_later


@cache
def _cache_dir(chosen: str) -> str:
    """Return the folder for what is compiled from the sources as they are.

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
