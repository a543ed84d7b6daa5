"""Who may compute at the moment: as many processes as there are cores, each for a while in turn."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from symgrasp.engine.threads import CORES

__all__ = ["Place", "Turns"]

SLICE = 1.0
"""Time (s) after which a computation makes room for one that waits."""

POLL_INTERVAL = 0.05
"""Longest time (s) between two calls of what a computation does while it waits."""


class Turns:
    """A line in which computations wait for their turn, first come, first served; thread-safe.

    Args:
        count: how many may compute at the same time.
    """

    def __init__(self, count: int = CORES) -> None:
        self._count = count
        self._changed = threading.Condition()
        self._line: deque[Place] = deque()
        self._running = 0

    def _join(self, place: Place) -> None:
        with self._changed:
            place._wanted = True
            if place not in self._line:
                self._line.append(place)

    def _admit(self, place: Place) -> bool:
        """Wait for a moment; return whether it is this place's turn, which begins then."""

        def is_next() -> bool:
            if self._running == self._count:
                return False
            while not self._line[0]._wanted:
                self._line.popleft()
            return self._line[0] is place

        with self._changed:
            if not self._changed.wait_for(is_next, POLL_INTERVAL):
                return False
            self._line.popleft()
            self._running += 1
            place.cores = max(1, self._count // self._running)
            self._changed.notify_all()
            return True

    def _abandon(self, place: Place) -> None:
        with self._changed:
            place._wanted = False
            self._changed.notify_all()

    def _leave(self) -> None:
        with self._changed:
            self._running -= 1
            self._changed.notify_all()

    @property
    def _is_awaited(self) -> bool:
        with self._changed:
            return any(place._wanted for place in self._line)


class Place:
    """The place in the line of one who computes one thing after another; used by one thread.

    If the waiting for a turn is broken off, the next turn is waited for at the same place, unless its turn
    has come meanwhile: whoever always wants something newer gets a turn all the same.

    Args:
        turns: the line.

    Attributes:
        cores: how many cores may be used during the turn.
    """

    def __init__(self, turns: Turns) -> None:
        self._turns = turns
        self._wanted = self._held = False
        self._since = 0.0
        self.cores = 0

    @contextmanager
    def turn(self, waiting: Callable[[], None]) -> Iterator[None]:
        """Wait for a turn, which lasts as long as the ``with`` block.

        Args:
            waiting: called again and again meanwhile; what it raises ends the waiting.
        """
        self._begin(waiting)
        try:
            yield
        finally:
            self._end()

    @property
    def is_over(self) -> bool:
        """Whether the turn has lasted for `SLICE` and somebody waits."""
        return time.monotonic() - self._since > SLICE and self._turns._is_awaited

    def renew(self, waiting: Callable[[], None]) -> None:
        """Let others go first, and wait for the rest of the turn; see `turn`."""
        self._end()
        self._begin(waiting)

    def _begin(self, waiting: Callable[[], None]) -> None:
        self._turns._join(self)
        try:
            while not self._turns._admit(self):
                waiting()
        except BaseException:
            self._turns._abandon(self)
            raise
        self._held, self._since = True, time.monotonic()

    def _end(self) -> None:
        if self._held:
            self._held = False
            self._turns._leave()
