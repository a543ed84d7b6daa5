"""The interface of a session that its actions use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from symgrasp.progress import Progress

from ...state.state import State

__all__ = ["SessionApi"]


class SessionApi(Protocol):
    """A browser's session, as far as its actions use it."""

    @property
    def state(self) -> State | None:
        """What is shown; None before the first scene is loaded."""
        ...

    def change(self, change: Callable[[State], State], origin: str = "") -> None:
        """Apply a change to the state.

        Args:
            change: returns the new state, or raises an exception, which is shown.
            origin: what changed it: widgets of that origin are not written back.
        """

    def attempt(self, action: Callable[[State], None]) -> None:
        """Run an action that leaves the state as it is; ignored before the first scene is loaded.

        Args:
            action: does it with the state that is shown, or raises an exception, which is shown.
        """

    def submit(self, label: str, run: Callable[[Progress], Any], show: Callable[[State, Any], State]) -> None:
        """Run a job in place of the one under way; ignored before the first scene is loaded.

        Args:
            label: what is computed, for the page.
            run: computes, on the thread of the queue.
            show: returns the state with the result; not called if another job has replaced this one.
        """

    def send(self, name: str, content: bytes) -> None:
        """Send a file to the browser."""
