"""What the widgets of a page ask its session for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ..state.plan_results import PlanKind
from ..state.state import State

__all__ = ["Actions", "Change", "PlanActions"]

Change = Callable[[State], State]


class PlanActions(Protocol):
    """What widgets ask for about plans."""

    def run(self, kind: PlanKind, method: str = "") -> None:
        """Run a planner, with the method chosen for it unless another is asked for."""

    def more(self) -> None:
        """List further plans."""

    def open_file(self, name: str, content: bytes) -> None:
        """Verify a plan that was uploaded, and show it if it holds."""

    def download(self, format_name: str) -> None:
        """Send the plan to the browser in a format."""


class Actions(Protocol):
    """What widgets ask for; answered at once, computing goes on elsewhere."""

    @property
    def plans(self) -> PlanActions:
        """What they ask for about plans."""
        ...

    def change(self, change: Change, origin: str = "") -> None:
        """Apply a change to the state; widgets of that origin are not written back."""

    def open_scene(self, name: str) -> None:
        """Load another scene."""

    def load_scene(self, name: str, content: bytes) -> None:
        """Open the scene in a file."""

    def save_scene(self) -> None:
        """Send the scene as a file."""

    def choose_object(self, option: str) -> None:
        """Put another object into the scene."""

    def upload(self, name: str, content: bytes, scale: float) -> None:
        """Measure a mesh and put the object into the scene."""

    def choose_hand(self, hand: str) -> None:
        """Mount another hand on the chosen arm."""

    def stop_or_retry(self) -> None:
        """Stop the computation, or begin the one that was stopped again."""

    def save_map(self, kind: str) -> None:
        """Send the map as it is shown as a picture."""

    def make_link(self) -> None:
        """Put what is shown into an address."""

    def save_view(self) -> None:
        """Send the 3D view as a file."""
