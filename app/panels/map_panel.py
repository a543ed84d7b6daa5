"""The unwrapped map with axes and legend, the profile beside it, and the recomputed map to compare."""

from __future__ import annotations

import viser

from ..html.map import legend_html, map_html, prints_html
from ..html.profile import holds_html, profile_html, symmetry_html
from ..html.readout import comparison_html, solution_html, title_html
from ..render.marks import marks_of
from ..render.prints import print_names, shown_prints
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["MapPanel"]

HEIGHT = 230
"""Height (px) of the map's picture."""

HEIGHT_OF_TWO = 140
"""Height (px) of each picture where two maps are compared."""


class MapPanel(Panel):
    """Shows the map of the chosen task and arm over the object as it is turned."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.title = self.html('<div class="sg sg-title">Loading …</div>')
        self.map = self.html()
        self.comparison = self.html()
        self.legend = self.html()
        self.plan = self.html()
        self.holds = self.html()

    def show(self, state: State) -> None:
        """Draw the map, and below it the recomputed one if they are compared."""
        self.title.show(title_html(state))
        self.plan.show(solution_html(state) if state.shown_task else "")
        self.holds.show(holds_html(state) + symmetry_html(state))
        if state.map is None:
            self.map.show('<div class="sg sg-faint">The map is being computed …</div>')
            self.comparison.show("")
            self.legend.show("")
            return
        map_view = state.map_view
        height = HEIGHT_OF_TWO if map_view.compare else HEIGHT
        prints, legend = shown_prints(state), legend_html(state.map, map_view.roll, map_view.color_by)
        if prints:
            legend += prints_html(print_names(state), prints)
        shown = map_html(
            state.map, map_view.roll, marks_of(state), prints,
            color_by=map_view.color_by, stale=not state.is_fresh, height=height,
        )  # fmt: skip
        self.map.show(f'<div class="sg-side">{shown}{profile_html(state, height)}</div>')
        self.legend.show(legend)
        self.comparison.show(self._comparison(state) if map_view.compare else "")

    def _comparison(self, state: State) -> str:
        """Draw the map that was computed from scratch, and say how many cells differ."""
        comparison = state.map_view.comparison
        if comparison is None:
            return comparison_html(state)
        shown = map_html(
            comparison.map,
            state.map_view.roll,
            color_by=state.map_view.color_by,
            height=HEIGHT_OF_TWO,
            name="recomputed map",
        )
        profile = profile_html(state, HEIGHT_OF_TWO)
        return f'{comparison_html(state)}<div class="sg-side">{shown}{profile}</div>'
