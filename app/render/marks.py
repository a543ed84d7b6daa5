"""The grasps that are marked on pictures of a map."""

from __future__ import annotations

from dataclasses import dataclass

from ..state.state import State

__all__ = ["Mark", "marks_of"]


@dataclass(frozen=True)
class Mark:
    """A grasp to be circled on a map.

    Attributes:
        h: its height (m).
        theta: its angle (rad).
        label: text beside the circle; none if empty.
    """

    h: float
    theta: float
    label: str = ""


def marks_of(state: State) -> list[Mark]:
    """Return the grasps to mark on the map: all of the plan's task that is shown, or the picked one."""
    if state.shown_task and len(state.shown_task.holds) > 1:
        return [Mark(hold.grasp.h, hold.grasp.theta, hold.arm) for hold in state.shown_task.holds]
    return [Mark(state.pick.h, state.pick.theta)] if state.pick else []
