"""Writes what large surveys cost into docs/surveys.md, from what the benchmark measured: ``make surveys``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from docs.pages import put_between
from symgrasp.bench.figures import Figure, keyed
from symgrasp.survey.survey import BATCH

__all__ = ["BEGIN", "END", "MEASURED", "PAGE", "Costs", "costs"]

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs/surveys.md"

MEASURED = ROOT / "docs/surveys.json"
"""What ``symgrasp bench survey --out`` wrote."""

BEGIN, END = "<!-- measured: make surveys -->", "<!-- end -->"

MILLION, CORES = 1_000_000, 200
"""Points, and the cores of 100 machines with two each."""


class Costs(NamedTuple):
    """What the parts of a survey take (s).

    Attributes:
        start: starting a worker.
        point: a point, with all that is written, on one core.
        scene: another scene, on one core.
        batch: what the scheduler and the client take for a batch.
    """

    start: float
    point: float
    scene: float
    batch: float

    def seconds(self, points: int, scenes: int, cores: float) -> float:
        """Return how long (s) a survey takes.

        Args:
            points, scenes: how many there are.
            cores: how many cores compute all the time.
        """
        computing = (points * self.point + scenes * self.scene) / cores
        return self.start + max(computing, points / BATCH * self.batch)


def costs(content: Mapping[str, Any]) -> str:
    """Return what surveys cost, in Markdown."""
    figures = keyed(map(Figure.from_dict, content["figures"]))

    def cpu(name: str) -> float:
        return float(np.median(figures[name].cpu))

    def median(name: str) -> float:
        return float(np.median(figures[name].values))

    alone, two = "a map alone, one core", "a survey in two processes, over one"
    sizes = [name for name in figures if name.endswith("with all that is written, over it")]
    large, small = (name.split(" of ")[1].split(", with")[0] for name in sizes)
    over, over_small = map(median, sizes)
    writing, _ = (cpu(name) for name in figures if "writing a batch" in name)
    another = next(name for name in figures if name.startswith("a world and an engine for another scene"))
    start = cpu("starting a process, and its first point")
    one, scene = cpu(alone) * over / 1e3, cpu(another) / 1e3
    share = min(1.0, median(f"{two}: in CPU time") / 2)
    handing = median(f"{two}: CPU time of the scheduler and the client for a batch")
    early, late = (figures[name].values[0] for name in figures if name.startswith("memory after"))
    own = Costs(start, one, scene, handing / 1e3)
    beside = over + handing / BATCH / cpu(alone)
    hours, scene_hours = (own.seconds(MILLION, scenes, 1.0) / 3600 for scenes in (1, MILLION))
    minutes, scene_minutes = (own.seconds(MILLION, scenes, CORES * share) / 60 for scenes in (1, MILLION))
    handed = MILLION / BATCH * own.batch / 60
    machine = content["machine"]
    return f"""
Measured by `symgrasp bench survey` on {machine["cpus"]} cores ({machine["machine"]}): medians of CPU times,
which change little where the machine does other things as well. Where it does not, what the command says of
two processes by the clock counts too.

| what | |
|---|---:|
| a map of 24 × 48 × 2 cells at 16 samples, one core | {cpu(alone):.1f} ms |
| a point of a survey of {large} points, computed and written, over its map | × {over:.3f} |
| … with its share of what scheduler and client take for a batch of {BATCH} | × {beside:.3f} |
| … of a survey of {small} points, whose batches are small, computed and written | × {over_small:.3f} |
| writing a batch of {BATCH}, of that | {writing:.1f} ms |
| a world and an engine for another scene | {1e3 * scene:.0f} ms |
| starting a process until its first point is written | {start:.1f} s |
| two processes over one, in CPU time of the workers | × {median(f"{two}: in CPU time"):.2f} |
| scheduler and client for a batch | {handing:.1f} ms |
| memory of a process after 1,000 points | {early:.0f} MB |
| … after 10,000 | {late:.0f} MB |

So N points in S scenes on C cores take about

    {start:.1f} s + (N · {1e3 * one:.1f} ms + S · {1e3 * scene:.0f} ms) / (C · {share:.2f}),
    but at least {start:.1f} s + N / {BATCH} · {handing:.1f} ms

where {share:.2f} is how much of a core a worker gets, from the CPU time of two processes over one, and the
second line is what one scheduler can hand out. This is reckoned on paper, not run: a million poses of
the object in one scene are {hours:.1f} hours of one core, and {minutes:.1f} minutes on 100 machines with 2
cores each, of which the scheduler is busy {handed:.1f}. A million places of a base are a million scenes:
{scene_hours:.0f} hours of one core, {scene_minutes:.0f} minutes on those machines. With more machines the
scheduler, and the file system that all write to, come first.
"""


if __name__ == "__main__":
    put_between(PAGE, BEGIN, END, costs(json.loads(MEASURED.read_text(encoding="utf-8"))))
