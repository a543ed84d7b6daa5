"""A queue that runs computations one at a time on its own thread; a new job replaces all others."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from symgrasp.compiling import notify_on_compile
from symgrasp.errors import Cancelled, SymgraspError
from symgrasp.progress import Progress

from .compute_process import ProcessDied

__all__ = ["Job", "JobQueue"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Job:
    """A computation and its callbacks; all run on the thread of the queue.

    Attributes:
        run: computes; calls its argument with the finished share, which may raise `Cancelled`.
        progress: called with the finished share.
        compiling: called when code has to be compiled.
        waiting: called while it waits for computations of others.
        done: called with the result.
        failed: called with one line about what went wrong.
    """

    run: Callable[[Progress], Any]
    progress: Progress
    compiling: Callable[[], None]
    waiting: Callable[[], None]
    done: Callable[[Any], None]
    failed: Callable[[str], None]


class JobQueue:
    """One thread, with room for one waiting job.

    A new job replaces the waiting one and cancels the one under way, which stops at its next
    progress; a callback of it that is already running still ends.

    Args:
        name: of the thread.
        finish: frees what the jobs used; called on the thread at its end and after a job failed unexpectedly.
    """

    def __init__(self, name: str, finish: Callable[[], object]) -> None:
        self._finish = finish
        self._changed = threading.Condition()
        self._waiting: Job | None = None
        self._running: Job | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Job) -> None:
        """Run a job next; the waiting job is dropped and the one under way cancelled."""
        with self._changed:
            if not self._closed:
                self._waiting, self._running = job, None
                self._changed.notify()

    def cancel(self) -> None:
        """Cancel the job under way and drop the waiting one."""
        with self._changed:
            self._waiting = self._running = None

    def compiling(self) -> None:
        """Call `Job.compiling` of the job under way."""
        if job := self._running:
            job.compiling()

    def waiting(self) -> None:
        """Call `Job.waiting` of the job under way."""
        if job := self._running:
            job.waiting()

    def close(self) -> None:
        """Cancel everything and end the thread; may be called from any thread and more than once."""
        with self._changed:
            self._closed = True
            self._waiting = self._running = None
            self._changed.notify()

    def join(self, timeout: float | None = None) -> None:
        """Wait until the thread has ended after `close`."""
        self._thread.join(timeout)

    def _work(self) -> None:
        try:
            while job := self._next():
                self._do(job)
        finally:
            self._finish()

    def _next(self) -> Job | None:
        with self._changed:
            self._running = None
            self._changed.wait_for(lambda: self._closed or self._waiting)
            self._running, self._waiting = self._waiting, None
            return None if self._closed else self._running

    def _do(self, job: Job) -> None:
        def progress(share: float) -> None:
            self._notify(job, job.progress, share)
            if self._running is not job:
                raise Cancelled

        try:
            with notify_on_compile(self.compiling):
                result = job.run(progress)
        except Cancelled:
            return
        except SymgraspError as error:
            self._notify(job, job.failed, str(error))
        except Exception as error:  # whatever a library raises must not end the thread
            if self._closed:  # nobody waits, and what the job used may be gone already
                log.info("a computation failed as its session ended", exc_info=error)
                return
            died = isinstance(error, ProcessDied)
            log.error("a computation failed", exc_info=None if died else error)
            self._finish()
            text = " ".join(str(error).split())
            text = text if died else f"unexpected {type(error).__name__}: {text}"
            self._notify(job, job.failed, f"{text}; what you set is kept, and the physics begins anew")
        else:
            self._notify(job, job.done, result)

    def _notify(self, job: Job, callback: Callable[[Any], None], value: Any) -> None:
        if self._running is job:
            callback(value)
