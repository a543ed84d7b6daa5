"""The main function of a process that computes for one session; it alone parses what was uploaded."""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing import connection, parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from symgrasp.compiling import notify_on_compile
from symgrasp.engine.threads import use_cores
from symgrasp.errors import Cancelled, SymgraspError
from symgrasp.progress import Progress

from ..state.requests import MapRequest, MapResult
from .channel import Call, Cancel, Channel, Compiling, ComputedMap, Failure, Part, ProgressReport, Result
from .limits import limit_memory, ran_out_of_memory
from .map_service import MapService
from .plan_service import PlanService
from .survey_service import SurveyService
from .upload_service import UploadService

__all__ = ["serve"]

log = logging.getLogger(__name__)

REPORT_INTERVAL = 0.03
"""Time (s) between two reports of the progress."""

NICENESS = 10
"""By how much its priority is lower than the server's, which has to answer at once."""


def serve(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Answer calls until the connection is closed.

    Args:
        pipe: to the process that started this one.
        folders: where the files of an uploaded scene may lie.
    """
    os.nice(NICENESS)
    # Else numba makes a lock for processes forked from this one, which is left behind when it is killed.
    multiprocessing.set_start_method("spawn", force=True)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the server, which closes the pipe
    limit_memory()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        _Server(Channel(pipe), folders).run()
    except (EOFError, OSError):
        return  # the server closed the pipe


def _end_with_parent() -> None:
    """End this process as soon as the server has ended."""
    parent = parent_process()
    assert parent
    connection.wait([parent.sentinel])
    os._exit(1)


class _Server:
    def __init__(self, channel: Channel, folders: tuple[Path, ...]) -> None:
        self._channel = channel
        self._job_id, self._reported = 0, 0.0
        self._maps = MapService(self._send_map)
        plans, uploads = PlanService(self._maps, folders), UploadService(folders)
        self._methods: dict[str, Callable[..., Any]] = {
            "map": self._map, "compare": self._maps.compare, "explain": self._maps.explain,
            "probability": self._maps.probability, "windows": self._maps.windows,
            "elbow": self._maps.elbow,
            "plan": plans.plan, "more": plans.more, "motion": plans.motion, "open": plans.open,
            "write": plans.write,
            "read_scene": uploads.read_scene, "file_kind": uploads.file_kind,
            "measure": uploads.measure, "mount": uploads.mount,
            "survey": SurveyService(lambda part: channel.send(Part(part))).survey,
            "read_robot": uploads.read_robot, "put_robot": uploads.put_robot, "rearm": uploads.rearm,
        }  # fmt: skip

    def run(self) -> None:
        while True:
            message = self._channel.receive()
            if isinstance(message, Call):  # else it cancels a call that has ended
                self._job_id, self._reported = message.job_id, 0.0
                use_cores(message.cores)
                answer = self._answer(message)
                try:
                    self._channel.send(answer)
                except MemoryError:
                    self._channel.send(Failure(MemoryError()))

    def _answer(self, call: Call) -> Result | Failure:
        try:
            with notify_on_compile(lambda: self._channel.send(Compiling())):
                return Result(self._methods[call.method](*call.args, self._progress))
        except Cancelled:
            return Failure(Cancelled())
        except Exception as error:  # the server reports whatever a library raises
            if ran_out_of_memory(error):
                return Failure(MemoryError())
            if isinstance(error, SymgraspError):
                return Failure(error)
            log.exception("a computation failed")
            return Failure(_portable(error))

    def _map(self, request: MapRequest, progress: Progress) -> None:
        self._maps.map(request, progress, self._send_map)  # it is sent as a ComputedMap, as the others are

    def _send_map(self, result: MapResult) -> None:
        self._channel.send(ComputedMap(result.map, result.contacts, result.preliminary))

    def _progress(self, share: float) -> None:
        while self._channel.poll():
            if self._channel.receive() == Cancel(self._job_id):
                raise Cancelled
        now = time.monotonic()
        if now - self._reported > REPORT_INTERVAL:
            self._reported = now
            self._channel.send(ProgressReport(share))


def _portable(error: Exception) -> Exception:
    """Return an error that can be pickled and unpickled: itself, or one with the same text."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
