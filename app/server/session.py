"""One browser: its state, the thread that draws it, and the worker that computes for it."""

from __future__ import annotations

import itertools
import logging
import re
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import viser

from app.compute.cache import SharedCache
from app.compute.compute_process import ComputeProcess
from app.compute.job_queue import Job, JobQueue
from app.compute.map_service import check_visuals
from app.compute.process_pool import ProcessPool
from app.files.links import link_of, parse_link
from app.files.scene_files import read_scene, scene_yaml
from app.panels.layout import Layout
from app.render.map_picture import map_picture, picture_name
from app.scene3d.scene_view import SceneView
from app.server.plan_actions import PlanActions
from app.server.proxy import Visit
from app.server.snapshot import snapshot_html
from app.state.history import remember
from app.state.object_choice import OWN, ObjectChoice, check_size, from_library, from_mesh
from app.state.page_link import Camera
from app.state.requests import CompareRequest, MapRequest, Request
from app.state.state import State
from app.state.uploaded_scene import UploadedScene
from symgrasp.compiling import notify_on_compile
from symgrasp.errors import SymgraspError
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene

__all__ = ["Session"]

T = TypeVar("T")

log = logging.getLogger(__name__)

LATE = 0.25
"""Computations longer than this (s) are spoken of; others are over before one could read it."""


