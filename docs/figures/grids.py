"""The errors of coarse grids, for ``docs/grids.md``."""

from __future__ import annotations

import json

import numpy as np

from docs.figures.style import board, new, save
from docs.grids import MEASURED, read

__all__ = ["grids"]


def grids() -> None:
    """The errors of all shipped scenes over the number of cells, and their median."""
    results = read(json.loads(MEASURED.read_text(encoding="utf-8")))
    figure = new(7.0, 3.8)
    axes = board(figure, (0.65, 0.4, 6.1, 3.25))
    errors = np.array([[100 * r.error for r in grids] for grids in results.values()])
    first = next(iter(results.values()))
    cells = [r.heights * r.angles for r in first]
    for row in errors:
        axes.plot(cells, row, "-", color="#9aa5b1", linewidth=1)
    axes.plot(cells, np.median(errors, axis=0), "-o", color="#0072b2", linewidth=2.2, label="median")
    axes.plot([], [], "-", color="#9aa5b1", linewidth=1, label="a shipped scene")
    axes.set(xscale="log", yscale="log", ylabel="wrong, % of the feasible area")
    axes.set_xticks(cells, [f"{r.heights} × {r.angles}" for r in first])
    axes.set_yticks(ticks := [1, 2, 5, 10, 20, 50, 100], [str(t) for t in ticks])
    axes.minorticks_off()
    axes.grid(color="#e4e7eb", linewidth=0.6)
    axes.legend(frameon=False)
    save(figure, "grids.png")
