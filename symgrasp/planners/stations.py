"""What the arms of a sequence can do at each turn of the object, with each value of a torso they share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.planners.sequential import clearance_steps, surface_margin
from symgrasp.poses import Array

__all__ = ["SharedTorso", "Station", "Turn", "best_turns"]


class SharedTorso(NamedTuple):
    """A torso that several arms of a task share: it has one value for all of them.

    Attributes:
        visit: index of the visit of the task.
        maps: arm → its map of the task at every sample of the torso.
    """

    visit: int
    maps: Mapping[str, Sequence[FeasibilityMap]]


class Turn(NamedTuple):
    """A turn of the object at which all arms of a group of tasks can hold it.

    Attributes:
        columns: by how many columns.
        margin: the smallest margin (m) of those arms.
        clearance: their smallest clearance (m).
        torsos: index of each torso that they share → its sample.
    """

    columns: int
    margin: float
    clearance: float
    torsos: Mapping[int, int]


class Station:
    """Holds that have one turn of the object and, where there is one, one value of a torso.

    L lines (roll · heights + row), A angles; T samples of the torso, 1 where none is shared.

    Args:
        group: index of the group of tasks, which have one turn.
        torso: index of the torso that the holds share, None where they share none.
        maps: hold → its maps of the tasks of the group (., T), all over the same grid.

    Attributes:
        group: that group.
        torso: that torso.
        margins: hold → (T, L, A) margins (m), the smallest of its tasks', below zero where infeasible.
    """

    def __init__(
        self, group: int, torso: int | None, maps: Mapping[int, Sequence[Sequence[FeasibilityMap]]]
    ) -> None:
        self.group, self.torso, self._maps = group, torso, maps
        self.margins = {
            hold: np.min([[_by_line(_margin(m)) for m in samples] for samples in tasks], axis=0)
            for hold, tasks in maps.items()
        }

    @cached_property
    def clearances(self) -> dict[int, Array]:
        """Hold → (T, L, A) clearances (m), the smallest of its tasks'."""
        return {
            hold: np.min([[_by_line(m.clearance) for m in samples] for samples in tasks], axis=0)
            for hold, tasks in self._maps.items()
        }

    def turned(self, values: Mapping[int, Array], cells: Sequence[Cell], heights: int) -> Array:
        """Return the smallest of the holds' values (A, T) at their cells, by the turn and the torso."""
        found = [
            np.roll(values[hold][:, cell.roll * heights + cell.row], -cell.column, axis=-1)
            for hold, cell in enumerate(cells)
            if hold in values
        ]
        return np.min(found, axis=0).T


def best_turns(stations: Sequence[Station], cells: Sequence[Cell], heights: int, enough: float) -> list[Turn]:
    """Return the turns, with values of the torsos, at which all stations of a group are feasible.

    Best margin first; margins from ``enough`` (m) on count as equal, and of equal ones the larger clearance
    comes first, by `clearance_steps`; then the larger margin, then the smaller turn.
    """
    margins = [station.turned(station.margins, cells, heights) for station in stations]
    clearances = [station.turned(station.clearances, cells, heights) for station in stations]
    turns = []
    for samples in product(*(range(m.shape[1]) for m in margins)):
        margin = np.min([m[:, t] for m, t in zip(margins, samples, strict=True)], axis=0)
        clearance = np.min([c[:, t] for c, t in zip(clearances, samples, strict=True)], axis=0)
        torsos = {s.torso: t for s, t in zip(stations, samples, strict=True) if s.torso is not None}
        turns += [
            Turn(int(k), float(margin[k]), float(clearance[k]), torsos) for k in np.flatnonzero(margin >= 0)
        ]

    def order(turn: Turn) -> tuple[float, int, float]:
        return -min(turn.margin, enough), -int(clearance_steps(turn.clearance)), -turn.margin

    return sorted(turns, key=order)


def _margin(m: FeasibilityMap) -> Array:
    return np.where(m.feasible, surface_margin(m), -1.0)


def _by_line(values: Array) -> Array:
    return values.reshape(-1, values.shape[-1])
