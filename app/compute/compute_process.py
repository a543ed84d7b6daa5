"""Remote calls into the process that computes for one session; a new one replaces it if it dies."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from symgrasp.errors import Cancelled, NoPlanError
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import Plan
from symgrasp.progress import Progress
from symgrasp.robot.catalogue import CatalogueRobot
from symgrasp.scene.format import RobotFile
from symgrasp.scene.scene import Scene

from ..choices.object_choice import ObjectChoice
from ..choices.scene_assets import BuiltScene
from ..choices.uploaded_scene import UploadedScene
from ..files.file_kinds import FileKind
from ..state.plans.plan_results import PlanResult
from ..state.requests import (
    CompareRequest,
    Comparison,
    ElbowMotions,
    ElbowRequest,
    ExplainRequest,
    ExplainResult,
    MapRequest,
    MapResult,
    Maps,
    Probability,
    ProbabilityRequest,
    Windows,
    WindowsRequest,
)
from ..state.surveys.survey import Stand, SurveyRequest
from .channel import Call, Cancel, Compiling, ComputedMap, Failure, Part, ProgressReport
from .limits import MEMORY_LIMIT
from .plan_service import MotionOutcome, MotionRequest, OpenedPlan, PlanOutcome, PlanRequest
from .process_pool import ProcessPool, WorkerProcess
from .survey_service import SurveyPart
from .turns import Place

__all__ = ["ComputeProcess", "ProcessDied"]

POLL_INTERVAL = 0.05
"""Longest time (s) between two checks for a cancel while the process sends nothing."""

STEP_ASIDE = 0.01
"""The same (s) of one in the background, which others may need the cores of at any time."""

CANCEL_TIMEOUT = 10.0
"""Time (s) after a cancel until the process is killed: compiled code cannot be interrupted. Compiling
cannot be either, but is left to end, as the next call would begin it anew."""

READING_CANCEL_TIMEOUT = 0.1
"""The same (s) of one that reads a file: parsers of libraries cannot be told to stop."""

READING_TIMEOUT = 60.0
"""Time (s) without a word after which a process that reads a file is killed: the file hangs its parser."""

TOO_MUCH_MEMORY = f"more memory than a session may use ({MEMORY_LIMIT / 1e9:g} GB)"


class ProcessDied(Exception):
    """The process ended, or was ended, in the middle of a computation."""


class ComputeProcess:
    """Calls the services in a process of its own; used by one thread at a time.

    The process is started when it is first needed. Every method may raise `Cancelled` through its
    progress, the errors of the service, and `ProcessDied`.

    Args:
        pool: starts the process.
        keep: called with every computed map.
        compiling: called when the process begins to compile code.
        waiting: called while others have to compute first.
        preliminary: called with a map that is to be shown until the exact one is computed.
        part: called with what a survey has found so far.
        background: whether it computes only while nobody else does.
    """

    def __init__(
        self,
        pool: ProcessPool,
        keep: Callable[[MapResult], None] = lambda _: None,
        compiling: Callable[[], None] = lambda: None,
        waiting: Callable[[], None] = lambda: None,
        preliminary: Callable[[MapResult], None] = lambda _: None,
        part: Callable[[SurveyPart], None] = lambda _: None,
        *,
        background: bool = False,
    ) -> None:
        self._pool, self._keep, self._compiling, self._waiting = pool, keep, compiling, waiting
        self._preliminary, self._part = preliminary, part
        self._place = Place(pool.turns, background=background)
        self._process: WorkerProcess | None = None
        self._planner: WorkerProcess | None = None
        self._requests: dict[tuple[str, str], MapRequest] = {}
        self._computed: list[ComputedMap] = []

    @property
    def pid(self) -> int | None:
        """Process id, None while there is no process."""
        return self._process.pid if self._process else None

    def close(self) -> None:
        """End the process; the next call starts another."""
        process, self._process = self._process, None
        if process:
            self._pool.end(process)

    def map(self, request: MapRequest, progress: Progress) -> MapResult:
        """Compute a map."""
        self._call("map", progress, request, maps=[request])
        return self._results([request])[request.task, request.arm]

    def compare(
        self, request: CompareRequest, shifted_from: FeasibilityMap, progress: Progress
    ) -> Comparison:
        """Compute the map of the turned object from scratch, and compare it with the shifted one."""
        return self._call("compare", progress, request, shifted_from)

    def explain(self, request: ExplainRequest, progress: Progress) -> ExplainResult:
        """Compute the result of every candidate of a cell."""
        return self._call("explain", progress, request)

    def probability(self, request: ProbabilityRequest, progress: Progress) -> Probability:
        """Compute how probable the grasps of a map are."""
        return self._call("probability", progress, request)

    def windows(self, request: WindowsRequest, shown: FeasibilityMap, progress: Progress) -> Windows:
        """Compute how wide the windows of a map's cells are."""
        return self._call("windows", progress, request, shown)

    def elbow(self, request: ElbowRequest, shown: FeasibilityMap, progress: Progress) -> ElbowMotions:
        """Compute how the elbow may move at a cell."""
        return self._call("elbow", progress, request, shown)

    def read_scene(self, name: str, content: bytes, folder: Path | None, progress: Progress) -> UploadedScene:
        """Read an uploaded scene; see `UploadService.read_scene`."""
        return self._call("read_scene", progress, name, content, folder, reads=name)

    def file_kind(self, name: str, content: bytes, progress: Progress) -> FileKind | None:
        """Return what an uploaded file is; see `UploadService.file_kind`."""
        return self._call("file_kind", progress, content, reads=name)

    def read_robot(
        self,
        scene: Scene,
        robot: str,
        name: str,
        content: bytes,
        folder: Path,
        opened: Scene,
        progress: Progress,
    ) -> tuple[RobotFile, BuiltScene]:
        """Put an uploaded robot in the place of another; see `UploadService.read_robot`."""
        return self._call("read_robot", progress, scene, robot, name, content, folder, opened, reads=name)

    def put_robot(
        self,
        scene: Scene,
        robot: str,
        other: CatalogueRobot | RobotFile,
        opened: Scene,
        progress: Progress,
    ) -> BuiltScene:
        """Put a robot in the place of another; see `UploadService.put_robot`."""
        return self._call("put_robot", progress, scene, robot, other, opened, reads=other.name)

    def rearm(self, scene: Scene, arm: str, link: str, hand: str | None, progress: Progress) -> BuiltScene:
        """Return a scene with a hand on a link of an arm; see `UploadService.rearm`."""
        return self._call("rearm", progress, scene, arm, link, hand, reads=hand or link)

    def measure(
        self, name: str, content: bytes, scale: float, tolerance: float | None, progress: Progress
    ) -> ObjectChoice:
        """Measure an uploaded mesh; see `UploadService.measure`."""
        return self._call("measure", progress, name, content, scale, tolerance, reads=name)

    def mount(self, scene: Scene, arm: str, hand: str, progress: Progress) -> BuiltScene:
        """Return a scene with another hand on an arm; see `UploadService.mount`."""
        return self._call("mount", progress, scene, arm, hand, reads=hand)

    def plan(self, request: PlanRequest, cached: Maps, progress: Progress) -> tuple[PlanOutcome, Maps]:
        """Run a planner; return its outcome and the maps it used, by task and arm.

        Args:
            request: which planner for what.
            cached: those of the maps it needs that were computed before.
            progress: called with the finished share; may raise `Cancelled`.
        """
        outcome = self._call("plan", progress, request, cached, maps=request.maps)
        self._planner = self._process
        return outcome, cached | self._results(request.maps)

    def more(self, progress: Progress) -> tuple[tuple[PlanResult, ...], bool]:
        """Return the next plans of the last planner, and whether there may be more.

        Raises:
            NoPlanError: the process that made the list is gone, and the list with it.
        """
        if self._process is None or self._process is not self._planner:
            raise NoPlanError("the list of solutions ended with the process that made it: plan again")
        return self._call("more", progress)

    def motion(self, request: MotionRequest, progress: Progress) -> MotionOutcome:
        """Find the first of some plans that has a motion; see `PlanService.motion`."""
        return self._call("motion", progress, request)

    def survey(self, request: SurveyRequest, progress: Progress) -> tuple[Stand, ...]:
        """Find out where the object or the robot may stand; see `SurveyService.survey`."""
        return self._call("survey", progress, request)

    def write(
        self, plan: Plan, format_name: str, folders: Sequence[Path], progress: Progress
    ) -> tuple[str, bytes]:
        """Return a plan as a file: its name and content; see `PlanService.write`."""
        return self._call("write", progress, plan, format_name, folders, reads=plan.scene.name)

    def open(
        self,
        content: bytes,
        name: str,
        progress: Progress,
        unpacked: Scene | None = None,
        folder: Path | None = None,
    ) -> OpenedPlan:
        """Read and verify a plan file; see `PlanService.open`."""
        return self._call("open", progress, content, name, unpacked, folder, reads=name)

    def _results(self, requests: Sequence[MapRequest]) -> Maps:
        """Return the maps that the last call computed, as the answers to requests."""
        by_key = {(request.task, request.arm): request for request in requests}
        computed, self._computed = self._computed, []
        pairs = ((c, by_key.get((c.map.task, c.map.arm))) for c in computed)
        return {(r.task, r.arm): MapResult(r, c.map, c.contacts) for c, r in pairs if r}

    def _call(
        self,
        method: str,
        progress: Progress,
        *args: object,
        maps: Sequence[MapRequest] = (),
        reads: str = "",
    ) -> Any:
        """Call a method of the services in the process.

        Args:
            method: its name there.
            progress: called with the finished share; may raise `Cancelled`.
            args: of the method, besides its progress.
            maps: the maps that it may compute.
            reads: name of the file that it reads, if it reads one.
        """
        with self._place.turn(partial(self._wait, progress, 0.0)):
            process = self._ready(progress)
            self._requests = {(request.task, request.arm): request for request in maps}
            self._computed = []
            process.job_id += 1
            process.reads = bool(reads)
            try:
                process.channel.send(Call(process.job_id, method, args, self._place.cores))
                return self._follow(process, progress, reads)
            except Cancelled:
                process.cancelled_at = time.monotonic()
                with suppress(OSError):  # it is dead already, which the next call notices
                    process.channel.send(Cancel(process.job_id))
                raise
            except (EOFError, OSError) as error:
                self._process = None
                how = process.end(grace=1.0)  # a pipe may end a little before its process does
                text = f"the process that computes ended unexpectedly ({how or 'it hung up'})"
                if how == "SIGABRT":  # so libraries end that cannot raise an exception
                    text += f", perhaps because it needs {TOO_MUCH_MEMORY}"
                raise ProcessDied(text) from error

    def _ready(self, progress: Progress) -> WorkerProcess:
        """Return an idle process: the present one, once a cancelled call has ended, or a new one."""
        process = self._process
        if process and process.cancelled_at is not None:
            try:
                self._await_end(process, process.cancelled_at, progress)
            except (EOFError, OSError):
                self.close()
        elif process and not process.is_alive:
            self.close()
        if self._process is None:
            self._process = self._pool.take()
            if self._place.background:
                self._process.give_way()
        return self._process

    def _await_end(self, process: WorkerProcess, since: float, progress: Progress) -> None:
        """Wait until the cancelled call has ended; end the process instead where that takes too long."""
        while process.cancelled_at is not None:
            if process.channel.poll(POLL_INTERVAL):
                message = process.channel.receive()
                if isinstance(message, ComputedMap):
                    self._receive_map(message)
                elif isinstance(message, Compiling):
                    process.compiling = True
                elif isinstance(message, ProgressReport | Part):
                    process.compiling = False
                else:
                    process.cancelled_at, process.compiling = None, False
            if process.compiling:
                self._compiling()
            elif process.cancelled_at is not None and time.monotonic() - since > (
                READING_CANCEL_TIMEOUT if process.reads else CANCEL_TIMEOUT
            ):
                self.close()
                return
            progress(0.0)

    def _follow(self, process: WorkerProcess, progress: Progress, reads: str) -> Any:
        """Receive messages until the call under way ends, and return its result."""
        channel, share, heard = process.channel, 0.0, time.monotonic()
        while True:
            if self._place.is_over:
                process.pause()
                try:
                    self._place.renew(partial(self._wait, progress, share))
                finally:
                    process.resume()
                heard = time.monotonic()
            if not channel.poll(STEP_ASIDE if self._place.background else POLL_INTERVAL):
                if reads and time.monotonic() - heard > READING_TIMEOUT:
                    self.close()
                    raise ProcessDied(f"{reads} takes longer to read than {READING_TIMEOUT:g} s")
                progress(share)
                continue
            message = channel.receive()
            process.compiling = isinstance(message, Compiling)
            heard = math.inf if isinstance(message, Compiling) else time.monotonic()
            if isinstance(message, ProgressReport):
                share = message.share
                progress(share)
            elif isinstance(message, ComputedMap):
                self._receive_map(message)
            elif isinstance(message, Part):
                self._part(message.value)
            elif isinstance(message, Compiling):
                self._compiling()
            elif isinstance(message, Failure):
                if isinstance(message.error, MemoryError):
                    self.close()
                    raise ProcessDied(f"{reads or 'this computation'} needs {TOO_MUCH_MEMORY}")
                if isinstance(message.error, (EOFError, OSError)):  # it is not about this connection
                    raise RuntimeError(f"{type(message.error).__name__}: {message.error}")
                raise message.error
            else:
                return message.value

    def _wait(self, progress: Progress, share: float) -> None:
        self._waiting()
        progress(share)

    def _receive_map(self, computed: ComputedMap) -> None:
        request = self._requests.get((computed.map.task, computed.map.arm))
        if request:
            show = self._preliminary if computed.preliminary else self._keep
            show(MapResult(request, computed.map, computed.contacts, computed.preliminary))
        if not computed.preliminary:
            self._computed.append(computed)
