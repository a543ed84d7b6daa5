"""Plans as files of the page: the formats to save them in."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from symgrasp.motion.exports import MOTION_EXPORTS
from symgrasp.plan.exports import EXPORTS
from symgrasp.plan.plan import Plan

from .plan_archives import plan_archive

__all__ = ["FORMATS", "plan_file"]

FORMATS: Mapping[str, tuple[str, Callable[[Plan], str]]] = {
    "JSON": (".json", Plan.to_json),
    "CSV": (".csv", EXPORTS["csv"]),
    "Trajectory": (".trajectory.json", EXPORTS["trajectory"]),
    "TSR": (".tsr.yaml", EXPORTS["tsr"]),
    "Motion": (".motion.json", MOTION_EXPORTS["motion"]),
    "Motion CSV": (".motion.csv", MOTION_EXPORTS["motion-csv"]),
}
"""Label of a format on the page → ending of its files, and the function that writes them."""


def plan_file(plan: Plan, format_name: str, folders: Sequence[Path]) -> tuple[str, bytes]:
    """Return a plan as a file: its name and content.

    Args:
        plan: the plan.
        format_name: a key of `FORMATS`. As JSON, a plan of uploaded robots comes in a ZIP file with theirs.
        folders: where the files of uploaded robots are.
    """
    ending, write = FORMATS[format_name]
    name = re.sub(r"\W+", "_", f"{plan.scene.name}_{plan.kind}")
    if folders and format_name == "JSON":
        return f"{name}.zip", plan_archive(plan, name + ending, folders)
    return name + ending, write(plan).encode()
