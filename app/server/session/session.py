"""One browser: its state, the thread that draws it, and the queue of jobs that compute for it."""

from __future__ import annotations

import asyncio
import itertools
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import viser

from symgrasp.errors import LONGEST, SymgraspError, printable, shortened
from symgrasp.progress import Progress

from ...compute.cache import SharedCache
from ...compute.compute_process import ComputeProcess
from ...compute.job_queue import Job, JobQueue
from ...compute.process_pool import ProcessPool
from ...files.links import Link
from ...files.shown_paths import shown_paths
from ...panels.layout import Layout
from ...scene3d.scene_view import SceneView
from ...state import changes, job_changes, robot_changes
from ...state.first_grasp import with_first_grasp
from ...state.page_link import Camera
from ...state.plans.plan_changes import change_plan_results
from ...state.plans.plan_results import PlanResults
from ...state.requests import (
    CompareRequest,
    ElbowRequest,
    ExplainRequest,
    MapRequest,
    ProbabilityRequest,
    Request,
    WindowsRequest,
)
from ...state.resumed import resumed
from ...state.state import State
from ...state.surveys import survey_changes
from ...state.undo import remember
from ..door.browser_connection import BrowserConnection
from ..door.front_door import Visit
from ..kept_pages.left_pages import LeftPage
from ..kept_pages.reopening import reopened
from ..kept_pages.stored_pages import StoredFiles
from .actions import Actions, camera_of
from .map_pane import MapPane
from .playback_clock import PlaybackClock
from .survey_actions import SurveyActions
from .tour import tour_acts

__all__ = ["Session"]

log = logging.getLogger(__name__)

LATE = 0.25
"""Computations longer than this (s) are shown as running; a note about shorter ones could not be read."""

Run = Callable[[Progress], Any]
"""Computes a result; may raise `Cancelled` through its progress."""


