"""The map in the colours of the view that was chosen, the same on the object, board and panel."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.color_by import ColorBy, ColoredMap, color_map
from symgrasp.feasibility.map import FeasibilityMap

from ..state.map_view_state import RollChoice
from ..state.state import State
from .palette import PRINTS, faded
from .prints import print_index, shown_prints
from .weak_cache import cached_with_first

__all__ = ["cell_colors", "coloured"]


@cached_with_first
def coloured(m: FeasibilityMap, roll: RollChoice, view: ColorBy = ColorBy.REASON) -> ColoredMap:
    """Colour a map as one panel (H, A)."""
    return color_map(view, roll.reason(m), roll.values(m, view))


def cell_colors(state: State, m: FeasibilityMap) -> np.ndarray:
    """Return the colours (H, A, 3), sRGB, of a map of the state with the prints over it.

    Args:
        state: the state.
        m: the map over the object as it is turned, or as computed.
    """
    found = coloured(m, state.map_view.roll, state.map_view.color_by)
    colors = (found.colors if state.is_fresh else faded(found.colors))[found.index]
    prints = shown_prints(state)
    if not prints:
        return colors
    index = print_index(prints)
    if m is not state.map:  # the object's surface does not turn with it
        index = np.roll(index, m.manifold.shift(state.delta)[1], axis=1)
    return np.where(index[..., None] > 0, PRINTS[index], colors)
