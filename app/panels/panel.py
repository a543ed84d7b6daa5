"""What all panels have in common: how widgets change the state, and how they are brought up to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import viser

from ..state.state import State
from .actions import Actions

__all__ = ["Html", "Panel", "within"]

Hotkey = Any
"""A letter, a digit or the name of a key; None for none. viser does not export the type."""
Modifier = Literal["cmd/ctrl", "shift", "cmd/ctrl+shift"] | None


class Html:
    """A piece of HTML that is only sent when it changes."""

    def __init__(self, gui: viser.GuiApi, content: str = "") -> None:
        self._handle, self._content = gui.add_html(content), content

    def show(self, content: str) -> None:
        """Show this from now on."""
        if content != self._content:
            self._content = self._handle.content = content


class Panel:
    """Some widgets of one browser; made where they are to appear.

    Args:
        gui: where to add them.
        actions: what they do.
    """

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        self.gui, self.actions = gui, actions

    def show(self, state: State) -> None:
        """Bring what is only seen up to the state."""

    def write_inputs(self, state: State) -> None:
        """Bring what a person can change up to the state; not while a person is changing it."""

    def html(self, content: str = "") -> Html:
        """Add HTML."""
        return Html(self.gui, content)

    def button(
        self, label: str, icon: viser.IconName, do: Callable[[], None], **look: Any
    ) -> viser.GuiButtonHandle:
        """Add a button and say what it does."""
        button = self.gui.add_button(label, icon=icon, **look)
        button.on_click(lambda _: do())
        return button

    def command(
        self, label: str, do: Callable[[], None], hotkey: Hotkey = None, modifier: Modifier = None
    ) -> viser.CommandHandle:
        """Add a command to the palette (Ctrl+K), and a key that does it.

        The 3D view flies on W, A, S, D, Q, E and the arrows: those keys are taken.
        """
        command = self.gui.add_command(label, hotkey=hotkey, modifier=modifier)
        command.on_trigger(lambda _: do())
        return command

    def choice(
        self, label: str, options: Sequence[str] = ("…",), **look: Any
    ) -> viser.GuiDropdownHandle[str]:
        """Add a dropdown; its options may be known later."""
        return self.gui.add_dropdown(label, options, **look)

    def on(self, widget: Any, change: Callable[[State, Any], State], origin: str = "") -> None:
        """Let a widget change the state; what the page itself writes into it does not count.

        Widgets that a person drags or types in have the origin "inputs": they are not written back
        meanwhile.
        """

        # On the event loop, at once: in a thread of a pool the value might have been written over
        # meanwhile, and callbacks overtake each other. A change of the state takes no time.
        @widget.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                value = widget.value
                self.actions.change(lambda state: change(state, value), origin)

    def on_choice(self, widget: Any, do: Callable[[str], None]) -> None:
        """Say what a choice of a person does."""

        @widget.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                do(widget.value)


def within(slider: viser.GuiSliderHandle[float], value: float) -> float:
    """Return a value as a slider can show it."""
    return float(np.clip(round(value / slider.step) * slider.step, slider.min, slider.max))
