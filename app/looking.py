"""How the map is looked at, and what was found out about it for that: the recomputed map, the candidates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.asking import Check, CheckRequest, Explained, ExplainRequest, Request
from app.values import MapRequest
from symgrasp.feasibility import Cell
from symgrasp.views import View

__all__ = ["Looking"]


@dataclass(frozen=True)
class Looking:
    """What of the map is shown.

    Attributes:
        view: what its colours stand for.
        handprint: whether the picked grasp's print lies on it.
        compare: whether the map is computed from scratch as well, to compare it with the shifted one.
        check: the newest of those.
        explained: the candidates of the cell that was picked last.
        candidate: index of the one that is shown; None for the one that decides the cell.
    """

    view: View = View.REASON
    handprint: bool = False
    compare: bool = False
    check: Check | None = None
    explained: Explained | None = None
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
        check = CheckRequest(request, delta)
        if self.compare and (self.check is None or self.check.request != check):
            return check
        if cell is not None:
            explain = ExplainRequest(request, cell)
            if self.explained is None or self.explained.request != explain:
                return explain
        return None

    def choose_compare(self, compare: bool) -> Looking:
        """Compare with a recomputed map, or no more."""
        return replace(self, compare=compare, check=self.check if compare else None)

    def choose_candidate(self, candidate: int) -> Looking:
        """Show a candidate, by its index among the explained ones; the best is the first."""
        count = len(self.explained.explanation.verdicts) if self.explained else 0
        return replace(self, candidate=int(np.clip(candidate, 0, count - 1)) if count else None)

    def take(self, found: Check | Explained) -> Looking:
        """Take what was found out."""
        if isinstance(found, Check):
            return replace(self, check=found if self.compare else None)
        # One that was chosen before anything was explained was brought back by an undo.
        return replace(self, explained=found, candidate=None if self.explained else self.candidate)

    def chosen(self) -> Looking:
        """Leave out what was found out."""
        return replace(self, check=None, explained=None)

    def elsewhere(self) -> Looking:
        """Another scene is shown: in the same way, and nothing is known of it."""
        return Looking(self.view, self.handprint, self.compare)

    def another_cell(self) -> Looking:
        """Another cell is picked."""
        return replace(self, candidate=None)
