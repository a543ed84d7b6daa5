"""How long things take: by the clock, and in CPU time of all threads, which a busy machine changes little."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np

from symgrasp.bench.figures import Figure

__all__ = ["Time", "ratios", "time_of", "times"]

SCALES = {"s": 1.0, "ms": 1e3, "µs": 1e6}
"""Unit → how many of it are a second."""


class Time(NamedTuple):
    """How long something took (s): by the clock, and in CPU time of all threads of the process together."""

    wall: float
    cpu: float

    def __add__(self, other: Time) -> Time:  # type: ignore[override]
        """Return the time of both, one after the other."""
        return Time(self.wall + other.wall, self.cpu + other.cpu)

    def __truediv__(self, count: float) -> Time:
        """Return the time of one of so many."""
        return Time(self.wall / count, self.cpu / count)


def time_of(work: Callable[[], Any], runs: int = 1) -> Time:
    """Run something and return how long it took, the median of some runs."""
    found = []
    for _ in range(runs):
        wall, cpu = perf_counter(), process_time()
        work()
        found.append((perf_counter() - wall, process_time() - cpu))
    return Time(*map(float, np.median(found, axis=0)))


def times(name: str, unit: str, found: Iterable[Time]) -> Figure:
    """Return times as a figure in a unit of `SCALES`."""
    walls, cpus = zip(*found, strict=True)
    scale = SCALES[unit]
    return Figure(name, unit, tuple(scale * t for t in walls), tuple(scale * t for t in cpus))


def ratios(name: str, pairs: Sequence[tuple[Time, Time]]) -> Figure:
    """Return how many times as long as the second the first of each pair took.

    In CPU time: one may use more threads than the other, and the machine may be busy with other things.
    """
    return Figure(name, "×", tuple(a.cpu / b.cpu for a, b in pairs))
