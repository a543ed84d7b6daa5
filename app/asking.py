"""What the page asks its worker for by itself, and what the worker is busy with."""

from __future__ import annotations

from dataclasses import dataclass

from app.values import MapRequest

__all__ = ["Busy", "Request"]

Request = MapRequest
"""What follows from the state and is computed unasked."""


@dataclass(frozen=True)
class Busy:
    """A computation under way.

    Attributes:
        ticket: number of the computation; the last words of an earlier one do not count.
        label: what is computed.
        request: what it answers, None for what a person asked for.
        share: how much of it is done.
        late: whether it takes so long that the page says so and newer requests interrupt it.
    """

    ticket: int
    label: str
    request: Request | None = None
    share: float = 0.0
    late: bool = False

    def goes_first(self, request: Request) -> bool:
        """Whether a request waits for this computation instead of taking its place.

        A quick map is finished even if the object has moved on meanwhile. If every movement
        interrupted it, none would arrive until the drag ends.
        """
        if self.request is None or self.request == request:
            return True
        return not self.late and self.request.differs_in_pose(request)
