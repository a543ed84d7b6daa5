"""What the widgets for plans ask for: planning, listing, playing, files."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Any, Protocol

from app.compute.compute_process import ComputeProcess
from app.compute.plan_service import OpenedPlan, PlanRequest
from app.state.plan_results import Kind
from app.state.state import State
from symgrasp.plan.exports import EXPORTS
from symgrasp.plan.plan import Plan
from symgrasp.progress import Progress

__all__ = ["FORMATS", "PlanActions", "SessionApi"]

FORMATS: Mapping[str, tuple[str, Callable[[Plan], str]]] = {
    "JSON": (".json", Plan.to_json),
    "CSV": (".csv", EXPORTS["csv"]),
    "Trajectory": (".trajectory.json", EXPORTS["trajectory"]),
    "TSR": (".tsr.yaml", EXPORTS["tsr"]),
}
"""What the page calls a format → ending of its files, and what writes them."""

TICK = 0.05
"""Time (s) between the pictures of a play."""


class SessionApi(Protocol):
    """What the desk needs of a browser's session."""

    @property
    def state(self) -> State | None:
        """What is shown; None before the first scene stands."""
        ...

    @property
    def lock(self) -> AbstractContextManager[bool]:
        """Held while the state changes; who holds it may change it."""
        ...

    def change(self, change: Callable[[State], State], origin: str = "") -> None:
        """Apply a change to the state."""

    def submit(self, label: str, run: Callable[[Progress], Any], done: Callable[[int, Any], None]) -> None:
        """Give the worker something to do."""

    def send(self, name: str, content: bytes) -> None:
        """Send a file to the browser."""


class PlanActions:
    """Plans for one browser.

    Args:
        office: the browser's session.
        workshop: of its worker.
    """

    def __init__(self, office: SessionApi, process: ComputeProcess) -> None:
        self.office, self._workshop = office, process
        self._ended = threading.Event()
        self._player: threading.Thread | None = None

    def close(self) -> None:
        """Play nothing any more; may be called from anywhere."""
        self._ended.set()

    def run(self, kind: Kind, method: str = "") -> None:
        """Run a planner, with the method chosen for it unless another is asked for."""
        state = self.office.state
        if state is None:
            return
        plan_results, name = state.plan_results, state.arm
        if kind == "bimanual":
            method, name = method or plan_results.hands_method, state.together
        elif kind == "sequential":
            method = method or plan_results.sequence_method
        order = PlanRequest(state.scene, kind, method, name, state.poses, plan_results.seed)
        self.office.submit(
            "Planning",
            lambda progress: self._workshop.run(order, plan_results, progress),
            lambda ticket, found: self.office.change(lambda s: s.booked(ticket, found)),
        )

    def more(self) -> None:
        """List further plans."""
        state = self.office.state
        if state is None or not state.plan_results.more:
            return
        maps = state.plan_results.maps
        self.office.submit(
            "Listing more solutions",
            lambda progress: self._workshop.more(maps, progress),
            lambda ticket, found: self.office.change(lambda s: s.listed(ticket, *found)),
        )

    def open_file(self, name: str, content: bytes) -> None:
        """Verify a plan that was uploaded and show it if it holds."""

        def done(ticket: int, opened: OpenedPlan) -> None:
            self.office.change(
                lambda s: (
                    s.opened(opened.report, opened.scene, opened.plan)
                    if s.busy and s.busy.ticket == ticket
                    else s
                )
            )

        label = f"Verifying {name}"
        self.office.submit(label, lambda progress: self._workshop.open(content, name, progress), done)

    def download(self, form: str) -> None:
        """Send the plan to the browser in one of `FORMATS`."""
        state = self.office.state
        if state and state.plan:
            plan = state.plan.plan
            ending, write = FORMATS[form]
            name = re.sub(r"\W+", "_", f"{plan.scene.name}_{plan.kind}")
            self.office.send(name + ending, write(plan).encode())

    def play(self, change: Callable[[State], State]) -> None:
        """Start or stop a play."""
        with self.office.lock:  # a player that is about to end does so first, and another one begins
            self.office.change(change)
            state = self.office.state
            if state and state.plan_results.moving and not (self._player and self._player.is_alive()):
                self._player = threading.Thread(target=self._play, name="player", daemon=True)
                self._player.start()

    def _play(self) -> None:
        last = time.monotonic()
        while not self._ended.wait(TICK):
            now = time.monotonic()
            with self.office.lock:
                self.office.change(lambda s, seconds=now - last: s.played(seconds), "play")
                state = self.office.state
                if state is None or not state.plan_results.moving:
                    self._player = None
                    return
            last = now
