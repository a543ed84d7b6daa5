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
        self._background: deque[Place] = deque()
        self._running = 0
        self._in_background = 0

    def _line_of(self, place: Place) -> deque[Place]:
        return self._background if place.background else self._line

    def _join(self, place: Place) -> None:
        with self._changed:
            place._wanted = True
            line = self._line_of(place)
            if place not in line:
                line.append(place)

    def _admit(self, place: Place) -> bool:
        """Wait for a moment; return whether it is this place's turn, which begins then."""

        line = self._line_of(place)

        def is_next() -> bool:
            if place.background and (self._in_background or self._is_needed):
                return False
            if self._running == self._count:
                return False
            while not line[0]._wanted:
                line.popleft()
            return line[0] is place

        with self._changed:
            if not self._changed.wait_for(is_next, POLL_INTERVAL):
                return False
            line.popleft()
            if place.background:
                self._in_background, place.cores = 1, self._count
            else:
                self._running += 1
                place.cores = max(1, self._count // self._running)
            self._changed.notify_all()
            return True

    def _abandon(self, place: Place) -> None:
        with self._changed:
            place._wanted = False
            self._changed.notify_all()

    def _leave(self, place: Place) -> None:
        with self._changed:
            if place.background:
                self._in_background = 0
            else:
                self._running -= 1
            self._changed.notify_all()

    @property
    def _is_needed(self) -> bool:
        """Whether anybody computes, or waits to, who goes before what runs in the background."""
        return self._running > 0 or any(place._wanted for place in self._line)

    def _is_over(self, place: Place) -> bool:
        with self._changed:
            if place.background and self._is_needed:
                return True
            is_awaited = any(other._wanted for other in self._line_of(place))
            return is_awaited and time.monotonic() - place._since > SLICE


class Place:
    """The place in the line of one who computes one thing after another; used by one thread.

    If the waiting for a turn is broken off, the next turn is waited for at the same place, unless its turn
    has come meanwhile: whoever always wants something newer gets a turn all the same.

    Args:
        turns: the line.
        background: whether to compute only while nobody else does, and to make room for others at once.

    Attributes:
        background: as given.
        cores: how many cores may be used during the turn.
    """

    def __init__(self, turns: Turns, *, background: bool = False) -> None:
        self._turns, self.background = turns, background
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
        """Whether the turn has lasted for `SLICE` and somebody waits, or others go first anyway."""
        return self._turns._is_over(self)

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
            self._turns._leave(self)
