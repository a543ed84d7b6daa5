"""The best placement for which the whole robots are free of each other."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility import Cell, Progress
from symgrasp.planners.holding import Holding, HoldingSearch
from symgrasp.planners.postures import Posture, Postures

__all__ = ["Step", "best_free"]


class Step(NamedTuple):
    """A task that is settled.

    Attributes:
        turn: columns that the object is turned by.
        postures: of the task's arms, free together.
        cells: where on its map each arm's grasp is then.
    """

    turn: int
    postures: Sequence[Posture]
    cells: Sequence[Cell]


def best_free(
    search: HoldingSearch, desks: Sequence[Postures], progress: Progress | None = None
) -> tuple[int, list[Step] | None]:
    """Find the best placement for which there are configurations in which nothing collides.

    Where nothing is free at the best turns of a placement, it waits until no other placement
    promises more than what its next best turns reach.

    Args:
        search: the search for placements.
        desks: finds the configurations of each task.
        progress: called now and then; may raise `Cancelled`.

    Returns:
        How many placements were tried, and the steps of the best; None if there is none.
    """
    waiting: list[tuple[float, int, Iterator[tuple[float, list[Step] | None]]]] = []
    placements = search.best_first()
    tried, promised = 0, np.inf
    while True:
        if progress:
            progress(1.0)  # how many there are is not known beforehand; this lets the caller cancel
        if waiting and -waiting[0][0] >= promised:
            _, number, attempt = heapq.heappop(waiting)
            reached, settled = next(attempt, (None, None))
            if settled:
                return tried, settled
            if reached is not None:
                heapq.heappush(waiting, (-reached, number, attempt))
            continue
        holding = next(placements, None)
        if holding:
            tried, promised = tried + 1, holding.score
            heapq.heappush(waiting, (-holding.score, tried, _settle(search, desks, holding)))
        elif waiting:
            promised = -np.inf
        else:
            return tried, None


def _settle(
    search: HoldingSearch, desks: Sequence[Postures], holding: Holding
) -> Iterator[tuple[float, list[Step] | None]]:
    """Settle a placement group by group; yield what it reaches whenever that falls, and the steps at last."""
    reached = holding.score
    steps: list[Step] = []
    for group, members in enumerate(search.groups):
        for turn in search.turns(holding.cells, group, reached):
            if turn.margin < reached:
                reached = turn.margin
                yield reached, None
            found = [_step(search, desks[k], k, holding.cells, turn.columns) for k in members]
            free = [step for step in found if step]
            if len(free) == len(members):
                steps += free
                break
        else:
            return
    yield reached, steps


def _step(search: HoldingSearch, desk: Postures, k: int, grasps: Sequence[Cell], turn: int) -> Step | None:
    """Return task k with the object at a turn, or None if nothing is free there."""
    angles = desk.maps[0].manifold.angles
    held = {run.arm: cell for run, cell in zip(search.holds, grasps, strict=True) if k in run.tasks}
    cells = [held[arm.name].turned(turn, angles) for arm in desk.arms]
    postures = desk.find(cells)
    return Step(turn, postures, cells) if postures else None
