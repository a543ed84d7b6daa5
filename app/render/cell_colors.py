"""The colours of a map's cells, the same on the object, on the flat map and in the panel."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.color_by import ColorBy, ColoredMap, color_map
from symgrasp.feasibility.map import FeasibilityMap

from ..state.map_view_state import RollChoice
from ..state.state import State
from .palette import PRINTS, faded
from .prints import print_index, shown_prints
from .weak_cache import cached_with_first

__all__ = ["cell_colors", "colored_map"]


@cached_with_first
def colored_map(m: FeasibilityMap, roll: RollChoice, color_by: ColorBy = ColorBy.REASON) -> ColoredMap:
    """Colour the cells (H, A) of a map; those not proven to hold as a whole are lighter, where that is known.

    Args:
        m: the map.
        roll: which rolls are shown.
        color_by: what the colours stand for.
    """
    return color_map(color_by, roll.reason(m), roll.values(m, color_by), roll.certified(m))


def cell_colors(state: State, m: FeasibilityMap) -> np.ndarray:
    """Return the colours (H, A, 3), sRGB, of a map of the state, with the handprints over it.

    Args:
        state: the state.
        m: `State.map`, or the unshifted map it was made from.
    """
    colored = colored_map(m, state.map_view.roll, state.map_view.color_by)
    colors = (colored.colors if state.is_fresh else faded(colored.colors))[colored.index]
    prints = shown_prints(state)
    if not prints:
        return colors
    index = print_index(prints)
    if m is not state.map:  # the prints are in the turned object's frame, this map is not
        index = np.roll(index, m.manifold.shift(state.delta)[1], axis=1)
    return np.where(index[..., None] > 0, PRINTS[index], colors)
