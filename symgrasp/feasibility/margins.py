"""Margins of feasible cells, counted in cells or in the parts that they are split into."""

from __future__ import annotations

import numpy as np

from symgrasp.compiling import njit

__all__ = ["cells_to_infeasible", "way_to_unproven"]


@njit(cache=True)
def cells_to_infeasible(feasible):
    """Count for every cell the steps to the nearest infeasible one: along the axis, and around it.

    Zero where infeasible. Both ends of the axis count as infeasible; around, half the columns are
    the most there is.

    Args:
        feasible: (R, H, A) bool.

    Returns:
        (2, R, H, A) along and around.
    """
    rolls, heights, angles = feasible.shape
    steps = np.zeros((2, rolls, heights, angles), np.int64)
    along, around = steps
    for r in range(rolls):
        for j in range(angles):
            run = 0
            for i in range(heights):
                run = run + 1 if feasible[r, i, j] else 0
                along[r, i, j] = run
            run = 0
            for i in range(heights - 1, -1, -1):
                run = run + 1 if feasible[r, i, j] else 0
                along[r, i, j] = min(along[r, i, j], run)
        for i in range(heights):
            around[r, i] = angles // 2
            run = angles
            for k in range(2 * angles):
                run = run + 1 if feasible[r, i, k % angles] else 0
                around[r, i, k % angles] = min(around[r, i, k % angles], run)
            run = angles
            for k in range(2 * angles - 1, -1, -1):
                run = run + 1 if feasible[r, i, k % angles] else 0
                around[r, i, k % angles] = min(around[r, i, k % angles], run)
    return steps


def way_to_unproven(whole: np.ndarray, lines: int, cells: int, closed: bool) -> np.ndarray:
    """Count the parts of a finer grid from the centres of cells to the nearest one that is not proven.

    Args:
        whole: (R, L, N) bool, which parts are proven, by lines that lie side by side.
        lines: number of cells across the lines; a part of L.
        cells: number of cells along them; a part of N.
        closed: whether the lines are closed; else both ends count as not proven.

    Returns:
        (R, lines, cells) number of parts to the nearer side, halves included.
    """
    rolls, count, length = whole.shape
    across, along = count // lines, length // cells
    # The centre of a cell lies on the middle line, or on the edge of two: either of them will do.
    middle = [across // 2] if across % 2 else [across // 2 - 1, across // 2]
    found = np.zeros((rolls, lines, cells))
    for line in middle:
        own = whole[:, line::across]
        if closed:
            own = np.tile(own, 3)
        ahead = _run(own)
        behind = _run(own[..., ::-1])[..., ::-1]
        start = length if closed else 0
        at = start + np.arange(cells) * along + along // 2
        if along % 2:  # the centre is in the middle of a part
            way = np.minimum(ahead[..., at], behind[..., at]) - 0.5
        else:
            way = np.minimum(ahead[..., at], behind[..., at - 1])
        found = np.maximum(found, np.maximum(way, 0.0))
    return np.minimum(found, 0.5 * length) if closed else found


def _run(whole: np.ndarray) -> np.ndarray:
    """Return how many parts (..., N) in a row are proven, from each one on."""
    index = np.arange(whole.shape[-1])
    ends = np.where(whole, whole.shape[-1], index)
    first = np.minimum.accumulate(ends[..., ::-1], axis=-1)[..., ::-1]
    return first - index
