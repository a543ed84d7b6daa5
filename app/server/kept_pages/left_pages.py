"""What pages showed whose sessions have ended, so that they show it again when they come back."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass

from ...state.page_link import Camera
from ...state.state import State

__all__ = ["LeftPage", "LeftPages"]

MOST = 8
"""How many of them are kept, the latest ones; a state may refer to maps, plans and uploads of some 50 MB."""


@dataclass(frozen=True, eq=False)
class LeftPage:
    """What a page showed last.

    Attributes:
        state: the state of its session.
        camera: where it was looked at from; None where it was never drawn.
    """

    state: State
    camera: Camera | None = None


class LeftPages:
    """Those of a server, by the tokens of the pages; its methods may be called from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pages: OrderedDict[str, LeftPage] = OrderedDict()

    def keep(self, token: str, page: LeftPage) -> None:
        """Keep what a page showed, in place of what it showed earlier."""
        with self._lock:
            self._pages[token] = page
            self._pages.move_to_end(token)
            while len(self._pages) > MOST:
                self._pages.popitem(last=False)

    def find(self, token: str) -> LeftPage | None:
        """Return what a page showed; None where it is unknown."""
        with self._lock:
            return self._pages.get(token)

    def all(self) -> dict[str, LeftPage]:
        """Return what all of them showed, by their tokens."""
        with self._lock:
            return dict(self._pages)
