"""Plans as files of the page: the formats to save them in, and the largest file that is read."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from symgrasp.motion.exports import MOTION_EXPORTS
from symgrasp.plan.exports import EXPORTS
from symgrasp.plan.plan import LARGEST_PLAN, Plan

__all__ = ["FORMATS", "PLAN_LIMIT"]

FORMATS: Mapping[str, tuple[str, Callable[[Plan], str]]] = {
    "JSON": (".json", Plan.to_json),
    "CSV": (".csv", EXPORTS["csv"]),
    "Trajectory": (".trajectory.json", EXPORTS["trajectory"]),
    "TSR": (".tsr.yaml", EXPORTS["tsr"]),
    "Motion": (".motion.json", MOTION_EXPORTS["motion"]),
    "Motion CSV": (".motion.csv", MOTION_EXPORTS["motion-csv"]),
}
"""Label of a format on the page → ending of its files, and the function that writes them."""

PLAN_LIMIT = LARGEST_PLAN
"""Largest plan file (bytes) that is read."""
