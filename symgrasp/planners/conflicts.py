"""Why no single grasp serves a sequence of tasks, and the fewest regrasps that do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility import FeasibilityMap
from symgrasp.manifold import ROLLS

__all__ = ["Segment", "explain_conflict", "fewest_regrasps", "height_gap", "smallest_conflicts"]


class Segment(NamedTuple):
    """Consecutive tasks that one grasp serves.

    Attributes:
        first: index of the first task.
        last: index of the last task.
        grasps: (R, H) bool, the rolls and rows that serve all of them and both set-downs.
        set_down: index of the task at whose pose the object is set down and grasped anew
            afterwards, or None after the last segment.
    """

    first: int
    last: int
    grasps: np.ndarray
    set_down: int | None


def allowed(m: FeasibilityMap) -> np.ndarray:
    """Return (R, H) bool: the rolls and rows at which a task is feasible at some angle."""
    return np.asarray(m.feasible.any(axis=2))


def smallest_conflicts(maps: Sequence[FeasibilityMap]) -> list[tuple[int, ...]]:
    """Return the smallest sets of tasks that share no grasp, as indices; empty if all share one.

    Complete: sets are tried by growing size, and only those are extended that still share a
    grasp and that the added task narrows.
    """
    masks = [allowed(m) for m in maps]
    if np.logical_and.reduce(masks).any():
        return []
    open_sets: list[tuple[tuple[int, ...], np.ndarray]] = [((), np.ones_like(masks[0]))]
    while open_sets:
        grown = []
        for members, shared in open_sets:
            start = members[-1] + 1 if members else 0
            for k in range(start, len(masks)):
                narrowed = shared & masks[k]
                if not members or narrowed.sum() < shared.sum():
                    grown.append(((*members, k), narrowed))
        conflicts = [members for members, shared in grown if not shared.any()]
        if conflicts:
            return conflicts
        open_sets = grown
    return []


def height_gap(maps: Sequence[FeasibilityMap]) -> float | None:
    """Return how far apart (m) tasks are: the smallest spread of heights that serves each of them.

    Zero means that they share a height, None that they share no roll.
    """
    h = maps[0].manifold.h
    gaps = []
    for roll in range(len(ROLLS)):
        rows = [h[allowed(m)[roll]] for m in maps]
        if not all(len(r) for r in rows):
            continue
        lows = np.unique(np.concatenate(rows))
        for low in lows:
            above = [r[r >= low] for r in rows]
            if all(len(a) for a in above):
                gaps.append(max(float(a[0]) for a in above) - float(low))
    return min(gaps, default=None)


def fewest_regrasps(maps: Sequence[FeasibilityMap], resting: Sequence[int]) -> list[Segment] | None:
    """Split a sequence into the fewest runs of tasks that one grasp each serves.

    Between two runs the object is set down at the pose of one of the ``resting`` tasks and grasped
    anew, so both grasps must be feasible there as well.

    Args:
        maps: the map of every task, in order.
        resting: indices of tasks in which the object stands on something.

    Returns:
        The segments, or None if no number of regrasps helps.
    """
    masks = [allowed(m) for m in maps]
    whole = np.ones_like(masks[0])
    # best[(k, s)]: fewest segments for tasks 0..k-1 when the object then stands at pose s.
    best: dict[tuple[int, int | None], list[Segment]] = {(0, None): []}
    for k in range(len(maps)):
        for entry in (None, *resting):
            before = best.get((k, entry))
            if before is None:
                continue
            shared = whole if entry is None else masks[entry]
            for last in range(k, len(maps)):
                shared = shared & masks[last]
                if not shared.any():
                    break
                exits: list[int | None] = [None] if last == len(maps) - 1 else list(resting)
                for leave in exits:
                    grasps = shared if leave is None else shared & masks[leave]
                    known = best.get((last + 1, leave))
                    if grasps.any() and (known is None or len(known) > len(before) + 1):
                        best[last + 1, leave] = [*before, Segment(k, last, grasps, leave)]
    return best.get((len(maps), None))


def explain_conflict(maps: Sequence[FeasibilityMap]) -> str:
    """Say in one line which tasks exclude each other, what each allows, and how far apart they are."""
    conflict = smallest_conflicts(maps)[0]
    members = [maps[k] for k in conflict]
    names = " and ".join(m.task for m in members)
    if len(members) == 1:
        return f"no grasp is feasible in task {names}"
    gap = height_gap(members)
    apart = "they share no roll" if gap is None else f"they are {100 * gap:.1f} cm apart"
    heights = "; ".join(f"{m.task} allows {_heights(m)}" for m in members)
    return f"no grasp serves {names}: {apart}; {heights}"


def _heights(m: FeasibilityMap) -> str:
    """Say at which heights (cm) a task has a feasible cell, for each roll."""
    parts = []
    for roll, angle in enumerate(ROLLS):
        rows = np.flatnonzero(allowed(m)[roll])
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []
        spans = [f"{100 * m.manifold.h[r[0]]:.1f} to {100 * m.manifold.h[r[-1]]:.1f} cm" for r in runs]
        parts.append(f"{' and '.join(spans) or 'nothing'} at roll {np.rad2deg(angle):.0f}°")
    return ", ".join(parts)
