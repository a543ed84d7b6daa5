"""How the map is looked at, and what was found out about it for that: the recomputed map, the candidates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from app.state.requests import CompareRequest, Comparison, ExplainRequest, ExplainResult, MapRequest, Request
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.map import FeasibilityMap

__all__ = ["MapViewState", "RollChoice"]


@dataclass(frozen=True)
class MapViewState:
    """What of the map is shown.

    Attributes:
        view: what its colours stand for.
        handprint: whether the picked grasp's print lies on it.
        compare: whether the map is computed from scratch as well, to compare it with the shifted one.
        check: the newest of those.
        explained: the candidates of the cell that was picked last.
        candidate: index of the one that is shown; None for the one that decides the cell.
    """

    view: ColorBy = ColorBy.REASON
    handprint: bool = False
    compare: bool = False
    check: Comparison | None = None
    explained: ExplainResult | None = None
    candidate: int | None = None

    @property
    def inputs(self) -> tuple[object, ...]:
        """What widgets show and can change."""
        return self.view, self.handprint, self.compare, self.candidate

    def unmet(self, request: MapRequest, delta: float, cell: Cell | None) -> Request | None:
        """Return what is to be found out next.

        Args:
            request: the map.
            delta: turn of the object (rad).
            cell: the picked cell of the map before it is shifted.
        """
        check = CompareRequest(request, delta)
        if self.compare and (self.check is None or self.check.request != check):
            return check
        if cell is not None:
            explain = ExplainRequest(request, cell)
            if self.explained is None or self.explained.request != explain:
                return explain
        return None

    def choose_compare(self, compare: bool) -> MapViewState:
        """Compare with a recomputed map, or no more."""
        return replace(self, compare=compare, check=self.check if compare else None)

    def choose_candidate(self, candidate: int) -> MapViewState:
        """Show a candidate, by its index among the explained ones; the best is the first."""
        count = len(self.explained.explanation.candidates) if self.explained else 0
        return replace(self, candidate=int(np.clip(candidate, 0, count - 1)) if count else None)

    def take(self, found: Comparison | ExplainResult) -> MapViewState:
        """Take what was found out."""
        if isinstance(found, Comparison):
            return replace(self, check=found if self.compare else None)
        # One that was chosen before anything was explained was brought back by an undo.
        return replace(self, explained=found, candidate=None if self.explained else self.candidate)

    def chosen(self) -> MapViewState:
        """Leave out what was found out."""
        return replace(self, check=None, explained=None)

    def elsewhere(self) -> MapViewState:
        """Another scene is shown: in the same way, and nothing is known of it."""
        return MapViewState(self.view, self.handprint, self.compare)

    def another_cell(self) -> MapViewState:
        """Another cell is picked."""
        return replace(self, candidate=None)


class RollChoice(Enum):
    """Which of the two rolls a map shows; the value is what the page calls it."""

    EITHER = "either"
    ZERO = "0°"
    HALF_TURN = "180°"

    def rolls(self, m: FeasibilityMap) -> np.ndarray:
        """Return the index (H, A) of the roll that is shown: what got furthest, with most clearance."""
        if self is RollChoice.EITHER:
            return (m.reason + np.nan_to_num(m.clearance)).argmax(axis=0)
        return np.full(m.reason.shape[1:], 0 if self is RollChoice.ZERO else 1)

    def reason(self, m: FeasibilityMap) -> np.ndarray:
        """Return the reasons (H, A) that are shown."""
        return self.of(m, m.reason)

    def values(self, m: FeasibilityMap, view: ColorBy) -> np.ndarray:
        """Return the values (H, A) of a view that are shown, in its unit."""
        return self.of(m, m.values(view))

    def of(self, m: FeasibilityMap, cells: np.ndarray) -> np.ndarray:
        """Return what is shown (H, A) of cells (R, H, A) of both rolls."""
        return np.take_along_axis(cells, self.rolls(m)[None], axis=0)[0]

    def roll(self, m: FeasibilityMap, row: int, column: int) -> int:
        """Return the index of the roll that is shown at a cell."""
        return int(self.rolls(m)[row, column])
