"""Limits of what a process that computes for a session may use."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["MEMORY_LIMIT", "limit_memory", "ran_out_of_memory"]

MEMORY_LIMIT = 4_000_000_000
"""Memory (bytes) that the process may take besides what its code, libraries and first threads take."""


def limit_memory() -> None:
    """Let this process take `MEMORY_LIMIT` more memory than it has; without effect except on Linux."""
    try:
        import resource
    except ImportError:  # Windows
        return
    # RLIMIT_AS would also count what every thread of numba and BLAS merely reserves.
    with suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[5])
        _, highest = resource.getrlimit(resource.RLIMIT_DATA)
        limit = pages * os.sysconf("SC_PAGE_SIZE") + MEMORY_LIMIT
        resource.setrlimit(resource.RLIMIT_DATA, (limit, highest))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash would write all of it to the disk


def ran_out_of_memory(error: BaseException | None) -> bool:
    """Return whether an error comes from one that says that there is no more memory."""
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__context__
    return False
