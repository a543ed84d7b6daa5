"""The unwrapped map with its axes and legend, the profile beside it, and what went wrong."""

from __future__ import annotations

import viser

from app.map_view import Mark, legend_html, map_html, prints_html
from app.panels.panel import Actions, Panel
from app.prints import shown_prints
from app.profile_view import holds_html, profile_html, symmetry_html
from app.readout import map_title
from app.state import State

__all__ = ["MapPanel"]


class MapPanel(Panel):
    """Shows the map of the chosen task and arm over the object as it is turned."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.title = self.html('<div class="sg sg-title">Loading …</div>')
        self.map = self.html()
        self.legend = self.html()
        self.holds = self.html()

    def show(self, state: State) -> None:
        """Draw the map."""
        self.title.show(map_title(state))
        self.holds.show(holds_html(state) + symmetry_html(state))
        if state.map is None:
            self.map.show('<div class="sg sg-faint">The map is being computed …</div>')
            self.legend.show("")
            return
        marks = [Mark(state.pick.h, state.pick.theta)] if state.pick else []
        prints, legend = shown_prints(state), legend_html(state.map, state.roll)
        if prints and state.shown:
            legend += prints_html(state.shown, prints)
            marks = [Mark(h.grasp.h, h.grasp.theta, h.arm) for h in state.shown.holds]
        shown = map_html(state.map, state.roll, marks, prints, stale=not state.is_fresh)
        self.map.show(f'<div class="sg-side">{shown}{profile_html(state)}</div>')
        self.legend.show(legend)
