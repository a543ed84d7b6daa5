"""Benchmarks of maps and planners against alternative methods, as ratios of times within one run."""

from __future__ import annotations

from collections.abc import Iterator

from symgrasp.bench import planners
from symgrasp.bench.compare import read_run, slower
from symgrasp.bench.figures import Figure, report
from symgrasp.bench.maps import map_times, processes

__all__ = ["Figure", "read_run", "report", "run", "slower"]


def run() -> Iterator[Figure]:
    """Run all benchmarks and yield their figures as they are measured."""
    yield from map_times.run()
    yield from processes.run()
    yield from planners.run()
