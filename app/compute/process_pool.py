"""Starts the processes that compute, and keeps a spare one ready."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from contextlib import suppress
from pathlib import Path

from .channel import Channel
from .process_main import serve
from .turns import Turns

__all__ = ["ProcessPool", "WorkerProcess"]

# A process that only imports what all need, and is copied for each: they share its memory and start at once.
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload([f"{__package__}.preload"])


LEAST = 19
"""The niceness of a process with the lowest priority."""


class WorkerProcess:
    """A process that answers calls, and the channel to it; started at once.

    Args:
        folders: where the files of an uploaded scene may lie.

    Attributes:
        channel: to the process.
        job_id: number of the last call.
        reads: whether that call reads a file.
        cancelled_at: when (s, monotonic) that call was cancelled, if it has not ended since.
        compiling: whether the last that was heard of it is that it compiles.
    """

    def __init__(self, folders: tuple[Path, ...]) -> None:
        here, there = PROCESSES.Pipe()
        self.channel = Channel(here)
        self.job_id = 0
        self.reads = False
        self.cancelled_at: float | None = None
        self.compiling = False
        self._process = PROCESSES.Process(
            target=serve, args=(there, folders), name="symgrasp compute", daemon=True
        )
        self._process.start()
        there.close()

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process.pid
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    def give_way(self) -> None:
        """Let it compute only where no other process needs the core, for good."""
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, self.pid, LEAST)

    def pause(self) -> None:
        """Stop the process until it is resumed."""
        self._signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on."""
        self._signal(signal.SIGCONT)

    def _signal(self, number: int) -> None:
        with suppress(ProcessLookupError):  # it has died, which the next message from it says
            os.kill(self.pid, number)

    def leave(self) -> None:
        """Let it end by itself after what it does now: it notices at its next message that nobody listens."""
        self.give_way()
        self.channel.close()

    def end(self, grace: float = 0.0) -> str:
        """Kill the process.

        Args:
            grace: time (s) in which it may end by itself first.

        Returns:
            Signal or exit code by which it ended itself; empty if it was killed.
        """
        self._process.join(grace)
        code = self._process.exitcode
        self._process.kill()
        self._process.join()
        self.channel.close()
        return "" if code is None else signal.Signals(-code).name if code < 0 else f"exit code {code}"


class ProcessPool:
    """Starts processes and keeps a spare one, so that nobody waits for it; thread-safe.

    Args:
        folders: where the files of an uploaded scene may lie.

    Attributes:
        turns: which of them may compute.
    """

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = folders
        self.turns = Turns()
        self._lock = threading.Lock()
        self._spare: WorkerProcess | None = None
        self._compiling: WorkerProcess | None = None
        self._closed = False

    def prepare(self) -> None:
        """Start the spare process, unless there is one."""
        with self._lock:
            if self._spare is None and not self._closed:
                self._spare = WorkerProcess(self._folders)

    def take(self) -> WorkerProcess:
        """Return the spare process or a new one; the caller has to end it."""
        with self._lock:
            process, self._spare = self._spare, None
            if process and not process.is_alive:
                process.end()
                process = None
            process = process or WorkerProcess(self._folders)
        self.prepare()
        return process

    def end(self, process: WorkerProcess) -> None:
        """End a process that was taken.

        One that compiles ends that first, as the next would have to begin it anew, but only one at a time.
        """
        with self._lock:
            alone = self._compiling is None or not self._compiling.is_alive
            if process.compiling and process.is_alive and alone and not self._closed:
                self._compiling = process
                process.leave()
                return
        process.end()

    def close(self) -> None:
        """End the spare process, and what still compiles."""
        with self._lock:
            self._closed = True
            for process in (self._spare, self._compiling):
                if process:
                    process.end()
            self._spare = self._compiling = None
