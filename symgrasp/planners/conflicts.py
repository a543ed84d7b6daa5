"""Why no single grasp serves a sequence of tasks, and the fewest regrasps that do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS

__all__ = [
    "Conflict",
    "ConflictError",
    "Exclusion",
    "Segment",
    "Shared",
    "TaskHeights",
    "fewest_regrasps",
    "find_conflict",
    "height_gap",
    "smallest_conflicts",
]


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

    Zero means that they share a height, None that they share no roll, or no roll and pitch.
    """
    h = maps[0].manifold.h
    gaps = []
    for roll in range(len(maps[0].feasible)):
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


class TaskHeights(NamedTuple):
    """Where along the object a task can be done.

    Attributes:
        task: name of the task.
        spans: for each roll the runs of heights (lowest, highest) (m) that are feasible at some angle, and of
            an arm of five joints at some pitch.
    """

    task: str
    spans: tuple[tuple[tuple[float, float], ...], ...]


class Exclusion(NamedTuple):
    """Tasks that no grasp serves together, though it serves any fewer of them.

    Attributes:
        tasks: their names.
        apart: the smallest spread (m) of heights, at one roll (and pitch), that serves each; None if they
            share none or one of them cannot be done at all.
    """

    tasks: tuple[str, ...]
    apart: float | None


class Shared(NamedTuple):
    """Tasks that one grasp serves, and where the object is set down afterwards.

    Attributes:
        tasks: names of consecutive tasks.
        set_down: name of the task at whose pose it is grasped anew, None after the last.
    """

    tasks: tuple[str, ...]
    set_down: str | None


@dataclass(frozen=True)
class Conflict:
    """Why no grasp serves a sequence; as text, one line.

    Attributes:
        exclusions: the smallest sets of tasks that exclude each other, all of one size.
        heights: of every task, in their order.
        regrasps: the fewest grasps that solve it; empty if no number does, None if that was not asked.
        kept: what all tasks have in common beside the height, in words.
    """

    exclusions: tuple[Exclusion, ...]
    heights: tuple[TaskHeights, ...]
    regrasps: tuple[Shared, ...] | None
    kept: str = "roll"

    def __str__(self) -> str:
        names, apart = self.exclusions[0]
        if len(names) == 1:
            return f"no grasp is feasible in task {names[0]}"
        gap = f"they share no {self.kept}" if apart is None else f"they are {100 * apart:.1f} cm apart"
        more = f" (one of {len(self.exclusions)} such sets)" if len(self.exclusions) > 1 else ""
        spans = {task.task: task.spans for task in self.heights}
        parts = [f"{name} allows {_in_words(spans[name])}" for name in names]
        if self.regrasps is not None:
            parts.append(_regrasps_in_words(self.regrasps))
        return f"no grasp serves {' and '.join(names)}{more}: {gap}; {'; '.join(parts)}"


class ConflictError(NoPlanError):
    """No grasp serves a sequence of tasks.

    Attributes:
        conflict: which tasks exclude each other, and what would help.
    """

    def __init__(self, conflict: Conflict) -> None:
        super().__init__(str(conflict))
        self.conflict = conflict


def find_conflict(maps: Sequence[FeasibilityMap], resting: Sequence[int] | None = None) -> Conflict:
    """Return why no grasp serves all tasks, which must be so.

    Args:
        maps: the map of every task, in order.
        resting: indices of tasks in which the object stands on something, to say where a regrasp
            helps; None where nothing is regrasped.
    """
    exclusions = [
        Exclusion(tuple(maps[k].task for k in members), height_gap([maps[k] for k in members]))
        for members in smallest_conflicts(maps)
    ]
    segments = [] if resting is None else fewest_regrasps(maps, resting) or []
    shared = [
        Shared(
            tuple(maps[k].task for k in range(segment.first, segment.last + 1)),
            None if segment.set_down is None else maps[segment.set_down].task,
        )
        for segment in segments
    ]
    heights = [TaskHeights(m.task, tuple(_spans(m, roll) for roll in range(len(ROLLS)))) for m in maps]
    kept = "roll and pitch" if maps[0].pitches else "roll"
    return Conflict(tuple(exclusions), tuple(heights), None if resting is None else tuple(shared), kept)


def _spans(m: FeasibilityMap, roll: int) -> tuple[tuple[float, float], ...]:
    rows = np.flatnonzero(allowed(m)[roll :: len(ROLLS)].any(axis=0))
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []
    return tuple((float(m.manifold.h[run[0]]), float(m.manifold.h[run[-1]])) for run in runs)


def _in_words(spans: Sequence[Sequence[tuple[float, float]]]) -> str:
    """Say which heights (cm) are allowed, for each roll."""
    parts = []
    for angle, runs in zip(ROLLS, spans, strict=True):
        texts = [f"{100 * low:.1f} to {100 * high:.1f} cm" for low, high in runs]
        parts.append(f"{' and '.join(texts) or 'nothing'} at roll {np.rad2deg(angle):.0f}°")
    return ", ".join(parts)


def _regrasps_in_words(shared: Sequence[Shared]) -> str:
    """Say which tasks share a grasp, and where the object is set down."""
    if not shared:
        return "no regrasp helps"
    parts = [" and ".join(p.tasks) + (f", set down at {p.set_down}" if p.set_down else "") for p in shared]
    return "a new grasp for each part does: " + "; ".join(parts)