class Session:
    """Everything one browser owns; ended by `close`.

    Callbacks of widgets only change the state, which takes no time, so they never queue up. One
    thread draws the newest state, skipping those in between; another computes.

    Args:
        client: the browser.
        store: what all browsers share.
        staff: starts the process that computes.
        visit: the address it opened, which may say what to show first.

    Attributes:
        state: what is shown; None before the first scene stands.
        lock: held while the state changes.
    """

    def __init__(
        self, client: viser.ClientHandle, store: SharedCache, pool: ProcessPool, visit: Visit
    ) -> None:
        self.client, self.store, self.visit = client, store, visit
        self.state: State | None = None
        self._tickets = itertools.count(1)
        self.lock = threading.RLock()
        self._changed = threading.Condition(self.lock)
        self._drawn: State | None = None
        self._write_inputs = self._move_gizmo = True
        self._writing = False
        self._closed = False
        self.process = ComputeProcess(store, pool, lambda: self.change(State.compiles_now))
        self.plans = PlanActions(self, self.process)
        self.worker = JobQueue(f"worker {client.client_id}", self.process.close)
        try:
            self._furnish()
        except BaseException:
            self.close()
            raise

    def _furnish(self) -> None:
        """Put everything on the page and begin to draw."""
        client = self.client
        self.controls = Layout(client, self, self.store.names)
        self.view = SceneView(
            client,
            self.controls.view_width,
            on_surface=lambda i, j: self.change(lambda s: s.choose_surface_cell(i, j)),
            on_flat_map=lambda i, j: self.change(lambda s: s.choose_cell(i, j)),
            on_drag=lambda pose: self.change(lambda s: s.drag(pose), "gizmo"),
        )

        @client.camera.on_update
        async def _(_: viser.CameraHandle) -> None:
            self.view.seen_from(self._camera())
            self.change(lambda s: s.seen_from(self._camera()))

        self._painter = threading.Thread(target=self._paint, name=f"painter {client.client_id}", daemon=True)
        self._painter.start()
        self._open_first()

    def close(self) -> None:
        """End both threads and the process; a second call does nothing."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self.plans.close()
        self.worker.close()

    # -- what widgets ask for ---------------------------------------------------------------

    def change(self, change: Callable[[State], State], origin: str = "") -> None:
        """Apply a change; see `app.panels.layout.Actions`."""
        with self._changed:
            if self.state is None or self._closed:
                return
            try:
                state = change(self.state)
            except SymgraspError as error:
                state = self.state.failed(str(error))
            self._take(state, origin)

    def open_scene(self, name: str) -> None:
        """Load a scene on the worker and show it."""

        own = self.state.loaded if self.state else None
        known = own.scene if own and own.choice == name else None
        self._change_scene(
            f"Loading {name}",
            lambda _: known or self.store.scene(name),
            lambda s, scene: s.open_scene(scene, name),
        )

    def load_scene(self, name: str, content: bytes) -> None:
        """Read an uploaded scene on the worker and show it."""

        def run(progress: Progress) -> UploadedScene:
            loaded = read_scene(name, content, self.store.folders)
            self.process.check_tasks(loaded.scene, progress)
            check_visuals(loaded.scene)
            return loaded

        self._change_scene(f"Opening {name}", run, State.load_scene)

    def _open_first(self) -> None:
        """Show what the address says; if that cannot be done, `_failed` shows the first scene and why not."""

        def run(_: Progress) -> tuple[State, Camera | None]:
            link = parse_link(self.visit.query)
            scene, object_choice = self.store.linked(link)
            name = link.scene or self.store.first
            return link.apply(replace(State.of(scene, name), object_choice=object_choice)), link.camera

        def done(_: int, found: tuple[State, Camera | None]) -> None:
            state, self.view.camera = found
            with self._changed:
                self._take(state, "")

        self._begin("Loading", run, done)

    def choose_object(self, choice: str) -> None:
        """Put another object into the scene, on the worker."""
        state = self.state
        if state is None:
            return
        uploaded = state.uploaded
        if uploaded and choice == uploaded.choice:
            run = lambda: self._put(state, uploaded)  # noqa: E731
        else:
            run = lambda: self._load(state, choice)  # noqa: E731
        self._change_object(f"Loading {choice}", run)

    def choose_hand(self, hand: str) -> None:
        """Mount another hand on the chosen arm, on the worker."""
        state = self.state
        if state is None:
            return

        def run() -> tuple[Scene, ObjectChoice | None]:
            scene = state.scene.with_hand(state.arm, hand)
            check_visuals(scene)
            return scene, state.object_choice

        self._change_object(f"Mounting {hand}", run)

    def upload(self, name: str, content: bytes, scale: float) -> None:
        """Measure a mesh on the worker and put the object into the scene."""
        state = self.state
        if state is None:
            return
        try:
            check_size(name, content)
        except SymgraspError as error:
            self.change(lambda s, problem=str(error): s.failed(problem))
            return
        self._change_object(f"Measuring {name}", lambda: self._put(state, from_mesh(name, content, scale)))

    def _load(self, state: State, choice: str) -> tuple[Scene, ObjectChoice | None]:
        """Return the scene with its own object or one of the library, sharing what others computed."""
        if choice == OWN:
            opened = self._opened(state)
            return state.scene.with_object(opened.file.object.name, opened.profile), None
        shared = None if state.own_scene else self.store.scene_with(state.scene_name, choice)[1]
        return self._put(state, shared or from_library(choice))

    def _put(self, state: State, object_choice: ObjectChoice) -> tuple[Scene, ObjectChoice]:
        """Return the scene with an object in place of its own."""
        return state.scene.with_object(object_choice.name, object_choice.profile), object_choice

    def _change_scene(
        self, label: str, run: Callable[[Progress], T], show: Callable[[State, T], State]
    ) -> None:
        def done(ticket: int, found: T) -> None:
            self.change(lambda s: show(s, found) if s.busy and s.busy.ticket == ticket else s)

        self.submit(label, run, done)

    def _change_object(self, label: str, run: Callable[[], tuple[Scene, ObjectChoice | None]]) -> None:
        def done(ticket: int, found: tuple[Scene, ObjectChoice | None]) -> None:
            self.change(lambda s: s.choose_object(*found) if s.busy and s.busy.ticket == ticket else s)

        self.submit(label, lambda _: run(), done)

    def stop_or_retry(self) -> None:
        """Stop the computation, the picture stays as it is; or begin again what was stopped."""
        self.change(lambda s: s.stopped(s.busy.ticket) if s.busy else s.retry())

    def save_map(self, kind: str) -> None:
        """Send the map as it is shown to the browser; see `app.render.map_picture.FORMATS`."""
        state = self.state
        if state is None:
            return
        try:
            content = map_picture(state, kind)
        except SymgraspError as error:
            self.change(lambda s, problem=str(error): s.failed(problem))
            return
        self.send(picture_name(state, kind), content)

    def save_scene(self) -> None:
        """Send the scene, as it was changed, to the browser."""
        if self.state:
            scene = self.state.moved_scene()
            self.send(re.sub(r"\W+", "_", scene.name) + ".yaml", scene_yaml(scene).encode())

    def make_link(self) -> None:
        """Put what is shown into an address."""

        def make(state: State) -> State:
            camera = self._camera()
            return state.linked(f"{self.visit.address}?{link_of(state, self._opened(state), camera)}", camera)

        self.change(make)

    def save_view(self) -> None:
        """Draw the 3D view into a file on the worker, and send it to the browser."""
        state = self.state
        if state is None:
            return
        camera, fov = self._camera(), self.client.camera.fov

        def done(ticket: int, html: str) -> None:
            self.send(re.sub(r"\W+", "_", state.scene.name) + ".html", html.encode())
            self.change(lambda s: s.stopped(ticket))

        self.submit("Drawing the 3D view", lambda _: snapshot_html(state, camera, fov), done)

    def _opened(self, state: State) -> Scene:
        """Return the scene as it was opened, without what became of its object, hands and tasks since."""
        return state.own_scene or self.store.scene(state.scene_name)

    def _camera(self) -> Camera:
        camera = self.client.camera
        return tuple(float(v) for v in (*camera.position, *camera.look_at))

    def send(self, name: str, content: bytes) -> None:
        """Send a file to the browser."""
        self.client.send_file_download(name, content, save_immediately=True)

    # -- computing --------------------------------------------------------------------------

    def _take(self, state: State, origin: str) -> None:
        """Make a state the current one, and compute what it lacks; the lock is held."""
        if state is self.state:
            return
        if self.state is not None:
            state = remember(self.state, state, origin, time.monotonic())
        if self.state is None or state.inputs != self.state.inputs:
            # What is being written now may just have been written over what a person entered.
            self._write_inputs |= origin != "inputs" or self._writing
            self._move_gizmo |= origin != "gizmo"
        self.state = state
        self._changed.notify()
        request = state.wanted
        if request is None:
            if state.is_obsolete:
                self.state = replace(state, busy=None)
            if self.state.busy is None:
                self.worker.cancel()
        elif isinstance(request, MapRequest) and (known := self.store.map(request)):
            self.worker.cancel()
            self._take(replace(state, busy=None, result=known), origin)
        else:
            self._answer(request, state)

    def _answer(self, request: Request, state: State) -> None:
        """Compute what the state lacks."""
        if isinstance(request, MapRequest):
            self.submit(
                f"Computing the map of {request.task}",
                lambda progress: self.process.map(request, progress),
                lambda ticket, result: self.change(lambda s: s.map_arrived(ticket, result)),
                request,
            )
            return
        if isinstance(request, CompareRequest):
            assert state.result  # the check is of the map that is shown
            label, known = f"Recomputing the map of {request.map.task}", state.result.map
            run = lambda progress: self.process.check(request, known, progress)  # noqa: E731
        else:
            label = "Trying every way to hold it here"
            run = lambda progress: self.process.explain(request, progress)  # noqa: E731
        self.submit(label, run, lambda t, found: self.change(lambda s: s.found(t, found)), request)

    def submit(
        self,
        label: str,
        run: Callable[[Progress], Any],
        done: Callable[[int, Any], None],
        request: Request | None = None,
    ) -> None:
        """Give the worker something to do, in place of what it does now.

        Before the first scene stands nothing takes its place: the page would stay empty.
        """
        with self._changed:
            if self.state is not None:
                self._begin(label, run, done, request)

    def _begin(
        self,
        label: str,
        run: Callable[[Progress], Any],
        done: Callable[[int, Any], None],
        request: Request | None = None,
    ) -> None:
        ticket, begun = next(self._tickets), time.monotonic()

        def telling(progress: Progress) -> Any:
            with notify_on_compile(lambda: self.change(lambda s: s.compiles(ticket))):
                return run(progress)

        job = Job(
            run=telling,
            progress=lambda share: self.change(
                lambda s: s.progressed(ticket, share, late=time.monotonic() - begun > LATE)
            ),
            done=lambda result: done(ticket, result),
            failed=lambda problem: self._failed(ticket, problem),
        )
        # Both under one lock: a job that another thread began in between would be replaced by this one,
        # and the state would wait for it for ever.
        with self._changed:
            self.change(lambda s: s.started(ticket, label, request))
            self.worker.submit(job)

    def _failed(self, ticket: int, problem: str) -> None:
        with self._changed:
            self._write_inputs = True  # a scene that could not be loaded is still chosen in its widget
            if self.state is None:
                first = self.store.first
                self._take(State.of(self.store.scene(first), first).failed(problem), "")
            else:
                self.change(lambda s: s.stopped(ticket, problem))

    # -- drawing ----------------------------------------------------------------------------

    def _paint(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self.state is not self._drawn)
                if self._closed:
                    return
                state, write_inputs, move_gizmo = self.state, self._write_inputs, self._move_gizmo
                self._drawn, self._write_inputs, self._move_gizmo = state, False, False
                self._writing = write_inputs
            assert state is not None
            try:
                self.controls.show(state, write_inputs=write_inputs)
                self.view.show(state, move_gizmo=move_gizmo)
            except Exception as error:  # one bad picture must not end the page
                log.exception("a picture could not be drawn")
                with self._changed:  # the next picture makes up for what this one left out
                    self._write_inputs |= write_inputs
                    self._move_gizmo |= move_gizmo
                text = f"the picture could not be drawn: {type(error).__name__}: {error}"
                if state.problem != text:
                    self.change(lambda s, text=text: s.failed(text))
            with self._changed:
                self._writing = False
