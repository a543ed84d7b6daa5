"""The picked grasp: its position on the map, and how the arm holds the object or why it cannot."""

from __future__ import annotations

import numpy as np
import viser

from ..html.readout import grasp_html
from ..state import changes
from ..state.map_view_state import RollChoice
from ..state.state import Pick, State
from .actions import Actions
from .panel import Panel

__all__ = ["GraspPanel"]


class GraspPanel(Panel):
    """Picks a grasp by its height, angle and roll, and describes its result."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.h = gui.add_number("h (cm)", 0.0, step=0.1)
        self.theta = gui.add_number("θ (°)", 0.0, min=-180.0, max=180.0, step=0.1)
        self.on(self.h, lambda s, v: changes.choose(s, v / 100, _shown(s).theta), "inputs")
        self.on(self.theta, lambda s, v: changes.choose(s, _shown(s).h, np.deg2rad(v)), "inputs")
        self.roll = self.dropdown("Roll", [roll.value for roll in RollChoice])
        self.on(self.roll, lambda s, v: changes.choose_roll(s, RollChoice(v)))
        self.button("Let go", viser.Icon.HAND_OFF, lambda: actions.change(changes.clear_pick), color="gray")
        self.grasp = self.html()

    def show(self, state: State) -> None:
        """Describe the result of the grasp."""
        profile = state.scene.profile
        self.h.min, self.h.max = 100 * profile.h_min, 100 * profile.h_max
        self.grasp.show(grasp_html(state))

    def write_inputs(self, state: State) -> None:
        """Set height, angle and roll."""
        pick = _shown(state)
        self.h.value = round(100 * pick.h, 2)
        self.theta.value = round(float(np.rad2deg(pick.theta)), 2)
        self.roll.value = state.map_view.roll.value


def _shown(state: State) -> Pick:
    """Return the pick that the inputs show; read from the state, as the inputs may be out of date."""
    return state.pick or Pick(state.scene.profile.h_min, 0.0)
