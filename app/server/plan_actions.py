"""What widgets ask for about plans: planning, listing, opening and downloading."""

from __future__ import annotations

import re
from dataclasses import replace

from ..compute.cache import SharedCache
from ..compute.compute_process import ComputeProcess
from ..compute.plan_service import OpenedPlan, PlanRequest
from ..files.plan_formats import FORMATS
from ..state.changes import open_upload
from ..state.plan_changes import more_listed, show_results
from ..state.plan_results import PlanKind, PlanResults
from ..state.requests import Maps
from ..state.state import State
from .session_api import SessionApi

__all__ = ["PlanActions"]


class PlanActions:
    """Plans for one browser; see `app.panels.actions.PlanActions`.

    Args:
        session: the browser's session.
        process: computes for it.
        cache: the maps that were computed before.
    """

    def __init__(self, session: SessionApi, process: ComputeProcess, cache: SharedCache) -> None:
        self._session, self._process, self._cache = session, process, cache

    def run(self, kind: PlanKind, method: str = "") -> None:
        """Run a planner, with the method chosen for it unless another is asked for."""
        state = self._session.state
        if state is None:
            return
        results, name = state.plan_results, state.arm
        if kind == "bimanual":
            method, name = method or results.hands_method, state.bimanual_task
        elif kind == "sequential":
            method = method or results.sequence_method
        request = PlanRequest(state.scene, kind, method, name, state.poses, results.seed)
        known = {(r.task, r.arm): result for r in request.maps if (result := self._cache.map(r))}

        self._session.submit(
            "Planning",
            lambda progress: self._process.plan(request, known, progress),
            lambda state, found: show_results(state, found[0].added_to(state.plan_results, found[1])),
        )

    def list_more(self) -> None:
        """List further plans."""
        state = self._session.state
        if state is None or not state.plan_results.more:
            return
        self._session.submit(
            "Listing more solutions", self._process.more, lambda state, found: more_listed(state, *found)
        )

    def open_file(self, name: str, content: bytes) -> None:
        """Verify a plan that was uploaded, and show it if it holds."""
        self._session.submit(
            f"Verifying {name}",
            lambda progress: self._process.open(content, name, progress),
            lambda state, found: opened(state, *found),
        )

    def download(self, format_name: str) -> None:
        """Send the plan to the browser in one of `FORMATS`."""
        state = self._session.state
        if state and state.plan:
            plan = state.plan.plan
            ending, write = FORMATS[format_name]
            name = re.sub(r"\W+", "_", f"{plan.scene.name}_{plan.kind}")
            self._session.send(name + ending, write(plan).encode())


def opened(state: State, found: OpenedPlan, maps: Maps) -> State:
    """Show a plan from a file, with its scene; one that does not hold is only reported."""
    report, plan = found.report, found.plan
    if found.scene is None or plan is None:
        return replace(state, plan_results=replace(state.plan_results, opened=report))
    chosen = state.plan_results
    results = PlanResults(chosen.sequence_method, chosen.hands_method, chosen.seed)
    results = replace(results.found(plan.plan.kind, (plan,), maps, more=False), opened=report)
    return show_results(open_upload(state, found.scene), results)
