"""The formats in which the page saves plans."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from symgrasp.plan.exports import EXPORTS
from symgrasp.plan.plan import Plan

__all__ = ["FORMATS"]

FORMATS: Mapping[str, tuple[str, Callable[[Plan], str]]] = {
    "JSON": (".json", Plan.to_json),
    "CSV": (".csv", EXPORTS["csv"]),
    "Trajectory": (".trajectory.json", EXPORTS["trajectory"]),
    "TSR": (".tsr.yaml", EXPORTS["tsr"]),
}
"""What the page calls a format → ending of its files, and what writes them."""
