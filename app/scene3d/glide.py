"""Arms that go to a grasp that was picked, frame by frame, so that one sees where they go."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symgrasp.poses import Array

__all__ = ["FRAMES", "INTERVAL", "Glide"]

FRAMES = 8
"""Number of frames of a movement."""

INTERVAL = 0.04
"""Time (s) between two of them."""


class Glide:
    """The joint values that robots are shown at, on their way to others.

    A movement has as many frames on a slow machine as on a fast one: it takes longer there.

    Args:
        values: robot name → joint values (n,) at first, in rad or m.

    Attributes:
        values: those that are shown now.
    """

    def __init__(self, values: Mapping[str, Array]) -> None:
        self.values = self._begin = self._end = dict(values)
        self._frame = FRAMES
        self._last = 0.0

    def aim(self, values: Mapping[str, Array], now: float, *, visibly: bool) -> None:
        """Set where the robots are to be; nothing changes where they are on their way there already.

        Args:
            values: robot name → joint values (n,), in rad or m.
            now: the time (s) of a monotonic clock.
            visibly: whether to go there frame by frame; else they are there at once.
        """
        if all(np.array_equal(values[name], end) for name, end in self._end.items()):
            return
        self._begin, self._end = self.values, dict(values)
        self._frame, self._last = (0, now) if visibly else (FRAMES, now)
        if not visibly:
            self.values = self._end

    def wait(self, now: float) -> float | None:
        """Return the time (s) until the next frame is due, None where the robots are where they are to be."""
        return None if self._frame == FRAMES else max(0.0, INTERVAL - (now - self._last))

    def step(self, now: float) -> None:
        """Go on to the next frame, of which there is one."""
        self._frame, self._last = self._frame + 1, now
        if self._frame == FRAMES:
            self.values = self._end
            return
        share = self._frame / FRAMES
        smooth = share * share * (3 - 2 * share)
        self.values = {
            name: self._begin[name] + smooth * (end - self._begin[name]) for name, end in self._end.items()
        }
