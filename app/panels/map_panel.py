"""What belongs to the map on the page: the heights that hands fit, the recomputed map to compare."""

from __future__ import annotations

import viser

from ..html.map import map_html
from ..html.profile import holds_html, symmetry_html
from ..html.readout import comparison_html, solution_html
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["MapPanel"]

HEIGHT = 140
"""Height (px) of the recomputed map's picture."""


class MapPanel(Panel):
    """Says more of the map of the chosen task and arm; the map itself is an element of the page around."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.comparison = self.html()
        self.plan = self.html()
        self.holds = self.html()

    def show(self, state: State) -> None:
        """Describe the map, and draw the recomputed one if they are compared."""
        self.plan.show(solution_html(state) if state.shown_task else "")
        self.holds.show(holds_html(state) + symmetry_html(state))
        self.comparison.show(self._comparison(state) if state.map and state.map_view.compare else "")

    def _comparison(self, state: State) -> str:
        """Draw the map that was computed from scratch, and say how many cells differ."""
        comparison = state.map_view.comparison
        if comparison is None:
            return comparison_html(state)
        shown = map_html(
            comparison.map,
            state.map_view.roll,
            color_by=state.map_view.color_by,
            height=HEIGHT,
            name="recomputed map",
        )
        return comparison_html(state) + shown
