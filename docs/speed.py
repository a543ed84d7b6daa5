"""Writes the tables of times of the README and of their own page: ``make bench``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from docs.pages import put_between
from symgrasp.bench.figures import Figure, keyed

__all__ = ["BEGIN", "BENCH", "END", "PAGE", "ROWS", "full_table", "table", "write"]

ROOT = Path(__file__).parent.parent

BENCH = ROOT / "docs" / "bench.json"
"""What ``symgrasp bench --out`` wrote when the table was made."""

PAGE = ROOT / "docs" / "speed.md"
"""The page of the full table, with a row for every arm."""

BEGIN, END = "<!-- measured: make bench -->", "<!-- end -->"

ARMS = "every arm: "
"""How the figures of all arms begin: one row a number of arms in the README, one an arm on the page."""

NEXT = "## Security"
"""The section that the table's own stands before."""

ROWS: Mapping[str, str] = {
    "map of bottle_on_table": "the map of `bottle_on_table`: 9,216 cells, 32 redundancy samples",
    "map of bottle_on_table: built once for its arm and obstacles": "… what is built once for it",
    "the same map with an approach of 0.05 m": "… with an approach of 5 cm, against it",
    "the same map with an approach of 0.1 m": "… with an approach of 10 cm, against it",
    "maps of all shipped scenes: reference takes": "Algorithm 1 with PyBullet, against our map",
    "maps of all shipped scenes: Pinocchio and Coal takes": "Pinocchio and Coal, against our map",
    "the same boxes, 4 cut into 400": "the map among 400 boxes, against 4",
    "the same boxes as meshes of 49,152 triangles": "the map among meshes of 49,152 triangles, against boxes",
    "turning the object about its axis": "the map when the object has turned",
    "symgrasp --help, whole process": "`symgrasp --help`, from start to end",
    "symgrasp map bottle_on_table, whole process": "`symgrasp map bottle_on_table`, from start to end",
    "symgrasp map bottle_on_table, whole process: memory at most": "… memory at most",
    "a first map, with all that it compiles": "a first map on a machine, with all that it compiles",
    "a first map, with all that it compiles: a first plan of one arm after it": "… a first plan after it",
    "a first map, with all that it compiles: a first plan of two arms after it": "… of two arms after it",
    "maps in two processes at once, over one": "maps in two processes at once, over one",
    "maps in two processes at once, over one: in CPU time": "… by CPU time, as with a core each",
    "one grasp for 50 tasks on 48 × 96 maps, once the maps exist": "one grasp for 50 tasks, maps given",
    "two hands, complete search with whole robots": "the best placement of two hands, maps given",
    "two hands, hill climbing as printed: climbing takes, on average of all": "hill climbing (Algorithm 3), "
    "average time against it",
    "four hands on a log, 51 random parts of their maps": "the best placement of four hands, maps given",
}
"""Name of a figure of the benchmark → what the table calls it.

A figure that belongs to another one is named ``that one: it``.
"""


def table(content: Mapping[str, Any]) -> str:
    """Return the README's table as Markdown; what the run did not measure is left out.

    Scenes with as many mapped arms share a row, whose spread is that of all runs of all their arms.
    """
    figures = _figures(content)
    scenes: dict[str, list[Figure]] = {}
    for arm in _arms(figures):
        scenes.setdefault(arm.name.removeprefix(ARMS).split(", ")[0], []).append(arm)
    kinds: dict[int, list[Figure]] = {}
    for arms in scenes.values():
        kinds.setdefault(len(arms), []).extend(arms)
    rows = [
        _row(f"map of an arm, scenes with {count} arm{'s' * (count > 1)} mapped", kinds[count])
        for count in sorted(kinds)
    ]
    return _markdown(content["machine"], [*_rows(figures), *rows])


def full_table(content: Mapping[str, Any]) -> str:
    """Return the table of the page as Markdown, with a row for every arm."""
    figures = _figures(content)
    arms = [_row(f"map of {f.name.removeprefix(ARMS)}", [f]) for f in _arms(figures)]
    return _markdown(content["machine"], [*_rows(figures), *arms])


def write(rows: str, page: Path) -> None:
    """Put the table between the markers of a page; without any, in a section of its own."""
    text = page.read_text(encoding="utf-8")
    if BEGIN not in text:
        place = text.index(NEXT)
        page.write_text(f"{text[:place]}## How fast\n\n{BEGIN}\n{END}\n\n{text[place:]}", encoding="utf-8")
    put_between(page, BEGIN, END, rows)


def _figures(content: Mapping[str, Any]) -> Mapping[str, Figure]:
    return keyed(map(Figure.from_dict, content["figures"]))


def _arms(figures: Mapping[str, Figure]) -> list[Figure]:
    return [f for name, f in figures.items() if name.startswith(ARMS)]


def _rows(figures: Mapping[str, Figure]) -> list[str]:
    return [_row(words, [figures[name]]) for name, words in ROWS.items() if name in figures]


def _row(words: str, figures: list[Figure]) -> str:
    """Return the row of all runs of figures of one unit."""
    unit = figures[0].unit
    values = np.concatenate([f.values for f in figures])
    low, middle, high = (_short(v) for v in np.quantile(values, [0.0, 0.5, 1.0]))
    cpu = [value for f in figures for value in f.cpu or ()]
    last = f"{_short(float(np.median(cpu)))} {unit}" if cpu else ""
    return f"| {words} | {middle} {unit} | {low} | {high} | {last} |"


def _markdown(machine: Mapping[str, Any], rows: list[str]) -> str:
    lines = [
        f"Median and spread, measured by `symgrasp bench` on {machine['cpus']} cores ({machine['machine']}), "
        f"Python {machine['python']}. CPU time is that of all threads together, and what ratios compare.",
        "",
        "| what | median | from | to | CPU |",
        "|---|---:|---:|---:|---:|",
        *rows,
    ]
    return "\n".join(lines) + "\n"


def _short(value: float) -> str:
    """Return three digits, without an exponent."""
    return f"{float(f'{value:.3g}'):,.10g}"


if __name__ == "__main__":
    measured = json.loads(BENCH.read_text(encoding="utf-8"))
    write(table(measured), ROOT / "README.md")
    write(full_table(measured), PAGE)
