"""Undo and redo for any immutable state; all changes of one drag are one step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

__all__ = ["DRAG_PAUSE", "STEPS_KEPT", "Drag", "History"]

T = TypeVar("T")

STEPS_KEPT = 100
"""How many steps can be undone."""

DRAG_PAUSE = 0.8
"""Changes of the same value less than this time (s) apart belong to one drag, pressed or not."""


@dataclass(frozen=True)
class Drag:
    """A drag that may still go on.

    Attributes:
        values: names of the values that it changes.
        time: of its last change (s).
        press: number of the press of the pointer that it goes on with; 0 where none is known.
    """

    values: frozenset[object]
    time: float
    press: int = 0

    def includes(self, values: frozenset[object], time: float, press: int) -> bool:
        """Return whether a change of these values at a time (s) belongs to it, in a press or in none (0)."""
        return values <= self.values and (0 < press == self.press or 0 <= time - self.time < DRAG_PAUSE)


@dataclass(frozen=True, eq=False)
class History(Generic[T]):
    """The states before and after the present one, each list with the nearest last.

    Attributes:
        past: states before the present one.
        future: states after it, which were undone.
        drag: the drag whose last change made the present state, if one did.
    """

    past: tuple[T, ...] = ()
    future: tuple[T, ...] = ()
    drag: Drag | None = None

    def recorded(
        self,
        before: Callable[[], T],
        values: frozenset[object],
        time: float,
        *,
        dragged: bool,
        press: int = 0,
    ) -> History[T]:
        """Return the history after a change: with a new step, unless the change belongs to the present drag.

        Args:
            before: returns the state before the change; called only for a new step.
            values: names of the changed values.
            time: when (s) they changed.
            dragged: whether the change may be part of a drag.
            press: number of the press of the pointer under way; 0 for none.
        """
        if dragged and self.drag and self.drag.includes(values, time, press):
            return replace(self, drag=Drag(self.drag.values, time, press or self.drag.press))
        past = (*self.past, before())[-STEPS_KEPT:]
        return History(past, (), Drag(values, time, press) if dragged else None)

    def undone(self, present: T) -> tuple[T, History[T]] | None:
        """Return the state before the present one with its history, or None at the beginning."""
        if not self.past:
            return None
        *past, state = self.past
        return state, History(tuple(past), (*self.future, present))

    def redone(self, present: T) -> tuple[T, History[T]] | None:
        """Return the state that the last undo left with its history, or None if there was no undo."""
        if not self.future:
            return None
        *future, state = self.future
        return state, History((*self.past, present), tuple(future))
