"""Writes the table of robots in ``docs/robots.md`` from what the benchmark measured: ``make robots``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docs.pages import put_between

__all__ = ["BEGIN", "END", "MEASURED", "PAGE", "table", "write"]

ROOT = Path(__file__).parent.parent

MEASURED = ROOT / "docs" / "robots.json"
"""What ``symgrasp bench robots --out`` wrote when the table was made."""

PAGE = ROOT / "docs" / "robots.md"

BEGIN, END = "<!-- measured: make robots -->", "<!-- end -->"

NONE = "–"
"""Where nothing was measured."""


def table(content: Mapping[str, Any]) -> str:
    """Return the table as Markdown, and below it why some robots have no map."""
    machine, robots = content["machine"], content["robots"]
    recalled = {robot["poses"] for robot in robots if robot["family"]}
    lines = [
        f"Measured by `symgrasp bench robots` on {machine['cpus']} cores ({machine['machine']}), "
        f"Python {machine['python']}; recall over {' or '.join(f'{n:,}' for n in sorted(recalled))} "
        "random configurations an arm.",
        "",
        "| robot | loads | solver | engine | ms CPU a map | feasible | recall "
        "| out of reach or not found, but reached | joint limits, but reached "
        "| faults of the solver | feasible, and reached |",
        "|---|---|---|---|---:|---:|---:|---:|---:|---:|---:|",
        *(_row(robot) for robot in robots),
    ]
    without = [f"- {robot['name']}: {robot['problem']}" for robot in robots if robot["problem"]]
    if without:
        lines += ["", "No map of:", "", *without]
    return "\n".join(lines) + "\n"


def _row(robot: Mapping[str, Any]) -> str:
    """Return the row of a robot."""
    cells = [robot["name"], "yes" if robot["family"] else "no", robot["family"] or NONE]
    recall = _percent(robot["found"], robot["poses"]) if robot["family"] else NONE
    if robot["problem"]:
        cells += [NONE, NONE, NONE, recall, *[NONE] * 4]
    else:
        checks = [robot[name] for name in ("unreached", "limits", "control")]
        reached = [
            f"{each['reached']} of {each['cells']}" if each["cells"] else "no such cell" for each in checks
        ]
        faults = sum(each["missed"] for each in checks)
        cells += [
            robot["engine"], f"{robot['milliseconds']:.0f}", f"{100 * robot['feasible']:.0f} %", recall,
            *reached[:2], str(faults), reached[2],
        ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _percent(part: int, whole: int) -> str:
    """Return a share in percent, and 100 only where nothing is missing."""
    return "100 %" if part == whole else f"{min(100 * part / whole, 99.999):.3f} %"


def write(content: Mapping[str, Any], page: Path) -> None:
    """Put the table between the markers of a page."""
    put_between(page, BEGIN, END, table(content))


if __name__ == "__main__":
    write(json.loads(MEASURED.read_text(encoding="utf-8")), PAGE)
