"""What the list of plans is sorted by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["COLUMNS", "PLANNED", "SolutionOrder"]

COLUMNS: Mapping[str, bool] = {
    "h (cm)": False, "θ (°)": False, "roll (°)": False, "pitch (°)": False,
    "gap (mm)": True, "along (mm)": True, "around (°)": True, "clear (mm)": True,
}  # fmt: skip
"""Column → whether more of it is better, so that it is sorted from high to low at first."""


class SolutionOrder(NamedTuple):
    """What the list is sorted by.

    Attributes:
        column: one of `COLUMNS`; empty for the order of the planner, best first.
        descending: from high to low.
    """

    column: str = ""
    descending: bool = False

    def clicked(self, column: str) -> SolutionOrder:
        """Return the order after a click on the heading of a column: a second one reverses it."""
        if column == self.column:
            return SolutionOrder(column, not self.descending)
        return SolutionOrder(column, COLUMNS.get(column, False))


PLANNED = SolutionOrder()
"""The order of the planner."""
