"""Figures that a benchmark measured, as text and as plain data."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

__all__ = ["Figure", "keyed", "report", "with_machine"]


@dataclass(frozen=True)
class Figure:
    """A quantity measured in one or several runs.

    Attributes:
        name: what was measured.
        unit: its unit; ``×`` for a ratio.
        values: one value a run; empty where it could not be measured, with the reason in the name.
        cpu: of times, the CPU time of each run, of all threads together; empty for other quantities.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    cpu: tuple[float, ...] = ()

    def line(self) -> str:
        """Return name, median, unit and range, and the same of the CPU time, as one line of text."""
        if not self.values:
            return self.name
        cpu = f", CPU {_spread(self.cpu, self.unit)}" if self.cpu else ""
        return f"{self.name:64} {_spread(self.values, self.unit)}{cpu}"

    def to_dict(self) -> dict[str, Any]:
        """Return the figure as plain data."""
        cpu = {"cpu": list(self.cpu)} if self.cpu else {}
        return {"name": self.name, "unit": self.unit, "values": list(self.values), **cpu}

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Figure:
        """Return the figure that `to_dict` made plain data of.

        Raises:
            KeyError: something is missing.
            TypeError: something is of another kind.
            ValueError: the same, of a number.
        """
        values, cpu = (tuple(map(float, v)) for v in (content["values"], content.get("cpu", ())))
        return Figure(str(content["name"]), str(content["unit"]), values, cpu)


def keyed(figures: Iterable[Figure]) -> dict[str, Figure]:
    """Return figures by name; an indented one belongs to the one above it: ``that one: it``."""
    found, above = {}, ""
    for figure in figures:
        name = figure.name
        if name.startswith(" "):
            name = f"{above}: {name.strip()}"
        else:
            above = name
        found[name] = figure
    return found


def report(figures: Sequence[Figure]) -> dict[str, Any]:
    """Return figures and the machine they were measured on as plain data for JSON."""
    return {"machine": _machine(), "figures": [figure.to_dict() for figure in figures]}


def with_machine(name: str, rows: Sequence[Any]) -> dict[str, Any]:
    """Return rows (dataclasses) of that name, and the machine they were measured on, as plain data."""
    return {"machine": _machine(), name: [asdict(row) for row in rows]}


def _spread(values: Sequence[float], unit: str) -> str:
    low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
    spread = f"{low:.3g} to {high:.3g}" if len(values) > 1 else "one run"
    return f"{middle:9.3g} {unit:3} ({spread})"


def _machine() -> dict[str, Any]:
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cpus": os.cpu_count(),
    }
