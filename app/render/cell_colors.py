"""The colours of a map's cells, the same on the object, on the flat map and in the panel."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.color_by import ColorBy, ColoredMap, color_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.refined import parts_of

from ..state.map_view_state import RollChoice
from ..state.state import State
from .palette import PRINTS, faded
from .prints import print_index, shown_prints
from .weak_cache import cached_with_first

__all__ = ["cell_colors", "colored_map", "colored_parts"]


@cached_with_first
def colored_map(m: FeasibilityMap, roll: RollChoice, color_by: ColorBy = ColorBy.REASON) -> ColoredMap:
    """Colour the cells (H, A) of a map; those not proven to hold as a whole are lighter, where that is known.

    Args:
        m: the map.
        roll: which rolls are shown.
        color_by: what the colours stand for.
    """
    return color_map(color_by, roll.reason(m), roll.values(m, color_by), roll.certified(m))


@cached_with_first
def colored_parts(
    m: FeasibilityMap, roll: RollChoice, color_by: ColorBy = ColorBy.REASON
) -> ColoredMap | None:
    """Colour the parts (H, A) that the cells of a map are split into; None where none are drawn.

    The arguments are those of `colored_map`.
    """
    if m.refined is None or not color_by.has_parts:
        return None
    reason, certified = roll.parts(m.refined)
    return color_map(color_by, reason, np.full(reason.shape, np.nan), certified)


def cell_colors(state: State, m: FeasibilityMap) -> np.ndarray:
    """Return the colours (H, A, 3), sRGB, of a map of the state, with the handprints over it.

    Where its cells are split, H and A are those of the parts.

    Args:
        state: the state.
        m: `State.map`, or the unshifted map it was made from.
    """
    view = state.map_view
    colored = colored_parts(m, view.roll, view.color_by) or colored_map(m, view.roll, view.color_by)
    colors = (colored.colors if state.is_fresh else faded(colored.colors))[colored.index]
    prints = shown_prints(state)
    if not prints:
        return colors
    index = print_index(prints)
    if m is not state.map:  # the prints are in the turned object's frame, this map is not
        index = np.roll(index, m.manifold.shift(state.delta)[1], axis=1)
    index = parts_of(index[None], (1, *colors.shape[:2]))[0]
    return np.where(index[..., None] > 0, PRINTS[index], colors)
