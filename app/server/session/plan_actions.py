"""The actions about plans: running planners, listing more plans, opening and downloading files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from symgrasp.progress import Progress

from ...choices.scene_assets import UploadFolder
from ...choices.uploaded_scene import UploadedScene
from ...compute.cache import SharedCache
from ...compute.compute_process import ComputeProcess
from ...compute.plan_service import MotionRequest, OpenedPlan, PlanRequest
from ...files.archives import is_archive
from ...files.file_kinds import FileKind
from ...state.changes import open_upload
from ...state.job_changes import failed
from ...state.plans.plan_changes import more_listed, motion_found, show_results
from ...state.plans.plan_results import PlanKind, PlanResults
from ...state.requests import MapRequest, Maps
from ...state.state import State
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
        """Find the motion of the plan that is shown, or of the first one after it that has one.

        Where none of the list has one, further plans are tried, and listed up to that with a motion.
        """
        state = self._session.state
        if state is None or state.plan is None:
            return
        first = state.plan_results.index
        plans = tuple(result.plan for result in state.plan_results.plans[first:])
        request = MotionRequest(state.scene, state.poses, plans, state.plan_results.more)
        self._session.submit(
            "Planning the motion",
            lambda progress: self._process.motion(request, progress),
            lambda state, found: motion_found(
                state, first + found.index, found.plan, found.failures, found.listed
            ),
        )

    def open_file(self, name: str, content: bytes, expected: FileKind = "plan") -> None:
        """Open an uploaded file as what it is: verify a plan, and show it if it holds; or show a scene.

        Args:
            name: of the file.
            content: of the file.
            expected: what it is taken for where it is neither, so that an error can say what is wrong.
        """

        def run(progress: Progress) -> UploadedScene | tuple[OpenedPlan, Maps]:
            kind = self._process.file_kind(name, content, progress) or expected
            if kind == "scene":
                return self.read_scene(name, content, progress)
            opened = self._read_plan(name, content, lambda share: progress(share / 2))
            return opened, self.maps(opened.maps, lambda share: progress((1 + share) / 2))

        def show(state: State, result: UploadedScene | tuple[OpenedPlan, Maps]) -> State:
            if isinstance(result, UploadedScene):
                return open_upload(state, result)
            after = show_opened_plan(state, *result)
            if expected == "scene" and result[0].plan is None:
                return failed(after, f"{name} is a plan that does not hold: the tab Sequence says why")
            return after

        self._session.submit(f"{'Verifying' if expected == 'plan' else 'Opening'} {name}", run, show)

    def _read_plan(self, name: str, content: bytes, progress: Progress) -> OpenedPlan:
        """Read and verify an uploaded plan; an archive is unpacked into a folder of its own."""
        if not is_archive(content):
            return self._process.open(content, name, progress)
        folder = UploadFolder()
        opened = self._process.open(content, name, progress, folder=folder.path)
        return replace(opened, scene=opened.scene and opened.scene.with_folder(folder))

    def read_scene(self, name: str, content: bytes, progress: Progress) -> UploadedScene:
        """Read an uploaded scene; an archive is unpacked into a folder of its own."""
        if not name.lower().endswith(".zip"):
            return self._process.read_scene(name, content, None, progress)
        folder = UploadFolder()
        return self._process.read_scene(name, content, folder.path, progress).with_folder(folder)

    def maps(self, requests: Sequence[MapRequest], progress: Progress) -> Maps:
        """Return maps by task and arm, computing those that are not cached."""
        maps: Maps = {}
        for k, request in enumerate(requests):
            cached = self._cache.map(request)
            maps[request.task, request.arm] = cached or self._process.map(
                request, lambda share, k=k: progress((k + share) / len(requests))
            )
        return maps

    def download(self, format_name: str) -> None:
        """Send the plan to the browser in one of `app.files.plan_formats.FORMATS`."""
        state = self._session.state
        if state is None or state.plan is None:
            return
        plan, folders = state.plan.plan, [folder.path for folder in state.assets.folders]

        def run(progress: Progress) -> None:
            self._session.send(*self._process.write(plan, format_name, folders, progress))

        self._session.submit("Writing the plan", run, lambda state, _: state)


def show_opened_plan(state: State, opened: OpenedPlan, maps: Maps) -> State:
    """Show a plan from a file with its scene, or only the report where it does not hold."""
    report, plan = opened.report, opened.plan
    if opened.scene is None or plan is None:
        return replace(state, plan_results=replace(state.plan_results, opened=report))
    chosen = state.plan_results
    results = PlanResults(chosen.sequence_method, chosen.hands_method, chosen.seed)
    results = replace(results.found(plan.plan.kind, (plan,), maps, more=False), opened=report)
    return show_results(open_upload(state, opened.scene), results)
