"""The timing of a page's playback."""

from __future__ import annotations

from ...state.plans.plan_changes import played
from ...state.state import State

__all__ = ["PlaybackClock"]

INTERVAL = 0.05
"""Time (s) between two frames of the playback."""


class PlaybackClock:
    """Advances the playback of one session; not thread-safe, the session's lock guards it."""

    def __init__(self) -> None:
        self._last: float | None = None

    def wait(self, state: State | None, now: float) -> float | None:
        """Return the time (s) until the next frame is due, None while nothing is played.

        Args:
            state: what is shown.
            now: the time (s) of a monotonic clock.
        """
        if state is None or not state.plan_results.playing:
            return None
        return max(0.0, _interval(state) - (now - self._last)) if self._last is not None else 0.0

    def advanced(self, state: State, now: float) -> State:
        """Return the state with its playback advanced to a time (s), if a frame is due."""
        if not state.plan_results.playing:
            self._last = None
        elif self._last is None:  # it has just begun
            self._last = now
        elif now - self._last >= _interval(state):
            state = played(state, now - self._last)
            self._last = now
        return state


def _interval(state: State) -> float:
    """Return the time (s) between two frames: that of a step of a climb, if it is longer than usual."""
    results = state.plan_results
    if results.playing == "climb" and results.climb:
        return max(INTERVAL, 1 / results.climb.speed)
    return INTERVAL
