"""Who may compute at the moment: as many processes as there are cores, each for a while in turn."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

import numba

__all__ = ["Turn", "Turns"]

SLICE = 1.0
"""Time (s) after which a computation makes room for one that waits."""

POLL_INTERVAL = 0.05
"""Longest time (s) between two calls of what a computation does while it waits."""


class Turns:
    """A line in which computations wait for their turn, first come, first served; thread-safe.

    Args:
        count: how many may compute at the same time.
    """

    def __init__(self, count: int = numba.config.NUMBA_NUM_THREADS) -> None:
        self._count = count
        self._changed = threading.Condition()
        self._line: deque[object] = deque()
        self._running = 0

    def take(self, waiting: Callable[[], None]) -> Turn:
        """Wait for a turn and return it; to be used in a ``with`` statement, which ends it.

        Args:
            waiting: called again and again meanwhile; what it raises ends the waiting.
        """
        turn = Turn(self)
        turn._begin(waiting)
        return turn

    def _enter(self, waiting: Callable[[], None]) -> int:
        """Wait; return how many cores the turn may use."""
        me = object()
        with self._changed:
            self._line.append(me)
        try:
            while not (cores := self._admitted(me)):
                waiting()
        except BaseException:
            with self._changed:
                self._line.remove(me)
                self._changed.notify_all()
            raise
        return cores

    def _admitted(self, me: object) -> int:
        def is_next() -> bool:
            return self._line[0] is me and self._running < self._count

        with self._changed:
            if not self._changed.wait_for(is_next, POLL_INTERVAL):
                return 0
            self._line.popleft()
            self._running += 1
            self._changed.notify_all()
            return max(1, self._count // self._running)

    def _leave(self) -> None:
        with self._changed:
            self._running -= 1
            self._changed.notify_all()

    @property
    def _is_awaited(self) -> bool:
        return bool(self._line)


class Turn:
    """The right to compute, for a while; used by one thread.

    Attributes:
        cores: how many cores it may use.
    """

    def __init__(self, turns: Turns) -> None:
        self._turns = turns
        self._held = False
        self._since = 0.0
        self.cores = 0

    def __enter__(self) -> Turn:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    @property
    def is_over(self) -> bool:
        """Whether it has lasted for `SLICE` and somebody waits."""
        return time.monotonic() - self._since > SLICE and self._turns._is_awaited

    def renew(self, waiting: Callable[[], None]) -> None:
        """End the turn and wait for another, at the end of the line; see `Turns.take`."""
        self._end()
        self._begin(waiting)

    def _begin(self, waiting: Callable[[], None]) -> None:
        self.cores = self._turns._enter(waiting)
        self._held, self._since = True, time.monotonic()

    def _end(self) -> None:
        if self._held:
            self._held = False
            self._turns._leave()
