"""The software measured against what one would do otherwise, as ratios inside one run."""

from __future__ import annotations

from collections.abc import Iterator

from symgrasp.bench import maps, planners
from symgrasp.bench.figures import Figure, report

__all__ = ["Figure", "report", "run"]


def run() -> Iterator[Figure]:
    """Measure everything, a figure at a time."""
    yield from maps.run()
    yield from planners.run()
