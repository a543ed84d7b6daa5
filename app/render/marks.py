"""The grasps that are marked on pictures of a map."""

from __future__ import annotations

from dataclasses import dataclass

from ..state.plans.plan_changes import hand_cells
from ..state.state import State

__all__ = ["Mark", "hand_marks", "marks_of"]


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
    if state.shown_task and state.plan_results.by_hand and state.step is not None:
        return hand_marks(state, state.step)
    if state.shown_task and len(state.shown_task.holds) > 1:
        return [Mark(hold.grasp.h, hold.grasp.theta, hold.arm) for hold in state.shown_task.holds]
    return [Mark(state.pick.h, state.pick.theta)] if state.pick else []


def hand_marks(state: State, k: int) -> list[Mark]:
    """Return the grasps of the hands of the k-th task of a plan, where a person may have moved them."""
    if state.plan is None:
        return []
    holds, grid = state.plan.plan.tasks[k].holds, state.scene.manifold
    by_hand = state.plan_results.by_hand
    if by_hand is None or by_hand.step != k:
        return [Mark(hold.grasp.h, hold.grasp.theta, hold.arm) for hold in holds]
    return [
        Mark(float(grid.h[cell.row]), float(grid.theta[cell.column]), hold.arm)
        for cell, hold in zip(hand_cells(state, k), holds, strict=True)
    ]
