"""The candidates of the picked cell, one of which is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import viser

from symgrasp.feasibility.explain import Explanation

from ..html.candidates import candidate_html, candidates_html
from ..state import changes
from ..state.requests import ExplainRequest
from ..state.state import State
from .actions import Actions
from .panel import Panel, slider_value

__all__ = ["CandidatesPanel"]


class CandidatesPanel(Panel):
    """Shows the result of each candidate; the arm, or its ghost, is drawn at the one that is chosen.

    From one that is feasible, the elbow of an arm of seven joints may be moved while the hand stays.
    """

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self._shown: Explanation | None = None
        self.candidate = gui.add_slider("Candidate", 1, 2, 1, 1, visible=False, hint="The best is the first.")
        self.on(self.candidate, lambda s, v: changes.choose_candidate(s, int(v) - 1), "inputs")
        self.moves_elbow = gui.add_checkbox(
            "Move the elbow", False, visible=False, hint="As far as nothing is hit, while the hand stays."
        )
        self.on(self.moves_elbow, lambda s, v: replace(s, map_view=replace(s.map_view, moves_elbow=v)))
        self.elbow = gui.add_slider(
            "Elbow φ (°)", 0.0, 1.0, 0.1, 0.0, visible=False, hint="The redundancy of the arm."
        )
        self.on(self.elbow, lambda s, v: changes.move_elbow(s, np.deg2rad(v).item()), "inputs")
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
        self.moves_elbow.visible = state.has_elbow and state.pick is not None
        motion = state.elbow_motion
        self.elbow.visible = motion is not None
        if motion is not None:
            ends = round(float(np.rad2deg(motion.phi[0])), 1), round(float(np.rad2deg(motion.phi[-1])), 1)
            if ends != (self.elbow.min, self.elbow.max):
                self.elbow.min, self.elbow.max = ends
                self.write_inputs(state)

    def write_inputs(self, state: State) -> None:
        """Set the slider to the candidate that is shown."""
        if state.candidate is not None:
            self.candidate.value = state.candidate + 1
        self.moves_elbow.value = state.map_view.moves_elbow
        if state.elbow_motion and state.shown_candidate:
            phi = state.shown_candidate.phi if state.elbow is None else state.elbow
            self.elbow.value = slider_value(self.elbow, np.rad2deg(phi).item())
