"""A map whose cells that may be mixed are split, again and again, down to a resolution: a quadtree.

Every part is judged at its middle like a cell, and proven to hold as a whole where that can be. What is
proven is not split any more; what is not at the resolution either is the error of the areas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from symgrasp.feasibility.margins import way_to_unproven
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array
from symgrasp.reason import Reason

__all__ = ["Area", "Refined", "merged_parts", "parts_of"]


@dataclass(frozen=True)
class Area:
    """Which share of a map is feasible.

    Attributes:
        share: share of the parts whose middle is feasible.
        least: share that is proven to be feasible.
        most: share that is not proven to be infeasible.
    """

    share: float
    least: float
    most: float

    def __str__(self) -> str:
        """Return the shares in per cent."""
        low, high = 100 * self.least, 100 * self.most
        return f"{100 * self.share:.1f} %, proven {low:.1f} to {high:.1f} %"


@dataclass(frozen=True, eq=False)
class Refined:
    """A map down to a resolution; parts of proven cells and their parts have what is proven of these.

    Attributes:
        manifold: the grid of the smallest parts; it cuts the cells of the map into whole parts.
        reason: (R, H, A) uint8 of `Reason`, in the middle of the part, or of the larger part that is proven.
        certified: (R, H, A) bool, whether it is proven to be so all over.
    """

    manifold: Manifold
    reason: np.ndarray
    certified: np.ndarray

    def __post_init__(self) -> None:
        self.reason.setflags(write=False)
        self.certified.setflags(write=False)

    @cached_property
    def feasible(self) -> np.ndarray:
        """(R, H, A) bool, in the middles of the parts."""
        return self.reason == Reason.FEASIBLE

    @property
    def area(self) -> Area:
        """The feasible share of the map."""
        proven = self.certified
        return Area(
            float(self.feasible.mean()),
            float((self.feasible & proven).mean()),
            1.0 - float((~self.feasible & proven).mean()),
        )

    def margins(self, grid: Manifold) -> Array:
        """Return how far (R, H, A, 2) along (m) and around (rad) all is proven feasible from cells' centres.

        Zero where the surroundings of the centre are not proven; half a turn is the most there is around.
        """
        whole = self.feasible & self.certified
        along = way_to_unproven(whole.swapaxes(1, 2), grid.angles, grid.heights, False).swapaxes(1, 2)
        around = way_to_unproven(whole, grid.heights, grid.angles, True)
        fine = self.manifold
        return np.stack([along * fine.dh, np.minimum(around * fine.dtheta, np.pi)], axis=-1)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data for JSON: the grid, by roll, height and angle the values, and the areas."""
        area = self.area
        return {
            "heights": self.manifold.heights,
            "angles": self.manifold.angles,
            "reason": self.reason.tolist(),
            "certified": self.certified.tolist(),
            "area": {"feasible": area.share, "least": area.least, "most": area.most},
        }

    def shift(self, manifold: Manifold, cells: int) -> Refined:
        """Return it with the cells of the map rolled around by so many, over a map on another grid."""
        own = self.manifold
        parts = own.angles // manifold.angles
        rolled = [np.roll(a, -cells * parts, axis=2) for a in (self.reason, self.certified)]
        return Refined(replace(own, theta_start=manifold.theta_start), *rolled)

    def masked(self, keep: np.ndarray) -> Refined:
        """Return it with the parts of all cells outside ``keep`` (R, H, A) neither feasible nor proven."""
        kept = parts_of(keep, self.reason.shape)
        reason = np.where(kept | ~self.feasible, self.reason, Reason.UNREACHABLE).astype(np.uint8)
        return Refined(self.manifold, reason, self.certified & kept)


def merged_parts(parts: Sequence[Refined]) -> Refined:
    """Return what several maps of one grid say together: feasible is what any of them says is feasible."""
    whole = np.logical_or.reduce([p.feasible & p.certified for p in parts])
    none = np.logical_and.reduce([~p.feasible & p.certified for p in parts])
    reason = np.maximum.reduce([p.reason for p in parts])
    return Refined(parts[0].manifold, reason, np.logical_or(whole, none))


def parts_of(cells: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return values (R, H, A) of cells for the parts of a finer grid of a shape."""
    return cells.repeat(shape[1] // cells.shape[1], axis=1).repeat(shape[2] // cells.shape[2], axis=2)
