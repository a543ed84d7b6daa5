"""Several hands on one object: Algorithm 3 of the paper, by hill climbing over handprints.

Two misprints of the printed listing are put right: the random start must be feasible for its
arm, and the hand moves in the best direction that was found, not in the last that was tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.planners.sequential import check_same_grid
from symgrasp.progress import Progress
from symgrasp.robot.handprint import Handprint
from symgrasp.robot.robot import Arm

__all__ = ["Climb", "ClimbStep", "Placement", "hill_climb", "print_overlap"]

Count = Callable[[Sequence[Cell]], int]
"""How many collisions there are with every hand at its cell: what the climb brings down."""

BodiesFree = Callable[[Sequence[Cell]], bool]
"""Whether the whole robots are free of each other with every arm at the witness of its cell."""


@dataclass(frozen=True)
class Climb:
    """Limits of the search.

    Attributes:
        restarts: MAX_RESTARTS of the listing.
        iterations: MAX_ITERS of the listing.
    """

    restarts: int = 100
    iterations: int = 200


@dataclass(frozen=True)
class Placement:
    """A cell for every arm, and what it took to find them.

    Attributes:
        cells: one cell an arm, in the order of the maps.
        restarts: restarts begun.
        iterations: moves considered, over all restarts.
        counted: times that collisions were counted.
        body_checks: times the whole robots were checked.
    """

    cells: tuple[Cell, ...]
    restarts: int
    iterations: int
    counted: int
    body_checks: int


class ClimbStep(NamedTuple):
    """Where the hands are at one moment of a climb.

    Attributes:
        restart: index of the restart.
        cells: one cell an arm.
        collisions: what is counted there; where it is 0 the whole robots were checked.
    """

    restart: int
    cells: tuple[Cell, ...]
    collisions: int


def hill_climb(
    maps: Sequence[FeasibilityMap],
    arms: Sequence[Arm],
    bodies_free: BodiesFree,
    seed: int,
    limits: Climb | None = None,
    progress: Progress | None = None,
    count: Count | None = None,
    trace: list[ClimbStep] | None = None,
) -> Placement:
    """Place every arm's hand on a feasible cell so that nothing is counted any more: Algorithm 3.

    Args:
        maps: one map an arm, all over the same grid.
        arms: the arms, in the same order.
        bodies_free: asked once the prints are apart; if it says no, the search restarts.
        seed: of the random choices; the same seed gives the same placement.
        limits: how long to search.
        progress: called with the share of restarts used; may raise `Cancelled`.
        count: what to count; the cells that handprints share if None.
        trace: receives every step in turn, whether anything is found or not.

    Raises:
        NoPlanError: nothing found within the limits, or an arm has no feasible cell.
        InputError: the grids differ.
    """
    check_same_grid(maps)
    limits = limits or Climb()
    starts = [np.argwhere(m.feasible) for m in maps]
    for m, cells in zip(maps, starts, strict=True):
        if not len(cells):
            raise NoPlanError(f"{m.arm} has no feasible cell in task {m.task}")
    search = _Search(maps, count or _shared_cells(maps, arms))
    rng = np.random.default_rng(seed)
    iterations = body_checks = 0
    for restart in range(limits.restarts):
        cells = [Cell(*map(int, rng.choice(choices))) for choices in starts]
        for _ in range(limits.iterations):
            if progress:
                progress(restart / limits.restarts)
            collisions = search.count(cells)
            if trace is not None:
                trace.append(ClimbStep(restart, tuple(cells), collisions))
            if collisions == 0:
                body_checks += 1
                if bodies_free(cells):
                    return Placement(tuple(cells), restart + 1, iterations, search.counted, body_checks)
                break  # apart on the object, but the arms meet: start elsewhere
            iterations += 1
            arm = int(rng.integers(len(cells)))
            cells[arm] = search.best_neighbour(cells, arm)
    reason = "the arms always met" if body_checks else "the handprints always overlapped"
    raise NoPlanError(f"no placement of {len(maps)} hands found in {limits.restarts} restarts: {reason}")


def print_overlap(prints: Sequence[Handprint], columns: Sequence[int]) -> int:
    """Return how many cells the prints at these columns share, summed over all pairs."""
    return sum(
        prints[a].overlap(prints[b], columns[b] - columns[a])
        for a in range(len(prints))
        for b in range(a + 1, len(prints))
    )


def _shared_cells(maps: Sequence[FeasibilityMap], arms: Sequence[Arm]) -> Count:
    grid = maps[0].manifold
    print_of = cache(lambda arm, roll, row: arms[arm].handprint(grid, row, roll))

    def count(cells: Sequence[Cell]) -> int:
        prints = [print_of(arm, cell.roll, cell.row) for arm, cell in enumerate(cells)]
        return print_overlap(prints, [cell.column for cell in cells])

    return count


class _Search:
    """Moves between cells, and how often collisions were counted."""

    def __init__(self, maps: Sequence[FeasibilityMap], count: Count) -> None:
        self.maps = maps
        self.counted = 0
        self._count = count

    def count(self, cells: Sequence[Cell]) -> int:
        self.counted += 1
        return self._count(cells)

    def best_neighbour(self, cells: Sequence[Cell], arm: int) -> Cell:
        """Return the feasible neighbour of an arm's cell with the fewest collisions, or the cell."""
        roll, row, column = cells[arm]
        heights, angles = self.maps[arm].feasible.shape[1:]
        best, fewest = cells[arm], np.inf
        for dh, dtheta in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            cell = Cell(roll, row + dh, (column + dtheta) % angles)
            if not 0 <= cell.row < heights or not self.maps[arm].feasible[cell]:
                continue
            count = self.count([*cells[:arm], cell, *cells[arm + 1 :]])
            if count < fewest:
                best, fewest = cell, count
        return best
