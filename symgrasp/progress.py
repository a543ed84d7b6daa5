"""The type of the callbacks that long computations report their progress to."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Progress", "part_of", "rising"]

Progress = Callable[[float], None]
"""Called with the finished share (0 to 1) of a computation; may raise `Cancelled` to stop it."""


def part_of(progress: Progress | None, index: int, count: int) -> Progress | None:
    """Return the progress of one of ``count`` equal parts of a computation, that with this index."""
    if progress is None:
        return None
    return lambda share: progress((index + share) / count)


def rising(progress: Progress) -> Progress:
    """Return a progress that never falls: where a part is done again, it stays until it is further."""
    most = 0.0

    def report(share: float) -> None:
        nonlocal most
        most = max(most, share)
        progress(most)

    return report
