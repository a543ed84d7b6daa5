"""What waits between a browser and viser: at what rate messages pass, and which replace earlier ones."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Generic, TypeVar

__all__ = ["Inbox", "TokenBucket"]

T = TypeVar("T")


class TokenBucket:
    """Limits a rate: tokens flow in steadily, and whoever takes more than there are has to wait.

    Args:
        rate: tokens per second.
        burst: most tokens that are saved up.
        clock: returns the time (s).
    """

    def __init__(self, rate: float, burst: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._burst, self._clock = rate, burst, clock
        self._level, self._since = burst, clock()

    def take(self, tokens: float = 1.0) -> float:
        """Take tokens, and return the time (s) to wait for those that were not there."""
        now = self._clock()
        self._level = min(self._burst, self._level + self._rate * (now - self._since)) - tokens
        self._since = now
        return max(0.0, -self._level / self._rate)


class Inbox(Generic[T]):
    """Messages in the order they came, where a newer value takes the place of an older one.

    A message with a key replaces an earlier one with that key, unless a message without a key, an event,
    stands between them: the event may be about the earlier value.

    Attributes:
        replaced: how many messages were replaced so far.
    """

    def __init__(self) -> None:
        self._messages: dict[object, T] = {}
        self._since_event: dict[str, object] = {}
        self.replaced = 0

    def __len__(self) -> int:
        return len(self._messages)

    def put(self, message: T, key: str | None = None) -> None:
        """Add a message; without a key it is an event."""
        place = object()
        if key is None:
            self._since_event.clear()
        else:
            earlier = self._since_event.get(key)
            if earlier is not None and self._messages.pop(earlier, None) is not None:
                self.replaced += 1
            self._since_event[key] = place
        self._messages[place] = message

    def take(self) -> T:
        """Remove and return the oldest message.

        Raises:
            KeyError: there is none.
        """
        try:
            place = next(iter(self._messages))
        except StopIteration:
            raise KeyError("the inbox is empty") from None
        return self._messages.pop(place)
