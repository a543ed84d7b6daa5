"""Options of the map: its colours, the handprint, the comparison; and the map as a picture file."""

from __future__ import annotations

from dataclasses import replace

import viser

from symgrasp.feasibility.color_by import ColorBy

from ..render.map_picture import FORMATS
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["MapOptionsPanel"]


class MapOptionsPanel(Panel):
    """Chooses what the map shows and saves its picture."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.color_by = self.dropdown("Colours show", tuple(ColorBy))
        self.on(self.color_by, lambda s, v: replace(s, map_view=replace(s.map_view, color_by=ColorBy(v))))
        self.handprint = gui.add_checkbox(
            "Handprint", False, hint="The cells under the hand of the picked grasp."
        )
        self.on(self.handprint, lambda s, v: replace(s, map_view=replace(s.map_view, handprint=v)))
        self.rolls_apart = gui.add_checkbox(
            "Rolls side by side", False, hint="Also show a map of each of the two rolls of the hand."
        )
        self.on(self.rolls_apart, lambda s, v: replace(s, map_view=replace(s.map_view, rolls_apart=v)))
        self.patterns = gui.add_checkbox(
            "Patterns", False, hint="Tell the colours of the map apart by patterns as well."
        )
        self.on(self.patterns, lambda s, v: replace(s, map_view=replace(s.map_view, patterns=v)))
        self.compare = gui.add_checkbox(
            "Compare", False,
            hint="Also compute the map of the turned object from scratch, and count the cells that differ.",
        )  # fmt: skip
        self.on(self.compare, lambda s, v: replace(s, map_view=s.map_view.with_compare(v)))
        self.save = gui.add_button_group("Save map as", tuple(FORMATS))
        self.save.on_click(lambda _: actions.save_map(self.save.value))

    def write_inputs(self, state: State) -> None:
        """Set the options."""
        self.color_by.value = state.map_view.color_by
        self.handprint.value = state.map_view.handprint
        self.rolls_apart.value = state.map_view.rolls_apart
        self.patterns.value = state.map_view.patterns
        self.compare.value = state.map_view.compare
