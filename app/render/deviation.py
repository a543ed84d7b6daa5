"""The symmetry error of a measured mesh on the cells of a map: values and colours."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from symgrasp.object.manifold import Manifold
from symgrasp.object.measure.measurement import Measurement

from .palette import DIVERGING

__all__ = ["deviation_cells", "deviation_colors", "deviation_limit"]

NO_SURFACE = (150, 150, 150)
"""Colour (sRGB) of cells where an open mesh has no surface."""


def deviation_cells(m: Measurement, grid: Manifold) -> np.ndarray:
    """Return the largest deviation from the surface of revolution in each cell.

    Args:
        m: the measurement.
        grid: the grid, in the object's frame.

    Returns:
        (H, A) deviation (m) of the largest size, positive outwards; NaN where the mesh has no surface.
    """
    bottom = grid.profile.h_min
    row = np.clip(((m.heights - bottom) / grid.dh).astype(int), 0, grid.heights - 1)
    column = [grid.cell(bottom, angle)[1] for angle in m.angles]
    rows, columns = np.meshgrid(row, column, indexing="ij")
    # Cells between the samples take the nearest one.
    near_rows = np.abs(grid.h[:, None] - m.heights).argmin(axis=1)
    near_columns = np.abs(np.exp(1j * grid.theta[:, None]) - np.exp(1j * m.angles)).argmin(axis=1)
    near = m.deviation[np.ix_(near_rows, near_columns)]
    highest, lowest = near.copy(), near.copy()
    np.fmax.at(highest, (rows, columns), m.deviation)
    np.fmin.at(lowest, (rows, columns), m.deviation)
    return np.where(highest >= -lowest, highest, lowest)


@lru_cache(maxsize=4)
def deviation_colors(m: Measurement, grid: Manifold) -> np.ndarray:
    """Return the colours (H, A, 3), sRGB, of the deviation in each cell: diverging, neutral at zero.

    Args:
        m: the measurement.
        grid: the grid, in the object's frame.
    """
    cells = deviation_cells(m, grid)
    share = np.nan_to_num(cells) / deviation_limit(m)
    at = (np.clip(share, -1, 1) + 1) / 2 * (len(DIVERGING) - 1)
    stops = np.arange(len(DIVERGING))
    channels = [np.interp(at, stops, DIVERGING[:, k]) for k in range(3)]
    colors = np.round(np.stack(channels, axis=-1)).astype(np.uint8)
    colors[np.isnan(cells)] = NO_SURFACE
    return colors


def deviation_limit(m: Measurement) -> float:
    """Return the size of the deviation (m) at either end of the colour scale."""
    return max(m.worst[0], 1e-5)
