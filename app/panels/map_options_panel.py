"""Options of the map: its colours, the handprint, the comparison; and the map as a picture file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import viser

from symgrasp.feasibility.color_by import ColorBy

from ..render.map_picture import FORMATS
from ..state.map_view_state import NOISE
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["MapOptionsPanel"]

MOST_OFF, MOST_TILTED = 100.0, 45.0
"""Most (mm, °) that the object's pose can be said to be uncertain by."""


class MapOptionsPanel(Panel):
    """Chooses what the map shows and saves its picture."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.color_by = self.dropdown("Colours show", tuple(ColorBy))
        self.on(self.color_by, lambda s, v: replace(s, map_view=replace(s.map_view, color_by=ColorBy(v))))
        self.off = gui.add_number(
            "Off by (mm)", 1e3 * NOISE.position, min=0.0, max=MOST_OFF, step=0.5, visible=False,
            hint="Standard deviation of each coordinate of the object's position",
        )  # fmt: skip
        self.on(self.off, lambda s, v: _uncertain(s, position=v / 1e3), "inputs")
        self.tilted = gui.add_number(
            "Tilted by (°)", np.rad2deg(NOISE.tilt).item(), min=0.0, max=MOST_TILTED, step=0.5, visible=False,
            hint="Standard deviation of the object's rotations about the world's x and y",
        )  # fmt: skip
        self.on(self.tilted, lambda s, v: _uncertain(s, tilt=np.deg2rad(v).item()), "inputs")
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

    def show(self, state: State) -> None:
        """Ask how uncertain the pose is where the colours show probabilities."""
        self.off.visible = self.tilted.visible = state.map_view.color_by is ColorBy.PROBABILITY

    def write_inputs(self, state: State) -> None:
        """Set the options."""
        self.off.value = round(1e3 * state.map_view.noise.position, 3)
        self.tilted.value = round(np.rad2deg(state.map_view.noise.tilt).item(), 3)
        self.color_by.value = state.map_view.color_by
        self.handprint.value = state.map_view.handprint
        self.rolls_apart.value = state.map_view.rolls_apart
        self.patterns.value = state.map_view.patterns
        self.compare.value = state.map_view.compare


def _uncertain(state: State, **changes: float) -> State:
    """Say how uncertain the object's pose is, see `PoseNoise`."""
    noise = replace(state.map_view.noise, **changes)
    return replace(state, map_view=replace(state.map_view, noise=noise))
