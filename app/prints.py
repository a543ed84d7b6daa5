"""Which cells lie under which hand, for the maps and for the object's surface."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from app.palette import OVERLAP, PRINTS
from app.state import State
from symgrasp.handprint import Handprint
from symgrasp.manifold import Manifold
from symgrasp.robot import Arm

__all__ = ["hand_color", "on_surface", "print_index", "print_names", "shown_prints"]


def print_index(prints: Sequence[np.ndarray]) -> np.ndarray:
    """Return for every cell the index (H, A) into `PRINTS` of what lies on it.

    Args:
        prints: cells (H, A) under each hand.

    Returns:
        0 for nothing, the hand's own index, or `OVERLAP` where there are several hands.
    """
    index = sum(np.where(cells, hand_color(k), 0) for k, cells in enumerate(prints))
    return np.where(np.sum(prints, axis=0) > 1, OVERLAP, index)


def hand_color(k: int) -> int:
    """Return the index into `PRINTS` of the k-th hand of a task."""
    return 1 + k % (len(PRINTS) - 2)


def shown_prints(state: State) -> list[np.ndarray]:
    """Return the prints (H, A), in the object's frame, of the hands that hold the object.

    Of those that hold it together in a plan, or of the picked grasp where that is asked for.
    """
    if state.plan and state.shown and len(state.shown.holds) > 1:
        return [state.plan.prints[state.shown.name, hold.arm] for hold in state.shown.holds]
    if state.looking.handprint and state.pick and state.cell:
        grid = state.scene.manifold
        row, column = grid.cell(state.pick.h, state.pick.theta)
        return [_print(state.scene.arm(state.arm), grid, row, state.cell.roll).on(grid, column)]
    return []


def print_names(state: State) -> list[str]:
    """Return the arms that the shown prints belong to."""
    if state.shown and len(state.shown.holds) > 1:
        return [hold.arm for hold in state.shown.holds]
    return [state.arm]


@lru_cache(maxsize=64)
def _print(arm: Arm, grid: Manifold, row: int, roll: int) -> Handprint:
    return arm.handprint(grid, row, roll)


def on_surface(state: State, cells: np.ndarray) -> np.ndarray:
    """Bring cells (H, A, …) of the object's frame to the coloured surface, which does not turn with it."""
    _, turned = state.scene.manifold.shift(state.delta)
    return np.roll(cells, turned, axis=1)
