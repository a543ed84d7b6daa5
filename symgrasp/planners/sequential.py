"""One grasp for a sequence of tasks: Algorithm 2 of the paper, and all such grasps.

Turning the object is free in every task, so a task cares only about the grasp's height and roll:
at the right turn any angle at which its map is feasible there will do. All planners below rest on
that, and so are linear in the number of tasks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import InputError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import wrap
from symgrasp.planners.conflicts import ConflictError, find_conflict
from symgrasp.poses import Array

__all__ = [
    "CommonGrasp",
    "SequentialGrasp",
    "clearance_steps",
    "common_grasps",
    "first_common_grasp",
    "intervals_in_words",
]

CLEARANCE_STEP = 0.005
"""To so much (m) clearances count where they decide between grasps: to so much maps know the largest ones."""


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


class CommonGrasp(NamedTuple):
    """A height and roll at which every task is feasible, and where around the object.

    Attributes:
        roll: index of the roll.
        row: index of the height.
        intervals: for every task the feasible runs of columns, each (first, count); a run may
            go on past the last column to the first.
        margin: the worst task's best margin on the surface (m).
        clearance: the worst task's best clearance (m), of angles with at least that margin.
    """

    roll: int
    row: int
    intervals: tuple[tuple[tuple[int, int], ...], ...]
    margin: float
    clearance: float


def first_common_grasp(
    maps: Sequence[FeasibilityMap], resting: Sequence[int] | None = None
) -> SequentialGrasp:
    """Return the first grasp that is feasible in every task: Algorithm 2 as printed, roll by roll.

    Args:
        maps: the map of every task, all over the same grid.
        resting: indices of tasks in which the object stands on something, to say where a regrasp helps.

    Raises:
        ConflictError: no height and roll is feasible in every task; says why.
        InputError: there is no map, or the grids differ.
    """
    check_same_grid(maps)
    for row in range(maps[0].manifold.heights):
        for roll in range(len(maps[0].feasible)):
            columns = [_first(m.feasible[roll, row]) for m in maps]
            if None not in columns:
                return _grasp(maps, roll, row, [c for c in columns if c is not None])
    raise ConflictError(find_conflict(maps, resting))


def common_grasps(maps: Sequence[FeasibilityMap]) -> list[CommonGrasp]:
    """List every height and roll that serves all tasks: best margin first, of equal ones best clearance.

    Clearances count by `clearance_steps`; what is equal still stays in the order of rolls and heights.

    Raises:
        InputError: there is no map, or the grids differ.
    """
    check_same_grid(maps)
    margins = [surface_margin(m) for m in maps]
    worst = np.min([margin.max(axis=2) for margin in margins], axis=0)
    clear = np.min(
        [
            np.max(m.clearance, axis=2, where=m.feasible & (margin >= worst[..., None]), initial=0.0)
            for m, margin in zip(maps, margins, strict=True)
        ],
        axis=0,
    )
    found = [
        CommonGrasp(
            roll,
            row,
            tuple(_runs(m.feasible[roll, row]) for m in maps),
            float(worst[roll, row]),
            float(clear[roll, row]),
        )
        for roll, row in np.argwhere(np.logical_and.reduce([m.feasible.any(axis=2) for m in maps])).tolist()
    ]
    return sorted(found, key=lambda g: (-g.margin, -int(clearance_steps(g.clearance))))


def clearance_steps(clearance: ArrayLike) -> np.ndarray:
    """Return clearances (...) (m) as whole steps (...), rounded down; below 0 where there is none (NaN).

    A map tells the largest clearance of a cell to 2 mm and 3 % only, which is at most one step. Finer
    differences say nothing, and must not decide which of two grasps comes first.
    """
    return np.floor(np.nan_to_num(clearance, nan=-1.0) / CLEARANCE_STEP + 1e-9).astype(int)


def surface_margin(m: FeasibilityMap, ease: ArrayLike | None = None) -> Array:
    """Return (R, H, A) how far (m) the hand may be off on the surface, either way, 0 where infeasible.

    These are the margins of the map, which a plan states: proven ones where they are, and 0 then also where
    nothing is proven of a feasible cell. Angles count by the arc that they cover at the cell's radius. Where
    the arm stands near a limit or a singular pose only a part counts, its ease.

    Args:
        m: the map.
        ease: how easily the arm stands in the cells; that of the map if None.
    """
    radius = m.manifold.profile.radius(m.manifold.h)
    along, around = np.moveaxis(m.margins, -1, 0)
    margin = np.minimum(along, around * radius[None, :, None])
    ease = m.ease if ease is None else ease
    return margin if ease is None else margin * ease


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


def _grasp(maps: Sequence[FeasibilityMap], roll: int, row: int, columns: Sequence[int]) -> SequentialGrasp:
    dtheta = maps[0].manifold.dtheta
    return SequentialGrasp(
        Cell(roll, row, columns[0]),
        tuple(Cell(roll, row, column) for column in columns),
        tuple(float(wrap((column - columns[0]) * dtheta)) for column in columns),
    )


def _first(feasible: np.ndarray) -> int | None:
    return int(feasible.argmax()) if feasible.any() else None


def _runs(feasible: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Return the runs (first, count) of a circular row of cells."""
    if feasible.all():
        return ((0, len(feasible)),)
    starts = np.flatnonzero(feasible & ~np.roll(feasible, 1))
    ends = np.flatnonzero(feasible & ~np.roll(feasible, -1))
    return tuple((int(s), int(min((e - s) % len(feasible) for e in ends)) + 1) for s in starts)


def intervals_in_words(grasp: CommonGrasp, maps: Sequence[FeasibilityMap]) -> str:
    """Say at which angles (°, outer edges of the cells) each task allows a grasp's height and roll."""
    parts = []
    for m, runs in zip(maps, grasp.intervals, strict=True):
        start, step = math.degrees(m.manifold.theta_start), math.degrees(m.manifold.dtheta)
        spans = [(start + first * step, start + (first + count) * step) for first, count in runs]
        texts = [f"{low:.1f}° to {high:.1f}°" for low, high in spans]
        parts.append(f"{m.task} {' and '.join(texts)}")
    return "; ".join(parts)
