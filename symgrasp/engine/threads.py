"""Compiled functions on several cores: they release Python's lock, so threads of Python run them at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from numba.core import config

__all__ = ["CORES", "core_count", "in_parallel", "use_cores"]

_config: Any = config  # numba sets its attributes at import time, where type checkers do not see them

CORES: int = _config.NUMBA_NUM_THREADS
"""How many cores this process may use: those it is bound to, or what ``NUMBA_NUM_THREADS`` says."""

_used = CORES


def core_count() -> int:
    """Return how many cores are used at the same time."""
    return _used


def use_cores(count: int) -> None:
    """Use at most that many cores from now on, but not more than `CORES`."""
    global _used
    _used = max(1, min(count, CORES))


def in_parallel(function: Callable[[int], None], parts: Iterable[int]) -> None:
    """Call a function for every part; return when all have ended.

    Args:
        function: compiled, so that several threads can run it at once.
        parts: better more of them than cores, as they take different times.
    """
    parts = list(parts)
    if len(parts) < 2 or core_count() == 1:
        for part in parts:
            function(part)
        return
    # Threads are started anew each time: that takes 0.1 ms, and leaves none to processes that are forked.
    with ThreadPoolExecutor(core_count()) as threads:
        for _ in threads.map(function, parts):
            pass
