"""The candidates of the picked cell, to be stepped through."""

from __future__ import annotations

import viser

from symgrasp.feasibility.explain import Explanation

from ..html.candidates import candidate_html, candidates_html
from ..state import changes
from ..state.requests import ExplainRequest
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["CandidatesPanel"]


class CandidatesPanel(Panel):
    """Shows what becomes of each candidate; the arm, or its ghost, takes the one that is chosen."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self._shown: Explanation | None = None
        self.step = gui.add_slider("Candidate", 1, 2, 1, 1, visible=False, hint="The best is the first.")
        self.on(self.step, lambda s, v: changes.choose_candidate(s, int(v) - 1), "inputs")
        self.one = self.html()
        self.all = self.html()

    def show(self, state: State) -> None:
        """Draw them; while the next ones come in a moment, those before stay."""
        if state.busy and not state.is_waiting and isinstance(state.missing_request, ExplainRequest):
            return
        found = state.explanation
        self.all.show(candidates_html(state))
        self.one.show(candidate_html(state))
        self.step.visible = found is not None and len(found.candidates) > 1
        if found and self.step.visible and found is not self._shown:
            self.step.max = len(found.candidates)
            self.write_inputs(state)
        self._shown = found

    def write_inputs(self, state: State) -> None:
        """Show which candidate it is."""
        if state.candidate is not None:
            self.step.value = state.candidate + 1
