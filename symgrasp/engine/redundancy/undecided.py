"""The list of candidates that the search of the redundancy leaves to PyBullet. Compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT
from symgrasp.poses import Array

__all__ = ["Undecided", "new_undecided", "note_undecided"]


class Undecided(NamedTuple):
    """Candidates of c cells that only PyBullet can decide, at most n of each.

    Where there are more, those in the middle of the narrowest parts of the range are left out, so that the
    others are spread evenly.

    Attributes:
        number: (c,) how many of a cell are listed.
        phi: (c, n) their redundancy (rad).
        branch: (c, n) their branches.
        width: (c, n) width (rad) of the part of the range that each halves.
        spacing: (c,) those that halve parts narrower than this (rad) are left out; 0 where none is.
    """

    number: np.ndarray
    phi: Array
    branch: np.ndarray
    width: Array
    spacing: Array

    def of(self, cell: int) -> tuple[Array, np.ndarray]:
        """Return the redundancy (rad) and the branches of those of a cell."""
        number = self.number[cell]
        return self.phi[cell, :number], self.branch[cell, :number]


def new_undecided(cells: int, most: int) -> Undecided:
    """Return empty lists of that many cells, for so many candidates of each."""
    return Undecided(
        number=np.zeros(cells, dtype=np.int64),
        phi=np.empty((cells, most)),
        branch=np.empty((cells, most), dtype=np.int16),
        width=np.empty((cells, most)),
        spacing=np.zeros(cells),
    )


@njit(**STRICT)
def note_undecided(undecided, i, phi, branch, width):
    """List a candidate of cell i, and leave out those of narrower parts where there is no room for it."""
    while undecided.number[i] == undecided.phi.shape[1] and width >= undecided.spacing[i]:
        _thin_out(undecided, i)
    if width < undecided.spacing[i]:
        return
    k = undecided.number[i]
    undecided.phi[i, k], undecided.branch[i, k], undecided.width[i, k] = phi, branch, width
    undecided.number[i] = k + 1


@njit(**STRICT)
def _thin_out(undecided, i):
    """Leave out the candidates of a cell that halve the narrowest parts."""
    narrowest = math.inf
    for k in range(undecided.number[i]):
        narrowest = min(narrowest, undecided.width[i, k])
    undecided.spacing[i] = 2.0 * narrowest
    kept = 0
    for k in range(undecided.number[i]):
        if undecided.width[i, k] >= undecided.spacing[i]:
            undecided.phi[i, kept], undecided.branch[i, kept] = undecided.phi[i, k], undecided.branch[i, k]
            undecided.width[i, kept] = undecided.width[i, k]
            kept += 1
    undecided.number[i] = kept
