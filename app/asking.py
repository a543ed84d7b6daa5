"""What the page asks its worker for by itself, and what the worker is busy with."""

from __future__ import annotations

from dataclasses import dataclass

from app.values import MapRequest
from symgrasp.explain import Explanation
from symgrasp.feasibility import Cell, FeasibilityMap

__all__ = ["Busy", "Check", "CheckRequest", "ExplainRequest", "Explained", "Request"]


@dataclass(frozen=True)
class CheckRequest:
    """Compute the map of the turned object from scratch, to compare it with the shifted one.

    Attributes:
        map: the map that is shifted.
        delta: by how much (rad).
    """

    map: MapRequest
    delta: float

    def differs_in_pose(self, other: object) -> bool:
        """Whether the other one only turns the object further."""
        return isinstance(other, CheckRequest) and self.map == other.map


@dataclass(frozen=True)
class ExplainRequest:
    """Judge every candidate of a cell.

    Attributes:
        map: the map.
        cell: a cell of it, before it is shifted.
    """

    map: MapRequest
    cell: Cell

    def differs_in_pose(self, other: object) -> bool:
        """Never: what becomes of another cell is of no use."""
        return False


Request = MapRequest | CheckRequest | ExplainRequest
"""What follows from the state and is computed unasked."""


@dataclass(frozen=True, eq=False)
class Check:
    """A map computed from scratch, over the grid of the shifted one, and how many cells differ."""

    request: CheckRequest
    map: FeasibilityMap
    differing: int


@dataclass(frozen=True, eq=False)
class Explained:
    """What becomes of the candidates of a cell."""

    request: ExplainRequest
    explanation: Explanation


@dataclass(frozen=True)
class Busy:
    """A computation under way.

    Attributes:
        ticket: number of the computation; the last words of an earlier one do not count.
        label: what is computed.
        request: what it answers, None for what a person asked for.
        share: how much of it is done.
        late: whether it takes so long that the page says so and newer requests interrupt it.
        compiling: whether code that it needs had to be compiled, which may happen in several pieces.
    """

    ticket: int
    label: str
    request: Request | None = None
    share: float = 0.0
    late: bool = False
    compiling: bool = False

    def goes_first(self, request: Request) -> bool:
        """Whether a request waits for this computation instead of taking its place.

        A quick map is finished even if the object has moved on meanwhile. If every movement
        interrupted it, none would arrive until the drag ends.
        """
        if self.request is None or self.request == request:
            return True
        return not self.late and self.request.differs_in_pose(request)
