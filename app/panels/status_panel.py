"""The computation under way with its cancel button, undo and redo, and notes about problems."""

from __future__ import annotations

import viser

from ..html.readout import notes_html, status_html
from ..state.state import State
from ..state.undo import redo, undo
from .actions import Actions
from .panel import Panel

__all__ = ["NotesPanel", "StatusPanel"]


UNDO, REDO = "Undo", "Redo"


class StatusPanel(Panel):
    """Shows the computation under way; its height is constant, so that sliders below do not move."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.status = self.html('<div class="sg">Loading the scene …</div>')
        self.progress = gui.add_progress_bar(0.0)
        self.stop = self.button("Cancel", viser.Icon.X, actions.stop_or_retry, color="gray", disabled=True)
        self.steps = gui.add_button_group("", (UNDO, REDO), hint="Also Ctrl+Z and Ctrl+Shift+Z")

        @self.steps.on_click
        async def _(_: object) -> None:  # at once, while the value is that of this click
            actions.change(undo if self.steps.value == UNDO else redo)

    def show(self, state: State) -> None:
        """Show what is being computed, and whether it can be cancelled or restarted."""
        self.status.show(status_html(state))
        self.progress.value = 100 * state.busy.share if state.busy and state.is_waiting else 0.0
        again = "Restart" if state.problem else "Go on" if state.is_current else "Compute the map"
        self.stop.label = again if state.is_stopped else "Cancel"
        self.stop.icon = viser.Icon.REFRESH if state.is_stopped else viser.Icon.X
        self.stop.disabled = not state.is_waiting and not state.is_stopped


class NotesPanel(Panel):
    """Shows the last problem and the obstacles the object is inside of; every tab has one."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.notes = self.html()

    def show(self, state: State) -> None:
        """Show the notes."""
        self.notes.show(notes_html(state))
