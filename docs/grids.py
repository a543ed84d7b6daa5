"""Measures the grids of every shipped scene and writes what ``docs/grids.md`` shows: ``make grids``."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from docs.pages import put_between
from symgrasp.bench.figures import with_machine
from symgrasp.bench.maps.grids import Counts, GridResult, measure_grids
from symgrasp.files import write_atomically
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import shipped_scenes
from symgrasp.world import prepared

__all__ = ["BEGIN", "END", "MEASURED", "PAGE", "measure", "read", "table", "write"]

ROOT = Path(__file__).parent.parent

MEASURED = ROOT / "docs" / "grids.json"
"""What was measured when the page was made."""

PAGE = ROOT / "docs" / "grids.md"

BEGIN, END = "<!-- measured: make grids -->", "<!-- end -->"

Results = Mapping[str, Sequence[GridResult]]
"""Name of the scene → results, the coarsest grid first."""


def measure(names: Sequence[str]) -> dict[str, Any]:
    """Measure scenes, and tell which on stderr; return the results as plain data."""
    scenes = []
    for name in names:
        print(name, file=sys.stderr, flush=True)
        scenes.append(
            {"name": name, **with_machine("grids", list(measure_grids(prepared(Scene.load(name)))))}
        )
    return {"machine": scenes[0]["machine"], "scenes": [{k: s[k] for k in ("name", "grids")} for s in scenes]}


def read(content: Mapping[str, Any]) -> Results:
    """Return what `measure` returned, as results."""
    return {
        scene["name"]: [GridResult(**{**g, "counts": Counts(**g["counts"])}) for g in scene["grids"]]
        for scene in content["scenes"]
    }


def table(results: Results) -> str:
    """Return two tables as Markdown: what maps get wrong, and the plans."""
    first = next(iter(results.values()))
    sizes = " | ".join(f"{r.heights} × {r.angles}" for r in first)
    rule = f"|---|{'---:|' * len(first)}"
    wrong, plans = [], []
    for name, grids in results.items():
        errors = " | ".join(f"{100 * r.error:.1f} %" for r in grids)
        shares = " | ".join(_plan(r) for r in grids)
        wrong.append(f"| `{name}` | {errors} |")
        plans.append(f"| `{name}` | {shares} |")
    return "\n".join(
        [
            "Area that the maps get wrong, as a share of what is feasible:",
            "",
            f"| scene | {sizes} |",
            rule,
            *wrong,
            "",
            "Best plan: margin along and around the object, and clearance:",
            "",
            f"| scene | {sizes} |",
            rule,
            *plans,
            "",
        ]
    )


def write(content: Mapping[str, Any], page: Path) -> None:
    """Put the tables between the markers of a page."""
    put_between(page, BEGIN, END, table(read(content)))


def _plan(result: GridResult) -> str:
    """Return what a cell of the table says of a plan."""
    if result.margin_along is None or result.margin_around is None or result.clearance is None:
        return "none"
    around = np.rad2deg(result.margin_around)
    return f"{1e3 * result.margin_along:.0f} mm, {around:.0f}°, {1e3 * result.clearance:.0f} mm"


if __name__ == "__main__":
    content = measure(list(shipped_scenes()))
    with write_atomically(MEASURED) as file:
        file.write((json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode())
    write(content, PAGE)
