"""The type of the callbacks that long computations report their progress to."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from functools import wraps
from time import perf_counter
from typing import TypeVar

__all__ = ["TELL", "Progress", "at_start", "between", "cached", "part_of", "portions", "rising"]

TELL = 0.05
"""Time (s) after which progress is told, and may cancel: long computations are done in portions of about
that long."""

Progress = Callable[[float], None]
"""Called with the finished share (0 to 1) of a computation; may raise `Cancelled` to stop it."""


Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


def cached(
    most: int,
) -> Callable[[Callable[[Key, Progress | None], Value]], Callable[..., Value]]:
    """Keep the last results, none of them None, of a function of one thing and of a progress.

    The progress matters the first time only. Of a call that is cancelled nothing is kept.

    Args:
        most: number of results that are kept.

    Returns:
        A decorator; the progress may then be left out.
    """

    def decorate(compute: Callable[[Key, Progress | None], Value]) -> Callable[..., Value]:
        known: dict[Key, Value] = {}

        @wraps(compute)
        def found(key: Key, progress: Progress | None = None) -> Value:
            kept = known.get(key)  # another thread may remove it meanwhile
            if kept is not None:
                return kept
            known[key] = value = compute(key, progress)
            if len(known) > most:
                known.pop(next(iter(known)), None)
            return value

        return found

    return decorate


def part_of(progress: Progress | None, index: int, count: int) -> Progress | None:
    """Return the progress of one of ``count`` equal parts of a computation, that with this index."""
    if progress is None:
        return None
    return lambda share: progress((index + share) / count)


def at_start(progress: Progress | None) -> Progress | None:
    """Return a progress that tells 0 whatever it is told, for what is done before a computation."""
    return None if progress is None else lambda _: progress(0.0)


def rising(progress: Progress) -> Progress:
    """Return a progress that never falls: where a part is done again, it stays until it is further."""
    most = 0.0

    def report(share: float) -> None:
        nonlocal most
        most = max(most, share)
        progress(most)

    return report


def between(progress: Progress | None, low: float, high: float) -> Progress | None:
    """Return the progress of the part of a computation between two shares."""
    return None if progress is None else lambda share: progress(low + share * (high - low))


def portions(count: int, progress: Progress | None, first: int = 1) -> Iterator[slice]:
    """Yield slices of so many things to do, each of about `TELL` seconds; all at once without a progress.

    Args:
        count: number of things.
        progress: called with the finished share after every slice; may raise `Cancelled`.
        first: length of the first slice.
    """
    done, some = 0, first if progress else count
    while done < count:
        start, end = perf_counter(), min(done + some, count)
        yield slice(done, end)
        # Things differ in cost, so slices at most double; what is found does not depend on their size.
        some = max(1, min(2 * some, int((end - done) * TELL / max(perf_counter() - start, 1e-9))))
        done = end
        if progress:
            progress(done / count)
    if progress and not count:
        progress(1.0)
