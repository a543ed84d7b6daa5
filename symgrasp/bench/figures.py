"""Figures that a benchmark measured, as text and as plain data."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

__all__ = ["Figure", "report", "with_machine"]


@dataclass(frozen=True)
class Figure:
    """A quantity measured in one or several runs.

    Attributes:
        name: what was measured.
        unit: its unit; ``×`` for a ratio.
        values: one value a run; empty where it could not be measured, with the reason in the name.
    """

    name: str
    unit: str
    values: tuple[float, ...]

    def line(self) -> str:
        """Return name, median, unit and range as one line of text."""
        if not self.values:
            return self.name
        low, middle, high = np.quantile(self.values, [0.0, 0.5, 1.0])
        spread = f"{low:.3g} to {high:.3g}" if len(self.values) > 1 else "one run"
        return f"{self.name:64} {middle:9.3g} {self.unit:3} ({spread})"

    def to_dict(self) -> dict[str, Any]:
        """Return the figure as plain data."""
        return {"name": self.name, "unit": self.unit, "values": list(self.values)}


def report(figures: Sequence[Figure]) -> dict[str, Any]:
    """Return figures and the machine they were measured on as plain data for JSON."""
    return {"machine": _machine(), "figures": [figure.to_dict() for figure in figures]}


def with_machine(name: str, rows: Sequence[Any]) -> dict[str, Any]:
    """Return rows (dataclasses) of that name, and the machine they were measured on, as plain data."""
    return {"machine": _machine(), name: [asdict(row) for row in rows]}


def _machine() -> dict[str, Any]:
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cpus": os.cpu_count(),
    }
