"""Recording every choice of a person in the history, and going back and forth in it.

Only what is chosen goes back, uploads with it: a scene or an object can be chosen wherever it is shown.
What was computed stays where it still fits, and comes from the cache, or is computed again, where it does
not.
"""

from __future__ import annotations

from dataclasses import replace

from symgrasp.feasibility.map import FeasibilityMap

from .history import History
from .state import State

__all__ = ["PLANS_KEPT", "redo", "remember", "undo"]

PLANS_KEPT = 6
"""Results of planners that the history keeps: a map may take 4 MB. Earlier steps come back without plan."""


def remember(before: State, after: State, origin: str, time: float) -> State:
    """Return the state after a change, with the change in its history.

    Args:
        before: the state that was changed.
        after: the changed one.
        origin: "inputs", "gizmo" or "scrub" where the change may be part of a drag; "play" where
            nobody chose anything.
        time: when (s) it was changed, from any beginning.
    """
    if after.history is not before.history:  # the change was an undo or a redo
        return after
    if after.input_values == before.input_values or origin == "play":
        return after
    values = _changed_values(before, after, origin)
    history = before.history.recorded(lambda: _without_results(before), values, time, dragged=bool(origin))
    if history.past is not before.history.past:
        history = replace(history, past=_with_few_plans(history.past))
    return replace(after, history=history)


def undo(state: State) -> State:
    """Return to the state before the last step."""
    found = state.history.undone(_without_results(state))
    return _restored(state, *found) if found else state


def redo(state: State) -> State:
    """Take back an undo."""
    found = state.history.redone(_without_results(state))
    return _restored(state, *found) if found else state


def _changed_values(before: State, after: State, origin: str) -> frozenset[object]:
    """Name the values that changed: gizmo and scrubbers change several at once, widgets one or two."""
    if origin in ("gizmo", "scrub"):
        return frozenset([origin])
    pairs = zip(before.input_values, after.input_values, strict=True)
    return frozenset(k for k, (old, new) in enumerate(pairs) if old != new)


def _without_results(state: State) -> State:
    """Leave out what is computed; a plan cannot be made again at once, so it stays."""
    map_view = state.map_view.without_results()
    return replace(
        state, history=History(), map_view=map_view, result=None, refused=None, busy=None, problem=""
    )


def _with_few_plans(past: tuple[State, ...]) -> tuple[State, ...]:
    """Drop the plans of the earliest steps, so that not every map that was ever planned with is kept."""
    kept: set[frozenset[FeasibilityMap]] = set()
    steps: list[State] = []
    for state in reversed(past):
        maps = frozenset(result.map for result in state.plan_results.maps.values())
        if maps and (maps in kept or len(kept) < PLANS_KEPT):
            kept.add(maps)
        elif maps:
            state = replace(state, plan_results=state.plan_results.cleared(), step=None)
        steps.append(state)
    return tuple(reversed(steps))


def _restored(present: State, restored: State, history: History[State]) -> State:
    """Return a state of the past with its history, and with the results of the present that still fit it."""
    result = present.result if present.scene is restored.scene else None
    if restored.plan and restored.shown_task:
        result = restored.plan_results.maps.get((restored.task, restored.arm), result)
    return replace(
        restored,
        history=history,
        result=result,
        plan_results=restored.plan_results.paused(),
        link=present.link,
    )
