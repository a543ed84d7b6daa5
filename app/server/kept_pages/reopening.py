"""Shows again what a page showed on a server that was stopped meanwhile."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from symgrasp.errors import InputError, SymgraspError
from symgrasp.progress import Progress

from ...compute.compute_process import ComputeProcess
from ...files.stored_page import SOURCE, StoredPage
from ...state.job_changes import failed
from ...state.page_link import Camera
from ...state.plans.plan_changes import show_position, show_results
from ...state.requests import MapRequest
from ...state.state import State
from ..session.plan_actions import PlanActions
from .stored_pages import StoredFiles

__all__ = ["reopened"]


def reopened(
    stored: StoredFiles,
    plans: PlanActions,
    process: ComputeProcess,
    served: Iterable[str],
    progress: Progress,
) -> tuple[State, Camera | None]:
    """Return the state and camera of a page that was stored.

    The scene and the plan are read as files that are uploaded, in the process of the session.

    Args:
        stored: its files.
        plans: of the session.
        process: of the session.
        served: names of the scenes that the server has.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        InputError: the files are damaged, or do not go together.
    """
    page = StoredPage.parse(stored.settings, stored.scene)
    name = "scene.zip" if stored.scene.startswith(b"PK") else "scene.yaml"
    try:
        uploaded = plans.read_scene(name, stored.scene, lambda share: progress(share / 3))
    except SymgraspError as error:
        raise InputError(SOURCE, "scene", str(error), "a scene that can be opened") from error
    state = page.applied(uploaded, served)
    if page.plan is None:
        return state, page.camera
    try:
        return _with_plan(state, page, page.plan, plans, process, progress), page.camera
    except SymgraspError as error:  # the scene is not lost with it
        return failed(state, f"the plan that was shown is to be planned again: {error}"), page.camera


def _with_plan(
    state: State,
    page: StoredPage,
    plan: str,
    plans: PlanActions,
    process: ComputeProcess,
    progress: Progress,
) -> State:
    """Return a state with the plan of its page, if that holds."""
    unpacked = state.moved_scene() if state.assets.folders else None
    opened = process.open(plan.encode(), f"{SOURCE}: plan", lambda share: progress((1 + share) / 3), unpacked)
    if opened.plan is None:
        raise InputError(SOURCE, "plan", opened.report.failures[0], "a plan that holds")
    holds = [(task.name, hold.arm) for task in opened.plan.plan.tasks for hold in task.holds]
    requests = [
        MapRequest(state.scene, arm, task, state.poses.get(task)) for task, arm in dict.fromkeys(holds)
    ]
    maps = plans.maps(requests, lambda share: progress((2 + share) / 3))
    results = state.plan_results.found(opened.plan.plan.kind, (opened.plan,), maps, more=False)
    if page.planned:
        return show_position(show_results(state, results), page.position)
    return replace(state, plan_results=results)
