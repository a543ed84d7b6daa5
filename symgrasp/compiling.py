"""Compiled code: it is made on first use and kept on disk, so only the first run on a machine waits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event

__all__ = ["COMPILING", "telling_of_compiling"]

COMPILING = "compiling what this needs, once on this machine; it takes up to a minute"
"""What to tell people meanwhile."""


class _Once(event.Listener):
    """Calls a function when something is compiled for the first time."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell, self._told = tell, False

    def on_start(self, event: event.Event) -> None:
        if not self._told:
            self._told = True
            self._tell()

    def on_end(self, event: event.Event) -> None:
        """There may be more to compile."""


@contextmanager
def telling_of_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call a function once if something has to be compiled inside the ``with`` block.

    What was compiled in an earlier run and is read from the disk does not count.
    """
    with event.install_listener("numba:compile", _Once(tell)):
        yield
