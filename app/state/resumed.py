"""A state as it is shown anew, after the session that it was in has ended."""

from __future__ import annotations

from dataclasses import replace

from .state import State

__all__ = ["resumed"]


def resumed(state: State) -> State:
    """Return a state without what was under way in the session that it comes from; all else is as it was."""
    return replace(
        state,
        busy=None,
        problem="",
        press=0,
        map_view=replace(state.map_view, hovered=None),
        plan_results=state.plan_results.paused(),
        survey=replace(state.survey, run=None),
    )
