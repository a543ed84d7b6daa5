"""The actions about plans: running planners, listing more plans, opening and downloading files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from symgrasp.errors import InputError
from symgrasp.progress import Progress

from ..compute.cache import SharedCache
from ..compute.compute_process import ComputeProcess
from ..compute.plan_service import MotionRequest, OpenedPlan, PlanRequest
from ..files.plan_formats import FORMATS
from ..state.changes import open_upload
from ..state.plan_changes import more_listed, motion_found, show_results
from ..state.plan_results import PlanKind, PlanResults
from ..state.requests import MapRequest, Maps
from ..state.state import State
from .session_api import SessionApi

__all__ = ["PlanActions"]


class PlanActions:
    """The actions about plans of one browser; see `app.panels.actions.PlanActions`.

    Args:
        session: the browser's session.
        process: computes for it.
        cache: the maps that were computed before.
    """

    def __init__(self, session: SessionApi, process: ComputeProcess, cache: SharedCache) -> None:
        self._session, self._process, self._cache = session, process, cache

    def run(self, kind: PlanKind, method: str = "") -> None:
        """Run a planner, with the method chosen on the page unless one is given."""
        state = self._session.state
        if state is None:
            return
        results, name = state.plan_results, state.arm
        if kind == "bimanual":
            method, name = method or results.hands_method, state.bimanual_task
        elif kind == "sequential":
            method = method or results.sequence_method
        request = PlanRequest(state.scene, kind, method, name, state.poses, results.seed)
        cached = {(r.task, r.arm): result for r in request.maps if (result := self._cache.map(r))}

        self._session.submit(
            "Planning",
            lambda progress: self._process.plan(request, cached, progress),
            lambda state, result: show_results(state, result[0].added_to(state.plan_results, result[1])),
        )

    def list_more(self) -> None:
        """Compute further plans and add them to the list."""
        state = self._session.state
        if state is None or not state.plan_results.more:
            return
        self._session.submit(
            "Listing more solutions", self._process.more, lambda state, result: more_listed(state, *result)
        )

    def find_motion(self) -> None:
        """Find the motion of the plan that is shown, or of the first one after it that has one."""
        state = self._session.state
        if state is None or state.plan is None:
            return
        first = state.plan_results.index
        plans = tuple(result.plan for result in state.plan_results.plans[first:])
        request = MotionRequest(state.scene, state.poses, plans)
        self._session.submit(
            "Planning the motion",
            lambda progress: self._process.motion(request, progress),
            lambda state, found: motion_found(state, first + found.index, found.plan, found.failures),
        )

    def open_file(self, name: str, content: bytes) -> None:
        """Verify an uploaded plan file, and show the plan if it holds."""

        def run(progress: Progress) -> tuple[OpenedPlan, Maps]:
            opened = self._process.open(content, name, lambda share: progress(share / 2))
            return opened, self._maps(opened.maps, lambda share: progress((1 + share) / 2))

        self._session.submit(f"Verifying {name}", run, lambda state, result: show_opened_plan(state, *result))

    def _maps(self, requests: Sequence[MapRequest], progress: Progress) -> Maps:
        """Return maps by task and arm, computing those that are not cached."""
        maps: Maps = {}
        for k, request in enumerate(requests):
            cached = self._cache.map(request)
            maps[request.task, request.arm] = cached or self._process.map(
                request, lambda share, k=k: progress((k + share) / len(requests))
            )
        return maps

    def download(self, format_name: str) -> None:
        """Send the plan to the browser in one of `FORMATS`."""

        def send(state: State) -> None:
            if state.plan:
                if state.assets.folders and format_name == "JSON":
                    expected = "robots of the server; save the scene, unpack it and run `symgrasp plan`"
                    raise InputError("plan file", "robots", "an upload", expected)
                plan = state.plan.plan
                ending, write = FORMATS[format_name]
                name = re.sub(r"\W+", "_", f"{plan.scene.name}_{plan.kind}")
                self._session.send(name + ending, write(plan).encode())

        self._session.attempt(send)


def show_opened_plan(state: State, opened: OpenedPlan, maps: Maps) -> State:
    """Show a plan from a file with its scene, or only the report where it does not hold."""
    report, plan = opened.report, opened.plan
    if opened.scene is None or plan is None:
        return replace(state, plan_results=replace(state.plan_results, opened=report))
    chosen = state.plan_results
    results = PlanResults(chosen.sequence_method, chosen.hands_method, chosen.seed)
    results = replace(results.found(plan.plan.kind, (plan,), maps, more=False), opened=report)
    return show_results(open_upload(state, opened.scene), results)