class Session:
    """Everything one browser owns; ended by `close`.

    Callbacks of widgets only change the state, which takes no time, so they never queue up. One thread
    draws the newest state, skipping those in between; another runs the jobs. Every new state goes
    through `_commit`, which also looks up or starts the computation of what it is missing.

    Args:
        client: the browser.
        connection: to it.
        cache: what all sessions share.
        pool: starts the process that computes.
        visit: the address it opened, which may say what to show first.
        left: what it showed before, which then is shown again.

    Attributes:
        state: what is shown; None before the first scene is loaded.
        map_pane: the map on the page.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        connection: BrowserConnection,
        cache: SharedCache,
        pool: ProcessPool,
        visit: Visit,
        left: LeftPage | StoredFiles | None = None,
    ) -> None:
        self.client, self.cache, self.visit, self._connection = client, cache, visit, connection
        self.state: State | None = None
        self._camera: Camera | None = None
        self._job_ids = itertools.count(1)
        self._changed = threading.Condition(threading.Lock())
        self._drawn: State | None = None
        self._write_inputs = self._move_gizmo = True
        self._writing = False
        self._closed = False
        self._playback = PlaybackClock()
        self.map_pane = MapPane(self.change, lambda name: tour_acts(self.actions)[name]())
        self.process = ComputeProcess(
            pool,
            cache.keep,
            lambda: self.jobs.compiling(),
            lambda: self.jobs.waiting(),
            lambda result: self.change(lambda s: job_changes.preliminary_arrived(s, result)),
        )
        self.jobs = JobQueue(f"jobs {client.client_id}", self.process.close)
        self.surveys = SurveyActions(self, pool, client.client_id)
        try:
            self._build_page(left)
        except BaseException:
            self.close()
            raise

    def _build_page(self, left: LeftPage | StoredFiles | None) -> None:
        """Add everything to the page, start the drawing thread, and open what was left or the first scene."""
        client = self.client
        buttons = self._connection.upload_buttons
        self.actions = Actions(
            self, client, self.cache, self.process, self.surveys, self.visit.address, buttons
        )
        self.layout = Layout(client, self.actions, self.cache.names, stacked=self.visit.stacked)
        self.scene_view = SceneView(
            client,
            self.layout.view_size,
            on_surface=lambda i, j: self.change(lambda s: changes.choose_surface_cell(s, i, j)),
            on_flat_map=lambda i, j: self.change(lambda s: changes.choose_cell(s, i, j)),
            on_drag=lambda pose: self.change(lambda s: changes.drag(s, pose), "gizmo"),
            on_base_drag=lambda pose: self.change(lambda s: robot_changes.robot_dragged(s, pose), "gizmo"),
            on_place=lambda k: self.change(lambda s: survey_changes.choose_place(s, k)),
            on_stand=lambda k: self.change(lambda s: survey_changes.stand_at(s, k)),
        )

        @client.camera.on_update
        async def _(_: viser.CameraHandle) -> None:
            self._camera = camera_of(client)
            self.scene_view.camera_moved(self._camera)
            self.change(lambda s: changes.seen_from(s, camera_of(client)))

        name = f"draw {client.client_id}"
        threading.Thread(target=self._draw_until_closed, name=name, daemon=True).start()
        if left is None or isinstance(left, StoredFiles):
            self._open_first(left)
            return
        self.scene_view.camera = self._camera = left.camera
        with self._changed:
            self._commit(resumed(left.state))

    @property
    def shown(self) -> LeftPage | None:
        """What is shown, for a session that continues this one; None before the first scene is loaded."""
        return LeftPage(self.state, self._camera) if self.state else None

    def close(self) -> None:
        """End all threads and processes; a second call does nothing."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self.map_pane.close()
        self.jobs.close()
        self.surveys.close()

    def send(self, name: str, content: bytes) -> None:
        """Send a file to the browser."""
        self.client.send_file_download(name, content, save_immediately=True)

    # -- changing the state -----------------------------------------------------------------

    def change(self, change: Callable[[State], State], origin: str = "") -> None:
        """Apply a change; see `SessionApi`."""
        with self._changed:
            if self.state is None or self._closed:
                return
            try:
                state = change(self.state)
            except Exception as error:  # must not end the event loop's callback unseen
                state = job_changes.failed(self.state, _problem(error))
            self._commit(state, origin)

    def attempt(self, action: Callable[[State], None]) -> None:
        """Run an action that leaves the state as it is; see `SessionApi`."""
        state = self.state
        if state is None:
            return
        try:
            action(state)
        except Exception as error:  # of whatever writes files
            problem = _problem(error)
            self.change(lambda state: job_changes.failed(state, problem))

    def submit(self, label: str, run: Run, show: Callable[[State, Any], State]) -> None:
        """Run a job in place of the one under way; see `SessionApi`."""
        job_id = next(self._job_ids)

        def done(result: Any) -> None:
            def shown(state: State) -> State:
                awaited = job_changes.is_awaited(state, job_id)
                return show(job_changes.ended(state), result) if awaited else state

            self.change(shown)

        job = self._job(job_id, run, done)
        with self._changed:
            if self.state is not None and not self._closed:
                self._commit(job_changes.started(self.state, job_id, label), job=job)

    def _commit(self, state: State, origin: str = "", job: Job | None = None) -> None:
        """Make a state the current one, and look up or compute what it is missing; the lock is held.

        Args:
            state: the new state.
            origin: what changed it; see `SessionApi.change`.
            job: the job that the state waits for, if a new one.
        """
        before = self.state
        if state is before:
            return
        state = with_first_grasp(state)
        if before is not None:
            state = remember(before, state, origin, time.monotonic())
        if before is None or state.input_values != before.input_values:
            # A write of the inputs that is under way may have overwritten what a person just entered.
            self._write_inputs |= origin != "inputs" or self._writing
            self._move_gizmo |= origin != "gizmo"
        while (request := state.next_request) is not None:
            cached = self.cache.map(request) if isinstance(request, MapRequest) else None
            if cached:
                state = with_first_grasp(replace(state, busy=None, result=cached))
            else:
                state, job = self._begin(state, request)
        if state.is_obsolete:
            state = replace(state, busy=None)
        if before is None or state.problem != before.problem:
            state = replace(state, problem=shown_paths(state.problem))
        self.state = state
        self._changed.notify()
        if job:
            self.jobs.submit(job)
        elif state.busy is None:
            self.jobs.cancel()

    # -- computing --------------------------------------------------------------------------

    def _begin(self, state: State, request: Request) -> tuple[State, Job]:
        """Return the state that waits for a request, and the job that computes it."""
        job_id, process = next(self._job_ids), self.process
        arrived: Callable[[State, int, Any], State] = job_changes.result_arrived
        if isinstance(request, MapRequest):
            label, arrived = f"Computing the map of {request.task}", job_changes.map_arrived
            run: Run = lambda progress: process.map(request, progress)  # noqa: E731
        elif isinstance(request, CompareRequest):
            assert state.result  # a comparison is requested only while its map is shown
            label, shown = f"Recomputing the map of {request.map.task}", state.result.map
            run = lambda progress: process.compare(request, shown, progress)  # noqa: E731
        elif isinstance(request, ProbabilityRequest):
            label = "Computing how probable grasps are"
            run = lambda progress: process.probability(request, progress)  # noqa: E731
        elif isinstance(request, WindowsRequest):
            assert state.result  # windows are requested only while their map is shown
            label, known = "Computing how far the elbow may swing", state.result.map
            run = lambda progress: process.windows(request, known, progress)  # noqa: E731
        elif isinstance(request, ElbowRequest):
            assert state.result
            label, whole = "Computing how the elbow may move here", state.result.map
            run = lambda progress: process.elbow(request, whole, progress)  # noqa: E731
        else:
            assert isinstance(request, ExplainRequest)
            label = "Trying every way to hold it here"
            run = lambda progress: process.explain(request, progress)  # noqa: E731
        job = self._job(job_id, run, lambda result: self.change(lambda s: arrived(s, job_id, result)))
        return job_changes.started(state, job_id, label, request), job

    def _job(self, job_id: int, run: Run, done: Callable[[Any], None]) -> Job:
        begun = time.monotonic()

        def progress(share: float) -> None:
            late = time.monotonic() - begun > LATE
            self.change(lambda s: job_changes.progressed(s, job_id, share, late))

        return Job(
            run,
            progress,
            compiling=lambda: self.change(lambda s: job_changes.compiling(s, job_id)),
            waiting=lambda: self.change(lambda s: job_changes.waiting(s, job_id)),
            done=done,
            failed=lambda problem: self._failed(job_id, problem),
        )

    def _open_first(self, stored: StoredFiles | None) -> None:
        """Open what was stored, or what the address says.

        If that fails, `_failed` opens the first scene and shows the reason.
        """

        def run(progress: Progress) -> tuple[State, Camera | None]:
            if stored:
                return reopened(stored, self.actions.plans, self.process, self.cache.names, progress)
            link = Link.parse(self.visit.query)
            scene, choice = self.cache.linked(
                link, lambda scene, arm, hand: self.process.mount(scene, arm, hand, progress).scene
            )
            name = link.scene or self.cache.first
            holds = self.cache.holds_first and link == Link()
            opened = replace(State.of(scene, name), object_choice=choice, holds_first=holds)
            opened = link.apply(opened)
            if holds:  # arm and object have the view; the map is beside it
                opened = changes.switched(opened, flat_map=False)
            return opened, link.camera

        def done(result: tuple[State, Camera | None]) -> None:
            state, self._camera = result
            self.scene_view.camera, self.scene_view.is_close = self._camera, state.holds_first
            with self._changed:
                self._commit(state)

        self.jobs.submit(self._job(next(self._job_ids), run, done))

    def _failed(self, job_id: int, problem: str) -> None:
        with self._changed:
            self._write_inputs = True  # the dropdown still shows the scene that could not be loaded
            if self.state is not None:
                self._commit(job_changes.stopped(self.state, job_id, problem))
                return
            first = self.cache.first
            self._commit(job_changes.failed(State.of(self.cache.scene(first), first), problem))

    # -- drawing ----------------------------------------------------------------------------

    def _draw_until_closed(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(self._has_to_draw, self._next_frame())
                if self._closed:
                    return
                self._play()
                state, is_new = self.state, self.state is not self._drawn
                write_inputs, move_gizmo = self._write_inputs, self._move_gizmo
                if is_new:
                    self._drawn, self._write_inputs, self._move_gizmo = state, False, False
                    self._writing = write_inputs
            if is_new:
                assert state is not None
                self._draw(state, write_inputs=write_inputs, move_gizmo=move_gizmo)
            self._move_arms()

    def _next_frame(self) -> float | None:
        """Return the time (s) until a frame of a playback or of arms that move is due, None for never."""
        times = (self._playback.wait(self.state, time.monotonic()), self.scene_view.wait())
        return min((seconds for seconds in times if seconds is not None), default=None)

    def _move_arms(self) -> None:
        """Move arms that are on their way to a grasp by a frame, if it is due."""
        try:
            if self.scene_view.wait() == 0.0:
                self.scene_view.step()
        except Exception:  # must not end the drawing thread
            log.exception("arms could not be moved")

    def _has_to_draw(self) -> bool:
        return self._closed or self.state is not self._drawn

    def _play(self) -> None:
        """Advance the playback; the lock is held."""
        if self.state is None:
            return
        try:
            state = self._playback.advanced(self.state, time.monotonic())
        except Exception as error:  # a playback that breaks must not end the drawing
            log.exception("the playback broke")
            paused = change_plan_results(self.state, PlanResults.paused)
            state = job_changes.failed(paused, f"the playback broke: {type(error).__name__}: {error}")
        self._commit(state, "play")

    def _draw(self, state: State, *, write_inputs: bool, move_gizmo: bool) -> None:
        try:
            self.map_pane.show(state)
            self.layout.show(state)
            if write_inputs:
                asyncio.run_coroutine_threadsafe(self._inputs_written(state), self._connection.loop).result()
            self.scene_view.show(state, move_gizmo=move_gizmo)
        except Exception as error:  # must not end the drawing thread
            log.exception("a picture could not be drawn")
            with self._changed:  # so that the next drawing writes what this one left out
                self._write_inputs |= write_inputs
                self._move_gizmo |= move_gizmo
            text = f"the picture could not be drawn: {type(error).__name__}: {error}"
            if state.problem != text:
                self.change(lambda s: job_changes.failed(s, text))
        with self._changed:
            self._writing = False

    async def _inputs_written(self, state: State) -> None:
        self.layout.write_inputs(state)


def _problem(error: Exception) -> str:
    """Return one line for the page about an error; where an unexpected one comes from goes to the log."""
    if isinstance(error, SymgraspError):
        return str(error)
    log.error("an action failed", exc_info=error)
    return shortened(printable(f"unexpected {type(error).__name__}: {error}"), LONGEST)
