"""Which cells lie under which hand, for the maps and for the object's surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.palette import OVERLAP, PRINTS
from app.state import State

__all__ = ["hand_color", "on_surface", "print_index", "shown_prints"]


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
    """Return the prints (H, A), in the object's frame, of the hands that hold the object together."""
    if not state.plan or not state.shown or len(state.shown.holds) < 2:
        return []
    return [state.plan.prints[state.shown.name, hold.arm] for hold in state.shown.holds]


def on_surface(state: State, cells: np.ndarray) -> np.ndarray:
    """Bring cells (H, A, …) of the object's frame to the coloured surface, which does not turn with it."""
    _, turned = state.scene.manifold.shift(state.delta)
    return np.roll(cells, turned, axis=1)
