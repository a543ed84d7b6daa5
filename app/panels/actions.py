"""The interface through which widgets act on their session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import viser

from ..state.plans.plan_results import PlanKind
from ..state.state import State

__all__ = ["Actions", "Change", "PlanActions", "SurveyActions"]

Change = Callable[[State], State]
"""Returns the new state, or raises a `SymgraspError`, which the page shows."""


class PlanActions(Protocol):
    """Actions about plans."""

    def run(self, kind: PlanKind, method: str = "") -> None:
        """Run a planner, with the method chosen on the page unless one is given."""

    def list_more(self) -> None:
        """Compute further plans and add them to the list."""

    def find_motion(self) -> None:
        """Find the motion of the plan that is shown, or of the first one after it that has one."""

    def open_file(self, name: str, content: bytes) -> None:
        """Verify an uploaded plan file, and show the plan if it holds; or open the scene, if it is one."""

    def download(self, format_name: str) -> None:
        """Send the plan to the browser in a format, a key of `app.files.plan_formats.FORMATS`."""


class SurveyActions(Protocol):
    """Actions about surveys, which run in the background."""

    def run(self) -> None:
        """Run the survey of what is shown, in place of the one under way."""

    def stop(self) -> None:
        """Stop the survey under way; what it has found stays."""


class Actions(Protocol):
    """All actions; they return at once, computations run on the thread of the job queue."""

    @property
    def plans(self) -> PlanActions:
        """The actions about plans."""
        ...

    @property
    def surveys(self) -> SurveyActions:
        """The actions about surveys."""
        ...

    def change(self, change: Change, origin: str = "") -> None:
        """Apply a change to the state.

        Args:
            change: the change.
            origin: what changed it: "inputs", "gizmo", "map", "scrub" or "play"; widgets of that origin
                are not written back.
        """

    def limit_uploads(self, button: viser.GuiUploadButtonHandle, limit: int) -> None:
        """Let a button take files of a size (bytes); a larger one is refused when it is announced."""

    def open_scene(self, name: str) -> None:
        """Open a scene by its name in the menu."""

    def upload_scene(self, name: str, content: bytes) -> None:
        """Open the scene, or the plan, in an uploaded file with this content."""

    def save_scene(self) -> None:
        """Send the scene to the browser as a YAML file."""

    def choose_object(self, option: str) -> None:
        """Replace the scene's object by an option of the menu."""

    def upload_object(self, name: str, content: bytes, scale: float, tolerance: float | None) -> None:
        """Measure an uploaded mesh and put the object into the scene.

        Args:
            name: of the file.
            content: of the file.
            scale: metres in one unit of the mesh.
            tolerance: largest deviation from symmetry (m), None for the default.
        """

    def measure_again(self, scale: float, tolerance: float | None) -> None:
        """Measure the mesh that was refused last with another unit or tolerance; nothing if none was.

        Args:
            scale, tolerance: as of `upload_object`.
        """

    def choose_robot(self, option: str) -> None:
        """Replace the robot of the chosen arm by an option of the menu."""

    def upload_robot(self, name: str, content: bytes) -> None:
        """Put the robot in an uploaded archive with this content in the place of that of the chosen arm."""

    def choose_tool(self, link: str) -> None:
        """Put the hand of the chosen arm on another link."""

    def choose_hand(self, option: str) -> None:
        """Hold with another hand on the chosen arm, an option of the menu."""

    def stop_or_retry(self) -> None:
        """Cancel the computation under way, or restart the one that was cancelled or failed."""

    def save_map(self, kind: str) -> None:
        """Send the map that is shown as a picture, in a format of `app.render.map_picture.FORMATS`."""

    def make_link(self) -> None:
        """Make a link that opens the page as it is."""

    def save_3d_view(self) -> None:
        """Send the 3D view as an HTML file."""
