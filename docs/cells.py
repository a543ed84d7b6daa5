"""Measures what is proven of the cells of the shipped scenes' maps, for ``docs/grids.md``: ``make cells``."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from docs.pages import put_between
from symgrasp.bench.figures import with_machine
from symgrasp.bench.maps.cells import FACTORS, CellShares, measure_cells
from symgrasp.files import write_atomically
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import shipped_scenes
from symgrasp.world import prepared

__all__ = ["BEGIN", "END", "MEASURED", "PAGE", "measure", "table"]

ROOT = Path(__file__).parent.parent

MEASURED = ROOT / "docs" / "cells.json"
"""What was measured when the page was made."""

PAGE = ROOT / "docs" / "grids.md"

SAMPLES = 16
"""Redundancy samples of the maps, so that the time of the proofs is compared with that of these alone."""

BEGIN, END = "<!-- measured: make cells -->", "<!-- end of cells -->"


def measure(names: Sequence[str]) -> dict[str, Any]:
    """Measure scenes, and tell which on stderr; return the results as plain data."""
    scenes = []
    for name in names:
        print(name, file=sys.stderr, flush=True)
        scene = prepared(Scene.load(name).with_settings(redundancy=SAMPLES))
        rows = list(measure_cells(scene))
        scenes.append({"name": name, **with_machine("grids", rows)})
    return {"machine": scenes[0]["machine"], "scenes": [{k: s[k] for k in ("name", "grids")} for s in scenes]}


def table(content: Mapping[str, Any]) -> str:
    """Return what `measure` returned as a table in Markdown."""
    head = ["on it", *(f"{factor} times finer" for factor in FACTORS[1:])]
    lines = [
        "Share of the feasible, and of the infeasible cells that are proven to be so as a whole, for the",
        f"first task and arm of each scene at {SAMPLES} samples of the redundancy, "
        "and processor time of the map",
        "with these proofs, as a multiple of that without:",
        "",
        "| scene | own grid | " + " | ".join(head) + " |",
        f"|---|---:|{'---:|' * len(FACTORS)}",
    ]
    for scene in content["scenes"]:
        rows = [CellShares(**row) for row in scene["grids"]]
        cells = [
            f"{100 * r.whole / max(1, r.feasible):.0f} %, {100 * r.none / max(1, r.infeasible):.0f} %; "
            f"{r.ratio:.1f}"
            for r in rows
        ]
        size = f"{rows[0].heights} × {rows[0].angles}"
        lines.append(f"| `{scene['name']}` | {size} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    content = measure(list(shipped_scenes()))
    with write_atomically(MEASURED) as file:
        file.write((json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode())
    put_between(PAGE, BEGIN, END, table(content))
