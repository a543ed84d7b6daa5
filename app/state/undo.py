"""Undo and redo of what a person chooses, uploads included.

Results are not part of the history, except plans: a result that still fits the restored state is kept,
any other comes from the cache or is computed again.
"""

from __future__ import annotations

from dataclasses import replace

from symgrasp.feasibility.map import FeasibilityMap

from ..choices.scene_assets import NO_ASSETS
from .history import History
from .state import State
from .surveys.survey import SurveyState

__all__ = ["PLANS_KEPT", "UPLOADS_KEPT", "redo", "remember", "undo"]

PLANS_KEPT = 6
"""How many results of planners the history keeps, as a map may take 4 MB; older steps lose theirs."""

UPLOADS_KEPT = 10
"""How many uploads and robots the history keeps, as one takes a megabyte or more; steps before them cannot be
undone."""


def remember(before: State, after: State, origin: str, time: float) -> State:
    """Return the state after a change, with the change recorded in its history.

    Args:
        before: the state that was changed.
        after: the changed one.
        origin: "inputs", "gizmo", "scrub" or what begins with "map" if the change may be part of a drag;
            "play" for the playback, which is not recorded.
        time: of the change (s), by a monotonic clock.
    """
    if after.history is not before.history:  # the change was an undo or a redo
        return after
    if after.input_values == before.input_values or origin == "play":
        return after
    values = _changed_values(before, after, origin)
    history = before.history.recorded(
        lambda: _without_results(before), values, time, dragged=bool(origin), press=before.press
    )
    if history.past is not before.history.past:
        history = replace(history, past=_with_few_plans(_with_few_uploads(history.past)))
    return replace(after, history=history)


def undo(state: State) -> State:
    """Return to the state before the last step."""
    step = state.history.undone(_without_results(state))
    return _restored(state, *step) if step else state


def redo(state: State) -> State:
    """Return to the state before the last undo."""
    step = state.history.redone(_without_results(state))
    return _restored(state, *step) if step else state


def _changed_values(before: State, after: State, origin: str) -> frozenset[object]:
    """Return names for the changed values; those of a drag that changes several count as one."""
    if origin in ("gizmo", "scrub") or origin.startswith("map"):
        return frozenset([origin])
    pairs = zip(before.input_values, after.input_values, strict=True)
    return frozenset(k for k, (old, new) in enumerate(pairs) if old != new)


def _without_results(state: State) -> State:
    """Return a state without computed results; plans are kept, since planning again takes time."""
    map_view = state.map_view.without_results()
    return replace(
        state, history=History(), map_view=map_view, survey=SurveyState(), result=None, refused=None,
        busy=None, problem="",
    )  # fmt: skip


def _with_few_uploads(past: tuple[State, ...]) -> tuple[State, ...]:
    """Return the latest steps, as far back as they have no more than `UPLOADS_KEPT` uploads and robots."""
    kept: set[object] = set()
    for k, state in reversed(tuple(enumerate(past))):
        kept |= {state.uploaded_object, state.uploaded_scene, state.uploaded_robot, state.assets}
        kept -= {None, NO_ASSETS}
        if len(kept) > UPLOADS_KEPT:
            return past[k + 1 :]
    return past


def _with_few_plans(past: tuple[State, ...]) -> tuple[State, ...]:
    """Return the steps with plans only in the latest `PLANS_KEPT`, to limit memory."""
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
    """Return a state of the history with the present results that still fit it."""
    result = present.result if present.scene is restored.scene else None
    if restored.plan and restored.shown_task:
        result = restored.plan_results.maps.get((restored.task, restored.arm), result)
    return replace(
        restored,
        history=history,
        result=result,
        plan_results=restored.plan_results.paused(),
        link=present.link,
        survey=present.survey,
        press=present.press,
    )
