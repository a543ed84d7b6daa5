"""Cells of a map, and the witness and margins of a feasible one."""

from __future__ import annotations

from typing import NamedTuple

from symgrasp.poses import Array

__all__ = ["CLEARANCE_LIMIT", "Cell", "Margin", "Witness"]


CLEARANCE_LIMIT = 0.05
"""Clearances are measured up to this distance (m)."""


class Cell(NamedTuple):
    """A cell of a map: a grasp on the grid."""

    roll: int
    row: int
    column: int

    def turned(self, columns: int, angles: int) -> Cell:
        """Return the cell so many columns further around a grid of so many angles."""
        return self._replace(column=(self.column + columns) % angles)


class Witness(NamedTuple):
    """A configuration that proves a cell feasible.

    Attributes:
        q: (n,) joint values.
        phi: redundancy value (rad).
        sample: its index.
        branch: branch of the closed form.
        opening: opening of the hand (m).
        clearance: distance (m) that all bodies which must not touch have at least; 0 where only that
            they do not touch is known.
    """

    q: Array
    phi: float
    sample: int
    branch: int
    opening: float
    clearance: float


class Margin(NamedTuple):
    """How far a feasible cell's centre is from the nearest infeasible one, at most the whole map.

    Attributes:
        along: along the axis (m); the ends of the object count as infeasible.
        around: around it (rad).
    """

    along: float
    around: float
