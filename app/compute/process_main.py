"""The main loop of a process that computes for one browser and has all of its PyBullet."""

from __future__ import annotations

import logging
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

from app.compute.channel import Channel
from app.compute.map_service import MapService
from app.compute.plan_service import PlanService
from app.state.requests import MapRequest, MapResult
from symgrasp.compiling import notify_on_compile
from symgrasp.errors import Cancelled, SymgraspError
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.world import check_tasks

__all__ = ["serve"]

log = logging.getLogger(__name__)

TELL = 0.03
"""Time (s) between two words about the progress."""


def serve(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Run errands until the other end hangs up.

    Args:
        pipe: to the process that started this one.
        folders: where the files of an uploaded scene may lie.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the server, which hangs up
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        _Child(Channel(pipe, "child"), folders).work()
    except (EOFError, OSError):
        return  # the other end hung up


def _end_with_parent() -> None:
    """End at once, whatever is being computed, when the server is gone."""
    parent = parent_process()
    assert parent
    connection.wait([parent.sentinel])
    os._exit(1)


class _Child:
    def __init__(self, line: Channel, folders: tuple[Path, ...]) -> None:
        self._line = line
        self._errand, self._told = 0, 0.0
        bench = MapService(_Shelf(folders, self._ask, self._tell))
        plans = PlanService(bench)
        self._skills: dict[str, Callable[..., Any]] = {
            "map": bench.map, "check": bench.check, "explain": bench.explain, "check_tasks": _check_tasks,
            "run": plans.run, "more": plans.more, "open": plans.open,
        }  # fmt: skip

    def work(self) -> None:
        while True:
            word, number, content = self._line.receive()
            if word == "do":  # else it is about an errand that is over
                self._errand, self._told = number, 0.0
                self._tell(*self._do(*content))
                self._line.forget_maps()

    def _do(self, name: str, args: tuple[Any, ...]) -> tuple[str, Any]:
        try:
            with notify_on_compile(lambda: self._tell("compiling", None)):
                return "done", self._skills[name](*args, self._progress)
        except Cancelled:
            return "failed", Cancelled()
        except SymgraspError as error:
            return "failed", error
        except Exception as error:  # whatever a library raises is told
            log.exception("a computation failed")
            return "failed", _portable(error)

    def _progress(self, share: float) -> None:
        while self._line.connection.poll():
            self._hear()
        now = time.monotonic()
        if now - self._told > TELL:
            self._told = now
            self._tell("progress", share)

    def _hear(self) -> tuple[str, Any]:
        word, number, content = self._line.receive()
        if word == "cancel" and number == self._errand:
            raise Cancelled
        return word, content

    def _ask(self, request: MapRequest) -> MapResult | None:
        self._tell("known?", request)
        while True:
            word, content = self._hear()
            if word == "known":
                return content

    def _tell(self, word: str, content: object) -> None:
        self._line.send((word, self._errand, content))


class _Shelf:
    """What the server keeps, asked for over the line; in the place of `app.compute.cache.SharedCache`."""

    def __init__(
        self,
        folders: tuple[Path, ...],
        ask: Callable[[MapRequest], MapResult | None],
        tell: Callable[[str, object], None],
    ) -> None:
        self.folders, self.map, self._tell = folders, ask, tell

    def keep(self, result: MapResult) -> None:
        self._tell("keep", result)


def _check_tasks(scene: Scene, progress: Progress) -> None:
    progress(0.0)
    check_tasks(scene)


def _portable(error: Exception) -> Exception:
    """Return an error that arrives: some cannot be pickled, or not be built again."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
