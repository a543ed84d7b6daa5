"""The handprints that a state shows: which cells lie under which hand."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from symgrasp.object.manifold import wrap
from symgrasp.planners.gaps import print_gap
from symgrasp.robot.handprint import Handprint
from symgrasp.scene.scene import Scene

from ..state.state import State
from .palette import OVERLAP, PRINTS
from .weak_cache import cached_with_first

__all__ = [
    "apart_text",
    "hand_color",
    "hand_print",
    "on_surface",
    "print_index",
    "print_names",
    "shown_gap",
    "shown_prints",
    "task_prints",
]


def print_index(prints: Sequence[np.ndarray]) -> np.ndarray:
    """Return the index (H, A) into `PRINTS` of each cell's colour.

    Args:
        prints: for each hand, whether a cell (H, A) lies under it.

    Returns:
        0 where there is no hand, the hand's `hand_color`, or `OVERLAP` where there are several.
    """
    index = sum(np.where(cells, hand_color(k), 0) for k, cells in enumerate(prints))
    return np.where(np.sum(prints, axis=0) > 1, OVERLAP, index)


def hand_color(k: int) -> int:
    """Return the index into `PRINTS` of the k-th hand of a task."""
    return 1 + k % (len(PRINTS) - 2)


def shown_prints(state: State) -> list[np.ndarray]:
    """Return the handprints (H, A) to show, in the object's frame.

    They are those of all hands in the step of the climb or in the plan's task that is shown; else that
    of the picked grasp, if `MapViewState.handprint` is set.
    """
    grid = state.scene.manifold
    if state.climb_step and state.plan_results.climb:
        return [
            hand_print(state.scene, arm, cell.row, cell.roll).on(grid, cell.column)
            for arm, cell in zip(state.plan_results.climb.arms, state.climb_step.cells, strict=True)
        ]
    if state.plan and state.step is not None and state.shown_task and len(state.shown_task.holds) > 1:
        return task_prints(state, state.step)
    if state.map_view.handprint and state.pick and state.cell:
        row, column = grid.cell(state.pick.h, state.pick.theta)
        pitch, theta = _pitch_and_angle(state)
        if theta is not None:
            offset = float(wrap(theta - grid.theta[column])) if state.scene.arm(state.arm).pitched else 0.0
            print_ = hand_print(state.scene, state.arm, row, state.cell.roll, pitch, offset)
            return [print_.on(grid, column)]
    return []


def task_prints(state: State, k: int) -> list[np.ndarray]:
    """Return the handprints (H, A) of the hands of the k-th task of a plan, in the object's frame."""
    if state.plan is None:
        return []
    return [p.on(state.scene.manifold, c) for p, c in _moved_prints(state, k)] or list(
        state.plan.prints[k].values()
    )


def shown_gap(state: State, k: int) -> float | None:
    """Return the smallest gap (m) between the prints of the k-th task of a plan; see `PlanResult.gaps`."""
    if state.plan is None:
        return None
    moved = _moved_prints(state, k)
    if not moved:
        return state.plan.gaps[k]
    grid = state.scene.manifold
    return min((print_gap(a, b, j - i, grid) for (a, i), (b, j) in combinations(moved, 2)), default=None)


def apart_text(state: State, k: int) -> str:
    """Return text for the smallest gap between two handprints of the k-th task of a plan, if it has two."""
    gap = shown_gap(state, k)
    if gap is None:
        return ""
    if gap >= 0:
        return f"gap {1e3 * gap:.0f} mm"
    by_hand = state.plan_results.by_hand
    if by_hand is None or by_hand.step != k:
        return "prints overlap: the hands pass each other"
    shared = int(np.count_nonzero(np.sum(task_prints(state, k), axis=0) > 1))
    return f"prints share {shared} cell{'s' * (shared != 1)}"


def _moved_prints(state: State, k: int) -> list[tuple[Handprint, int]]:
    """Return the prints at column 0, and their columns, where a person moved hands of the k-th task."""
    by_hand = state.plan_results.by_hand
    if state.plan is None or by_hand is None or by_hand.step != k:
        return []
    return [
        (hand_print(state.scene, hold.arm, cell.row, cell.roll, hold.grasp.pitch), cell.column)
        for hold, cell in zip(state.plan.plan.tasks[k].holds, by_hand.cells, strict=True)
    ]


def _pitch_and_angle(state: State) -> tuple[float, float | None]:
    """Return the pitch (rad) of the hand at the picked grasp, and the angle (rad) at which it holds.

    Both follow from the configuration of an arm of five joints. Where it cannot hold, the angle is None.
    """
    assert state.pick and state.cell
    arm = state.scene.arm(state.arm)
    hold = next((h for h in state.shown_task.holds if h.arm == state.arm), None) if state.shown_task else None
    if hold is not None:
        return hold.grasp.pitch, hold.grasp.theta
    if not arm.pitched:
        return 0.0, state.pick.theta
    witness = state.map.witness(state.cell) if state.is_fresh and state.map else None
    if witness is None or state.map is None:
        return 0.0, None
    pitch, azimuth = arm.pitch_and_azimuth(witness.q, state.cell.roll)
    return pitch, float(state.map.manifold.theta[state.cell.column]) + azimuth


def print_names(state: State) -> list[str]:
    """Return the names of the arms of `shown_prints`, in the same order."""
    if state.climb_step and state.plan_results.climb:
        return list(state.plan_results.climb.arms)
    if state.shown_task and len(state.shown_task.holds) > 1:
        return [hold.arm for hold in state.shown_task.holds]
    return [state.arm]


@cached_with_first
def hand_print(
    scene: Scene, arm: str, row: int, roll: int, pitch: float = 0.0, azimuth: float = 0.0
) -> Handprint:
    """Return an arm's handprint at column 0; cached, since a replay repeats the same ones many times."""
    return scene.arm(arm).handprint(scene.manifold, row, roll, pitch, azimuth)


def on_surface(state: State, cells: np.ndarray) -> np.ndarray:
    """Shift cells (H, A, …) from the object's frame to the coloured surface, which does not turn by δ."""
    _, turned = state.scene.manifold.shift(state.delta)
    return np.roll(cells, turned, axis=1)
