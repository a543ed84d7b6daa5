"""One grasp for a sequence of tasks: Algorithm 2 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.errors import InputError, NoPlanError
from symgrasp.feasibility import Cell, FeasibilityMap
from symgrasp.manifold import ROLLS, wrap

__all__ = ["SequentialGrasp", "first_common_grasp"]


class SequentialGrasp(NamedTuple):
    """One grasp that serves every task once the object is turned by δᵢ in task i.

    Attributes:
        grasp: the cell (roll, row, column θ*) that the hand keeps.
        cells: for every task the cell (roll, row, column θᵢ) of its own map that is used.
        deltas: for every task the turn δᵢ = θᵢ − θ* (rad) of the object about its axis.
    """

    grasp: Cell
    cells: tuple[Cell, ...]
    deltas: tuple[float, ...]


def first_common_grasp(maps: Sequence[FeasibilityMap]) -> SequentialGrasp:
    """Return the first grasp that is feasible in every task: Algorithm 2 as printed, roll by roll.

    Args:
        maps: the map of every task, all over the same grid.

    Raises:
        NoPlanError: no height and roll is feasible in every task; says which heights each allows.
        InputError: there is no map, or the grids differ.
    """
    check_same_grid(maps)
    dtheta = maps[0].manifold.dtheta
    for row in range(maps[0].manifold.heights):
        for roll in range(len(ROLLS)):
            columns = [_first(m.feasible[roll, row]) for m in maps]
            if any(column is None for column in columns):
                continue
            found = [int(column) for column in columns if column is not None]
            return SequentialGrasp(
                Cell(roll, row, found[0]),
                tuple(Cell(roll, row, column) for column in found),
                tuple(float(wrap((column - found[0]) * dtheta)) for column in found),
            )
    raise NoPlanError("no height and roll is feasible in every task: " + "; ".join(map(_heights, maps)))


def check_same_grid(maps: Sequence[FeasibilityMap]) -> None:
    """Check that maps can be combined cell by cell.

    Raises:
        InputError: there is no map, or the grids differ.
    """
    if not maps:
        raise InputError("planner", "maps", [], "at least one map")
    first = maps[0].manifold
    for m in maps[1:]:
        grid = m.manifold
        same = (grid.heights, grid.angles, grid.theta_start) == (
            first.heights,
            first.angles,
            first.theta_start,
        )
        if not same or not np.array_equal(grid.profile.points, first.profile.points):
            raise InputError("planner", f"map of {m.task}, {m.arm}", m.reason.shape, "one grid for all maps")


def _first(feasible: np.ndarray) -> int | None:
    return int(feasible.argmax()) if feasible.any() else None


def _heights(m: FeasibilityMap) -> str:
    """Say at which heights (cm) a task has a feasible cell, for each roll."""
    parts = []
    for roll, angle in enumerate(ROLLS):
        rows = np.flatnonzero(m.feasible[roll].any(axis=1))
        if not len(rows):
            parts.append(f"nothing at roll {np.rad2deg(angle):.0f}°")
            continue
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        spans = (f"{100 * m.manifold.h[r[0]]:.1f} to {100 * m.manifold.h[r[-1]]:.1f} cm" for r in runs)
        parts.append(f"{', '.join(spans)} at roll {np.rad2deg(angle):.0f}°")
    return f"{m.task} allows " + " and ".join(parts)
