"""The base class of panels: adding widgets, changing the state from them, updating them to a state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import viser

from ..state.state import State
from .actions import Actions

__all__ = ["Html", "Panel", "slider_value"]

Hotkey = Any
"""A letter, a digit or the name of a key; None for none. viser does not export the type."""
Modifier = Literal["cmd/ctrl", "shift", "cmd/ctrl+shift"] | None


class Html:
    """A piece of HTML that is only sent when it changes."""

    def __init__(self, gui: viser.GuiApi, content: str = "") -> None:
        self._handle, self._content = gui.add_html(content), content

    def show(self, content: str) -> None:
        """Replace the content."""
        if content != self._content:
            self._content = self._handle.content = content


class Panel:
    """A group of widgets of one browser; constructed inside the container where they appear.

    Args:
        gui: where to add them.
        actions: what they do.
    """

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        self.gui, self.actions = gui, actions

    def show(self, state: State) -> None:
        """Update the outputs to a state: what a person cannot change."""

    def write_inputs(self, state: State) -> None:
        """Update the inputs to a state; not called while a person is changing one of them."""

    def html(self, content: str = "") -> Html:
        """Add a piece of HTML."""
        return Html(self.gui, content)

    def button(
        self, label: str, icon: viser.IconName, action: Callable[[], None], **options: Any
    ) -> viser.GuiButtonHandle:
        """Add a button that runs an action; further options are those of `viser.GuiApi.add_button`."""
        button = self.gui.add_button(label, icon=icon, **options)
        button.on_click(lambda _: action())
        return button

    def upload_button(
        self, label: str, limit: int, action: Callable[[str, bytes], None], **options: Any
    ) -> viser.GuiUploadButtonHandle:
        """Add a button that runs an action with name and content of a file.

        Args:
            label: on the button.
            limit: largest file (bytes) that is taken; a larger one is refused when it is announced.
            action: what to run.
            options: further ones of `viser.GuiApi.add_upload_button`.
        """
        button = self.gui.add_upload_button(label, icon=viser.Icon.UPLOAD, color="gray", **options)
        button.on_upload(lambda _: action(button.value.name, button.value.content))
        self.actions.limit_uploads(button, limit)
        return button

    def command(
        self, label: str, action: Callable[[], None], hotkey: Hotkey = None, modifier: Modifier = None
    ) -> viser.CommandHandle:
        """Add a command to the palette (Ctrl+K), with a hotkey if given.

        viser's camera already uses W, A, S, D, Q, E and the arrow keys.
        """
        command = self.gui.add_command(label, hotkey=hotkey, modifier=modifier)
        command.on_trigger(lambda _: action())
        return command

    def dropdown(
        self, label: str, options: Sequence[str] = ("…",), **more: Any
    ) -> viser.GuiDropdownHandle[str]:
        """Add a dropdown; its options may be set later. ``more`` goes to `viser.GuiApi.add_dropdown`."""
        return self.gui.add_dropdown(label, options, **more)

    def on(self, widget: Any, change: Callable[[State, Any], State], origin: str = "") -> None:
        """Change the state whenever a person changes a widget; values that the page writes are ignored.

        Args:
            widget: the widget.
            change: returns the new state, from the state and the value of the widget.
            origin: "inputs" for widgets that a person drags or types in: they are not written back
                meanwhile.
        """

        # A coroutine runs on the event loop at once. viser would run a plain function in a thread pool,
        # where callbacks can overtake each other and the value may have been overwritten.
        @widget.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                value = widget.value
                self.actions.change(lambda state: change(state, value), origin)

    def on_select(self, widget: Any, action: Callable[[str], None]) -> None:
        """Run an action with the option whenever a person selects one."""

        @widget.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                action(widget.value)


def slider_value(slider: viser.GuiSliderHandle[float], value: float) -> float:
    """Return a value rounded to a slider's step and clipped to its range."""
    return float(np.clip(round(value / slider.step) * slider.step, slider.min, slider.max))
