"""The cells that the compiled search is given at once: those with one solver and the same pieces."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from symgrasp.engine.geometry import ArmGeometry
from symgrasp.engine.kinematics import MovingPieces
from symgrasp.ik import CompiledIK, GridSolvers, PitchedIK, Solver
from symgrasp.object.manifold import ROLLS

__all__ = ["Batch", "batches", "compiled_parts"]


class Batch(NamedTuple):
    """Cells that are searched at once.

    Attributes:
        rows: their rows.
        rolls: their rolls.
        ik: the solver of their grasps.
        compiled: that of the solver's parts that is searched.
        samples: the samples of the solver that this part has.
        order: the order in which it tries them.
        moving: the pieces that the arm moves.
    """

    rows: np.ndarray
    rolls: np.ndarray
    ik: Solver
    compiled: CompiledIK
    samples: np.ndarray
    order: np.ndarray
    moving: MovingPieces


def compiled_parts(ik: Solver) -> list[tuple[CompiledIK, np.ndarray]] | None:
    """Return the compiled solvers that make up a solver, with their samples; None if it has others."""
    parts = ik.parts if isinstance(ik, PitchedIK) else [(ik, np.arange(len(ik.phi)))]
    compiled = [(own, samples) for own, samples in parts if isinstance(own, CompiledIK)]
    return compiled if len(compiled) == len(parts) else None


def batches(solvers: GridSolvers, geometry: ArmGeometry, rows: np.ndarray, part: int) -> Iterator[Batch]:
    """Yield the cells of some rows: all at once, but of a pitched arm those with one solver and opening.

    Args:
        solvers: the solvers of the arm.
        geometry: its pieces.
        rows: the rows.
        part: which of the solvers of a pitched arm is used, see `PitchedIK.parts`; 0 for other arms.
    """
    rolls = np.arange(len(ROLLS))
    for some, these in _alike(solvers, geometry, rows) if solvers.arm.pitched else [(rows, rolls)]:
        row = int(some[0])
        ik = solvers.at(row, int(these[0]))
        parts = compiled_parts(ik)
        assert parts is not None  # else the engine does not know the arm
        if part < len(parts):
            own, samples = parts[part]
            yield Batch(some, these, ik, own, samples, _spread(len(samples)), geometry.moving_in(row))


def _alike(
    solvers: GridSolvers, geometry: ArmGeometry, rows: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return rows and rolls in groups that have one solver and the same pieces."""
    groups: dict[tuple[int, int, bytes], list[int]] = {}
    for roll in range(len(ROLLS)):
        for row in rows.tolist():
            key = (roll, id(solvers.at(row, roll)), geometry.local[row].tobytes())
            groups.setdefault(key, []).append(row)
    return [(np.array(some), np.array([roll])) for (roll, *_), some in groups.items()]


@lru_cache
def _spread(count: int) -> np.ndarray:
    """Return the indices below ``count``, each far from those before it (van der Corput's sequence).

    Neighbouring redundancy values mostly fail for the same reason, so the next try should be elsewhere.
    """
    order: dict[int, None] = {}
    k = 0
    while len(order) < count:
        k += 1
        value, base, rest = 0.0, 0.5, k
        while rest:
            value += base * (rest % 2)
            base, rest = 0.5 * base, rest // 2
        order.setdefault(int(value * count))
    return np.array(list(order), dtype=np.int64)
