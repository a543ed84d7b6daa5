"""Clicks on parts of a piece of HTML, of which viser tells the server nothing."""

from __future__ import annotations

from collections.abc import Callable

import viser

__all__ = ["ClickTargets"]


class ClickTargets:
    """Buttons out of sight that are pressed where labels in a piece of HTML are clicked.

    A browser hands a click on ``<label for="id">`` on to the element of that id, which is a button of viser.

    Args:
        gui: where to add them.
        folder: the folder to add them to; `style.css` hides what comes after the list in it.
        action: called with the key of a button that is pressed.
    """

    def __init__(
        self, gui: viser.GuiApi, folder: viser.GuiFolderHandle, action: Callable[[str], None]
    ) -> None:
        self._gui, self._folder, self._action = gui, folder, action
        self._buttons: dict[str, viser.GuiButtonHandle] = {}

    def id(self, key: str) -> str:
        """Return the id of the button with a key, which is added when it is first asked for."""
        if key not in self._buttons:
            with self._folder:
                button = self._gui.add_button(key or "#")
            button.on_click(lambda _: self._action(key))
            self._buttons[key] = button
        return self._buttons[key]._impl.uuid  # viser has no public name for it
