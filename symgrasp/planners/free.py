"""Placements for which the whole robots are free of each other, best first."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.planners.configurations import ConfigurationFinder
from symgrasp.planners.holding import Holding, HoldingSearch
from symgrasp.planners.sequential import surface_margin
from symgrasp.planners.stations import Turn
from symgrasp.progress import Progress
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.robot.posture import ease

__all__ = ["FreePlacement", "FreePlacements", "Step"]


HALFWAY = 100
"""After so many placements the progress is at a half: how many there will be is not known beforehand."""


class Step(NamedTuple):
    """A task with everything decided.

    Attributes:
        turn: columns that the object is turned by.
        configurations: of the task's arms, free together.
        cells: where on its map each arm's grasp is then.
        maps: the map of each arm, that at the value of its torso where it shares one.
    """

    turn: int
    configurations: Sequence[ArmConfiguration]
    cells: Sequence[Cell]
    maps: Sequence[FeasibilityMap]


class FreePlacement(NamedTuple):
    """A grasp for every hold, with configurations in which nothing collides.

    Attributes:
        score: what it reaches (m): `Holding.score` at the turns that are free.
        grasps: of every hold.
        steps: the tasks in order.
    """

    score: float
    grasps: tuple[Cell, ...]
    steps: list[Step]


class _Attempt(NamedTuple):
    """A placement whose next best turns are still to be tried; the smallest is the most promising one."""

    loss: float
    number: int
    holding: Holding
    choices: Iterator[tuple[float, list[Step] | None]]


class FreePlacements:
    """Lists the placements for which there are configurations in which nothing collides, best first.

    Complete, so the first is the best, and an empty list is a proof. Where nothing is free at the
    best turns of a placement, it waits until no other placement can reach more than its next
    best turns do. Of placements of several hands that are like a listed one but for neighbouring
    cells, none is listed.

    Args:
        search: the search for placements.
        finders: find the configurations of each task, in order.
        progress: called with a share that rises with what was tried, see `HALFWAY`; may raise `Cancelled`.

    Attributes:
        tried: how many placements were tried so far.
    """

    def __init__(
        self, search: HoldingSearch, finders: Sequence[ConfigurationFinder], progress: Progress | None = None
    ) -> None:
        self.tried = 0
        self._search, self._finders, self._progress = search, finders, progress

    def __iter__(self) -> Iterator[FreePlacement]:
        """Yield the placements; each is searched for when it is asked for."""
        waiting: list[_Attempt] = []
        listed: list[FreePlacement] = []
        placements = self._search.best_first()
        bound = np.inf
        while True:
            self._trying()
            if waiting and -waiting[0].loss >= bound:
                attempt = heapq.heappop(waiting)
                if self._is_listed(attempt.holding, listed):
                    continue
                reached, steps = next(attempt.choices, (None, None))
                if steps:
                    assert reached is not None
                    listed.append(FreePlacement(reached, attempt.holding.cells, steps))
                    yield listed[-1]
                elif reached is not None:
                    heapq.heappush(waiting, attempt._replace(loss=-reached))
                continue
            holding = next(placements, None)
            if holding:
                bound = holding.score
                if not self._is_listed(holding, listed):
                    self.tried += 1
                    attempt = _Attempt(-holding.score, self.tried, holding, self._choose_turns(holding))
                    heapq.heappush(waiting, attempt)
            elif waiting:
                bound = -np.inf
            else:
                return

    def _trying(self) -> None:
        if self._progress:
            self._progress(self.tried / (self.tried + HALFWAY))

    def _is_listed(self, holding: Holding, listed: Sequence[FreePlacement]) -> bool:
        angles = self._finders[0].maps[0].manifold.angles
        return len(holding.cells) > 1 and any(_near(holding.cells, p.grasps, angles) for p in listed)

    def _choose_turns(self, holding: Holding) -> Iterator[tuple[float, list[Step] | None]]:
        """Choose a free turn for group after group of tasks.

        What is free may be a configuration in which an arm stands less easily than at the witness of its
        cell, which the score is of. Then turns are tried on that might reach more.

        Yields:
            The score (m) with None whenever it falls, and at last the score with the steps; nothing more
            where a group has no free turn.
        """
        reached = holding.score
        steps: list[Step] = []
        for group, members in enumerate(self._search.groups):
            best: tuple[float, list[Step]] | None = None
            for turn in self._search.turns(holding.cells, group, reached):
                if best and min(turn.margin, reached) <= best[0]:
                    break
                if turn.margin < reached:
                    reached = turn.margin
                    yield reached, None
                found = [self._step(k, holding.cells, turn) for k in members]
                free = [step for step in found if step]
                if len(free) == len(members):
                    own = min(reached, *(_margin(step) for step in free))
                    best = max(best or (own, free), (own, free), key=lambda b: b[0])
            if best is None:
                return
            if best[0] < reached:
                reached = best[0]
                yield reached, None
            steps += best[1]
        yield reached, steps

    def _step(self, k: int, grasps: Sequence[Cell], turn: Turn) -> Step | None:
        """Return task k with the object at a turn, or None if nothing is free there."""
        finder = self._finders[k]
        angles = finder.maps[0].manifold.angles
        held = {run.arm: cell for run, cell in zip(self._search.holds, grasps, strict=True) if k in run.tasks}
        cells = [held[arm.name].turned(turn.columns, angles) for arm in finder.arms]
        torso = {
            arm: sample
            for t, sample in turn.torsos.items()
            if self._search.torsos[t].visit == k
            for arm in self._search.torsos[t].maps
        }
        configurations = finder.find(cells, torso, trying=self._trying)
        if configurations:
            return Step(turn.columns, configurations, cells, finder.maps_at(torso))
        for a, b in finder.excluding(cells, torso):
            self._search.rule_out(k, (finder.arms[a].name, cells[a]), (finder.arms[b].name, cells[b]))
        return None


def _margin(step: Step) -> float:
    """Return the smallest margin (m) of the arms of a step, as easily as they stand in it if that counts."""
    return min(
        float(surface_margin(m, None if m.ease is None else ease(c.arm, c.q))[cell])
        for c, cell, m in zip(step.configurations, step.cells, step.maps, strict=True)
    )


def _near(a: Sequence[Cell], b: Sequence[Cell], angles: int) -> bool:
    """Whether every grasp has the same roll in both and is at most a row and a column away."""
    return all(
        x.roll == y.roll and abs(x.row - y.row) <= 1 and (x.column - y.column + 1) % angles <= 2
        for x, y in zip(a, b, strict=True)
    )
