"""Which share of the cells of maps is proven to hold as a whole, on coarse and fine grids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from symgrasp.feasibility.create import MapMaker
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

__all__ = ["FACTORS", "CellShares", "measure_cells"]

FACTORS = (1, 2)
"""By how much the grids are finer than a scene's own, along and around."""


@dataclass(frozen=True)
class CellShares:
    """What is proven of the map of a scene's first task and arm on a grid.

    Attributes:
        heights: number of cells of the grid along the axis.
        angles: number of cells around it.
        feasible: number of feasible cells.
        whole: number of those that are proven to be feasible as a whole.
        infeasible: number of infeasible cells.
        none: number of those that are proven to be infeasible as a whole.
        ratio: processor time of the map with proofs, divided by that without.
    """

    heights: int
    angles: int
    feasible: int
    whole: int
    infeasible: int
    none: int
    ratio: float


def measure_cells(scene: Scene, factors: Sequence[int] = FACTORS) -> Iterator[CellShares]:
    """Measure the map of a scene's first task and arm on grids finer than its own by some factors."""
    for factor in factors:
        own = scene.settings
        gridded = scene.with_settings(heights=own.heights * factor, angles=own.angles * factor)
        with open_world(gridded) as world:
            maker = MapMaker(world)
            maker.map(certify=True)  # builds what maps of the arm have in common
            start = process_time()
            maker.map(certify=False)
            middle = process_time()
            m = maker.map(certify=True)
            ratio = (process_time() - middle) / (middle - start)
        proven = np.zeros_like(m.feasible) if m.certified is None else m.certified
        yield CellShares(
            heights=m.manifold.heights,
            angles=m.manifold.angles,
            feasible=int(m.feasible.sum()),
            whole=int((proven & m.feasible).sum()),
            infeasible=int((~m.feasible).sum()),
            none=int((proven & ~m.feasible).sum()),
            ratio=ratio,
        )
