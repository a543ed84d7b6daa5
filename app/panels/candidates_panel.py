"""The candidates of the picked cell, one of which is shown."""

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
    """Shows the result of each candidate; the arm, or its ghost, is drawn at the one that is chosen."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self._shown: Explanation | None = None
        self.candidate = gui.add_slider("Candidate", 1, 2, 1, 1, visible=False, hint="The best is the first.")
        self.on(self.candidate, lambda s, v: changes.choose_candidate(s, int(v) - 1), "inputs")
        self.result = self.html()
        self.overview = self.html()

    def show(self, state: State) -> None:
        """Draw the candidates; those of the last cell stay while the next are computed quickly."""
        if state.busy and not state.is_waiting and isinstance(state.missing_request, ExplainRequest):
            return
        explanation = state.explanation
        self.overview.show(candidates_html(state))
        self.result.show(candidate_html(state))
        self.candidate.visible = explanation is not None and len(explanation.candidates) > 1
        if explanation and self.candidate.visible and explanation is not self._shown:
            self.candidate.max = len(explanation.candidates)
            self.write_inputs(state)
        self._shown = explanation

    def write_inputs(self, state: State) -> None:
        """Set the slider to the candidate that is shown."""
        if state.candidate is not None:
            self.candidate.value = state.candidate + 1
