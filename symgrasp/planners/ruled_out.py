"""Pairs of grasps that were found to be impossible at a turn of the object, whatever all other arms do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.planners.column_sets import doubled, doubled_words

__all__ = ["Grasp", "RuledOut", "Table"]


class Grasp(NamedTuple):
    """Where a hold is in a group of tasks: its index, its line, and its column with the object turned."""

    hold: int
    line: int
    column: int


class Table(NamedTuple):
    """What is ruled out as arrays, for n holds in G groups of tasks, L lines, A angles, and D words a set.

    Attributes:
        pair: (G, n, n) which of the P tables of rows two holds a < b have in a group, -1 if none.
        row: (P, L, L, A) by their lines and the later one's column less the earlier one's, which of the sets
            they have, -1 if none.
        left: (K, D) the earlier one's columns at which the two are not ruled out; see `column_sets`.
    """

    pair: np.ndarray
    row: np.ndarray
    left: np.ndarray


class RuledOut:
    """Pairs of grasps that are ruled out, as they are found.

    Args:
        groups: number of groups of tasks that have one turn.
        holds: number of holds.
        lines: number of lines: rolls times rows.
        angles: number of columns.
    """

    def __init__(self, groups: int, holds: int, lines: int, angles: int) -> None:
        self._count = 0
        self._angles = angles
        self._table = Table(
            np.full((groups, holds, holds), -1),
            np.empty((0, lines, lines, angles), dtype=np.int32),
            np.empty((0, doubled_words(angles)), dtype=np.uint64),
        )

    @property
    def table(self) -> Table:
        """Everything that is ruled out; arrays may be replaced by `add`."""
        return self._table

    def add(self, group: int, a: Grasp, b: Grasp) -> None:
        """Rule out that two holds have these grasps in a group of tasks."""
        a, b = sorted((a, b))
        pair, row, left = self._table
        if pair[group, a.hold, b.hold] < 0:
            pair[group, a.hold, b.hold] = len(row)
            row = np.concatenate([row, np.full((1, *row.shape[1:]), -1, dtype=np.int32)])
        at = pair[group, a.hold, b.hold], a.line, b.line, (b.column - a.column) % self._angles
        if row[at] < 0:
            if self._count == len(left):
                more = doubled(np.ones((max(64, len(left)), self._angles), dtype=bool))
                left = np.concatenate([left, more])
            row[at] = self._count
            self._count += 1
        without = doubled(np.arange(self._angles) != a.column)
        left[row[at]] &= without
        self._table = Table(pair, row, left)
