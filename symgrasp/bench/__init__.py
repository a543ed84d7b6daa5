"""Benchmarks of maps and planners against alternative methods, as ratios of times within one run."""

from __future__ import annotations

from collections.abc import Iterator

from symgrasp.bench import maps, planners
from symgrasp.bench.figures import Figure, report

__all__ = ["Figure", "report", "run"]


def run() -> Iterator[Figure]:
    """Run all benchmarks and yield their figures as they are measured."""
    yield from maps.run()
    yield from planners.run()
