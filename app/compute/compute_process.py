"""Where one browser's maps and plans are computed: a process of its own, which may die without harm."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from app.compute.cache import SharedCache
from app.compute.map_service import Maps
from app.compute.plan_service import OpenedPlan, PlanRequest
from app.compute.process_pool import ProcessPool, _Process
from app.state.plan_results import PlanResult, PlanResults
from app.state.requests import (
    CompareRequest,
    Comparison,
    ExplainRequest,
    ExplainResult,
    MapRequest,
    MapResult,
)
from symgrasp.errors import Cancelled, NoPlanError
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene

__all__ = ["ComputeProcess", "ProcessDied"]

TICK = 0.05
"""Time (s) after which a cancel is heard although the process says nothing."""

PATIENCE = 10.0
"""How long (s) a process may take to hear a cancel. Compiled code and new physics worlds take their time."""

MOST_THINGS = 500
"""Scenes and parts of scenes that a process keeps; then another takes its place."""


class ProcessDied(Exception):
    """The process ended in the middle of a computation."""


class ComputeProcess:
    """Computes for one browser; used by one thread at a time.

    `MapService` and `PlanService` do the computing in the process, which is started when it is first needed.

    Args:
        store: knows the maps that were computed before, and keeps new ones.
        staff: starts the process.
        compiling: called when the process compiles something for the first time on this machine.
    """

    def __init__(
        self, store: SharedCache, pool: ProcessPool, compiling: Callable[[], None] = lambda: None
    ) -> None:
        self._store, self._pool, self._compiling = store, pool, compiling
        self._process: _Process | None = None
        self._lister: _Process | None = None

    @property
    def pid(self) -> int | None:
        """Number of the process, None when there is none."""
        return self._process.pid if self._process else None

    def close(self) -> None:
        """End the process; the next computation starts another."""
        process, self._process = self._process, None
        if process:
            process.end()

    def map(self, request: MapRequest, progress: Progress) -> MapResult:
        """Return the map of a request, computed unless it is known."""
        return self._store.map(request) or self._do("map", progress, request)

    def check(self, request: CompareRequest, known: FeasibilityMap, progress: Progress) -> Comparison:
        """Compute the map of the turned object from scratch, and compare it with the shifted one."""
        return self._do("check", progress, request, known)

    def explain(self, request: ExplainRequest, progress: Progress) -> ExplainResult:
        """Judge every candidate of a cell."""
        return self._do("explain", progress, request)

    def check_tasks(self, scene: Scene, progress: Progress) -> None:
        """Check the tasks of a scene that came from outside."""
        self._do("check_tasks", progress, scene)

    def run(self, order: PlanRequest, plan_results: PlanResults, progress: Progress) -> PlanResults:
        """Run a planner; return the book with what it found, or with why it found nothing."""
        found = self._do("run", progress, order, plan_results.cleared())
        self._lister = self._process
        return found

    def more(self, maps: Maps, progress: Progress) -> tuple[tuple[PlanResult, ...], bool]:
        """Return further plans of the last run, and whether there may be still more.

        Raises:
            NoPlanError: the process of the last run is gone, and its list with it.
        """
        if self._process is None or self._process is not self._lister:
            raise NoPlanError("the list of solutions ended with the process that made it: plan again")
        return self._do("more", progress, maps)

    def open(self, content: bytes, name: str, progress: Progress) -> OpenedPlan:
        """Read a plan file and verify it; if it holds, return all that is needed to show it."""
        return self._do("open", progress, content, name)

    def _do(self, name: str, progress: Progress, *args: object) -> Any:
        process = self._ready(name, progress)
        line = process.line
        process.job_id += 1
        try:
            line.forget_maps()
            line.send(("do", process.job_id, (name, args)))
            return self._follow(process, progress)
        except Cancelled:
            process.unheard = time.monotonic()
            with suppress(OSError):  # dead already: found out when it is needed next
                line.send(("cancel", process.job_id, None))
            raise
        except (EOFError, OSError) as error:
            self._process = None
            how = process.end(grace=1.0)  # a pipe may end a little before its process does
            raise ProcessDied(
                f"the process that computes ended unexpectedly ({how or 'it hung up'})"
            ) from error

    def _ready(self, name: str, progress: Progress) -> _Process:
        """Return a process that waits for an errand."""
        process = self._process
        if process and process.unheard is not None:
            try:
                self._drain(process, process.unheard, progress)
            except (EOFError, OSError):
                self.close()
        elif process and (not process.is_alive or (process.line.known > MOST_THINGS and name != "more")):
            self.close()
        if self._process is None:
            self._process = self._pool.take()
        return self._process

    def _drain(self, process: _Process, since: float, progress: Progress) -> None:
        """Wait until the process has heard the cancel, but not for ever."""
        while process.unheard is not None:
            if process.line.connection.poll(TICK):
                word, _, content = process.line.receive()
                if word == "keep":
                    self._store.keep(content)
                elif word in ("done", "failed"):
                    process.unheard = None
            if process.unheard is not None and time.monotonic() - since > PATIENCE:
                self.close()
                return
            progress(0.0)

    def _follow(self, process: _Process, progress: Progress) -> Any:
        """Return what comes out of an errand."""
        line, share = process.line, 0.0
        while True:
            if not line.connection.poll(TICK):
                progress(share)
                continue
            word, _, content = line.receive()
            if word == "progress":
                share = content
                progress(share)
            elif word == "known?":
                line.send(("known", process.job_id, self._store.map(content)))
            elif word == "keep":
                self._store.keep(content)
            elif word == "compiling":
                self._compiling()
            elif word == "failed":
                if isinstance(content, (EOFError, OSError)):
                    raise RuntimeError(f"{type(content).__name__}: {content}")
                raise content
            else:
                return content
