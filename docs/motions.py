"""Writes what the benchmark measured of motions into docs/motions.md: ``make motions``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from docs.pages import put_between
from symgrasp.bench.figures import Figure

__all__ = ["BEGIN", "END", "MEASURED", "PAGE", "table"]

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs/motions.md"

MEASURED = ROOT / "docs/motions.json"
"""What ``symgrasp bench motion --out`` wrote."""

BEGIN, END = "<!-- measured: make motions -->", "<!-- end -->"


def table(content: Mapping[str, Any]) -> str:
    """Return what was measured, in Markdown; shares are told in percent."""
    machine = content["machine"]
    rows = [_row(Figure.from_dict(figure)) for figure in content["figures"]]
    return "\n".join(
        [
            f"Measured by `symgrasp bench motion` on {machine['cpus']} cores ({machine['machine']}), "
            f"Python {machine['python']}.",
            "",
            "| what | runs | median | from | to | CPU |",
            "|---|---:|---:|---:|---:|---:|",
            *rows,
            "",
        ]
    )


def _row(figure: Figure) -> str:
    name = f"… {figure.name.strip()}" if figure.name.startswith(" ") else figure.name
    if not figure.values:
        return f"| {name} | 0 | | | | |"
    if not figure.unit:
        return f"| {name} | | {100 * np.mean(figure.values):.3g} % | | | |"
    low, middle, high = (f"{value:.3g}" for value in np.quantile(figure.values, [0.0, 0.5, 1.0]))
    cpu = f"{np.median(figure.cpu):.3g} {figure.unit}" if figure.cpu else ""
    return f"| {name} | {len(figure.values)} | {middle} {figure.unit} | {low} | {high} | {cpu} |"


if __name__ == "__main__":
    put_between(PAGE, BEGIN, END, table(json.loads(MEASURED.read_text(encoding="utf-8"))))
