"""Cells of a map, and the witness and margins of a feasible one."""

from __future__ import annotations

from typing import NamedTuple

from symgrasp.poses import Array

__all__ = ["CLEARANCE_LIMIT", "Cell", "Margin", "Window", "Witness", "rests_on_samples"]


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


class Window(NamedTuple):
    """An interval of the redundancy φ on which a branch holds a grasp.

    Attributes:
        branch: branch of the closed form.
        low: where it begins (rad).
        high: where it ends (rad).
        whole: whether the clearances along it allow no collision in between, nor the joints a limit, by what
            is usual for how arms move with φ. Else that is so at values of φ at most 0.001 rad apart, 0.005
            with a retreat or where the robot could fall, on parts of it.
    """

    branch: int
    low: float
    high: float
    whole: bool

    @property
    def width(self) -> float:
        """Its width (rad)."""
        return self.high - self.low


def rests_on_samples(count: int) -> str:
    """Say what it rests on that a cell is infeasible at so many samples of the redundancy.

    Arms of six joints have one: all of their configurations.
    """
    return "1 redundancy sample" if count == 1 else f"{count} redundancy samples"
