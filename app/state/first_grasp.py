"""The grasp that a page begins with: the one with the most room on its first map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap

from .state import Pick, State

__all__ = ["most_room", "with_first_grasp"]


def with_first_grasp(state: State) -> State:
    """Return a state that was to begin with a grasp with it, once its map is there; any other as it is.

    A grasp that a person picked meanwhile stays, and where none is feasible none is picked.
    """
    if not state.holds_first or not state.is_current or state.map is None:
        return state
    cell = None if state.pick else most_room(state.map)
    if cell is None:
        return replace(state, holds_first=False)
    grid = state.map.manifold
    pick = Pick(float(grid.h[cell.row]), float(grid.theta[cell.column]))
    return replace(state, holds_first=False, pick=pick)


def most_room(m: FeasibilityMap) -> Cell | None:
    """Return the feasible cell that is furthest from infeasible ones, None where none is feasible.

    The room is the lesser of those along the axis and around it, both counted in cells; of cells with the
    same room, the one with the most clearance.
    """
    if not m.feasible.any():
        return None
    room = np.round(m.cell_margins / [m.manifold.dh, m.manifold.dtheta]).min(axis=-1)
    clearance = np.where(np.isfinite(m.clearance), m.clearance, 0.0)
    best = max(np.argwhere(m.feasible).tolist(), key=lambda at: (room[tuple(at)], clearance[tuple(at)]))
    return Cell(*best)
