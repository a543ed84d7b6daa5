"""Margins of feasible cells, counted in cells."""

from __future__ import annotations

import numpy as np

from symgrasp.compiling import njit

__all__ = ["cells_to_infeasible"]


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
