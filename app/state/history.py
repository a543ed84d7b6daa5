"""Undo and redo: what a person chose, step by step; a drag is one step. Pure, like the state.

Only what is chosen goes back, uploads with it: a scene or an object is on offer wherever it is shown.
What was computed stays where it still fits, and comes again from what the server remembers where it
does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.state.state import State
    from symgrasp.feasibility.map import FeasibilityMap

__all__ = ["DRAG_PAUSE", "PLANS_KEPT", "STEPS_KEPT", "History", "redo", "remember", "undo"]

STEPS_KEPT = 100
"""Steps that can be undone."""

PLANS_KEPT = 6
"""Findings of planners among them: a map may take 4 MB. Earlier steps come back without their plan."""

DRAG_PAUSE = 0.8
"""Changes of one value that follow each other within this time (s) are one drag."""


@dataclass(frozen=True)
class Drag:
    """A drag that may still go on.

    Attributes:
        what: what it changes.
        at: when (s) it was last heard of.
    """

    what: frozenset[object]
    at: float

    def goes_on(self, what: frozenset[object], now: float) -> bool:
        """Whether a change is part of it."""
        return what <= self.what and 0 <= now - self.at < DRAG_PAUSE


@dataclass(frozen=True, eq=False)
class History:
    """The states that can be returned to, the nearest last.

    Attributes:
        past: before the present one.
        future: after it, having been undone.
        drag: the drag that led to the present one.
    """

    past: tuple[State, ...] = ()
    future: tuple[State, ...] = ()
    drag: Drag | None = None


def remember(before: State, after: State, origin: str, now: float) -> State:
    """Return the state after a change, with its history brought up to it.

    Args:
        before: the state that was changed.
        after: the changed one.
        origin: "inputs", "gizmo" or "scrub" where the change may be part of a drag; "play" where
            nobody chose anything.
        now: the time (s), from any beginning.
    """
    if after.history is not before.history:  # the change was an undo or a redo
        return after
    if after.inputs == before.inputs or origin == "play":
        return after
    history = before.history
    what = _what(before, after, origin)
    if origin and history.drag and history.drag.goes_on(what, now):
        return replace(after, history=replace(history, drag=Drag(history.drag.what, now)))
    past = _light((*history.past, _chosen(before))[-STEPS_KEPT:])
    return replace(after, history=History(past, (), Drag(what, now) if origin else None))


def undo(state: State) -> State:
    """Return to the state before the last step."""
    history = state.history
    if not history.past:
        return state
    *past, then = history.past
    return _restored(state, then, History(tuple(past), (*history.future, _chosen(state))))


def redo(state: State) -> State:
    """Take back an undo."""
    history = state.history
    if not history.future:
        return state
    *future, then = history.future
    return _restored(state, then, History((*history.past, _chosen(state)), tuple(future)))


def _what(before: State, after: State, origin: str) -> frozenset[object]:
    """Name what a change is about: gizmo and scrubbers change several values at once, widgets one or two."""
    if origin in ("gizmo", "scrub"):
        return frozenset([origin])
    pairs = zip(before.inputs, after.inputs, strict=True)
    return frozenset(k for k, (old, new) in enumerate(pairs) if old != new)


def _chosen(state: State) -> State:
    """Leave out what is computed; a plan cannot be made again at once, so it stays."""
    map_view = state.map_view.chosen()
    return replace(
        state, history=History(), map_view=map_view, result=None, refused=None, busy=None, problem=""
    )


def _light(past: tuple[State, ...]) -> tuple[State, ...]:
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


def _restored(now: State, then: State, history: History) -> State:
    result = now.result if now.scene is then.scene else None
    if then.plan and then.shown:
        result = then.plan.maps.get((then.task, then.arm), result)
    return replace(
        then, history=history, result=result, plan_results=then.plan_results.still(), link=now.link
    )
