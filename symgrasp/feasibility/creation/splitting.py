"""Splitting the cells of a map that are not proven."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.refined import Refined, parts_of
from symgrasp.object.manifold import Manifold

__all__ = ["refined"]


def refined(
    m: FeasibilityMap,
    grids: Sequence[Manifold],
    map_on: Callable[[Manifold, np.ndarray], FeasibilityMap],
    only: np.ndarray | None = None,
) -> Refined:
    """Split the cells of a map that are not proven.

    Args:
        m: the map, with what is certified.
        grids: the finer grids, each of which cuts the cells of the one before.
        map_on: returns the map of some cells (R, H, A) of a grid, with what is certified.
        only: (R, H, A) which cells of the map to split; all if None.
    """
    assert m.certified is not None
    manifold, reason, certified = m.manifold, m.reason, m.certified
    for grid in grids:
        shape = (len(reason), grid.heights, grid.angles)
        manifold, reason, certified = grid, parts_of(reason, shape), parts_of(certified, shape)
        wanted = ~certified if only is None else ~certified & parts_of(only, shape)
        if wanted.any():
            finer = map_on(grid, wanted)
            assert finer.certified is not None
            reason = np.where(wanted, finer.reason, reason)
            certified = certified | (wanted & finer.certified)
    return Refined(manifold, reason, certified)
