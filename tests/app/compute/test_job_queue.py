"""The queue of jobs: one job at a time, the newest wins, nothing kills it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from queue import Empty, Queue
from typing import Any

import pytest

from app.compute.compute_process import ProcessDied
from app.compute.job_queue import Job, JobQueue
from symgrasp.errors import NoPlanError

WAIT = 30.0


class Log:
    """Collects what listeners hear."""

    def __init__(self) -> None:
        self.heard: Queue[tuple[str, Any]] = Queue()

    def job(self, run: Callable[[Callable[[float], None]], Any], name: str = "") -> Job:
        def hears(kind: str) -> Callable[[Any], None]:
            return lambda value: self.heard.put((name + kind, value))

        compiling = lambda: hears("compiling")(None)  # noqa: E731
        return Job(run, hears("progress"), compiling, lambda: None, hears("done"), hears("failed"))

    def next(self) -> tuple[str, Any]:
        return self.heard.get(timeout=WAIT)


@pytest.fixture
def finished() -> threading.Event:
    return threading.Event()


@pytest.fixture
def jobs(finished) -> Iterator[JobQueue]:
    jobs = JobQueue("test", finished.set)
    yield jobs
    jobs.close()
    jobs.join(WAIT)


class Held:
    """A job that reports progress once it is let go."""

    def __init__(self) -> None:
        self.begun, self.go, self.stopped = threading.Event(), threading.Event(), threading.Event()

    def __call__(self, progress: Callable[[float], None]) -> str:
        self.begun.set()
        assert self.go.wait(WAIT)
        try:
            progress(0.5)
        except BaseException:
            self.stopped.set()
            raise
        return "held"


def test_a_job_reports_progress_and_its_result(jobs):
    log = Log()

    def run(progress):
        progress(0.25)
        return 42

    jobs.submit(log.job(run))
    assert log.next() == ("progress", 0.25)
    assert log.next() == ("done", 42)


def test_a_new_job_stops_the_old_one(jobs):
    log, held = Log(), Held()
    jobs.submit(log.job(held, "old "))
    assert held.begun.wait(WAIT)
    jobs.submit(log.job(lambda _: 1, "new "))
    held.go.set()
    assert held.stopped.wait(WAIT)
    kinds = []
    while not kinds or kinds[-1] != "new done":
        kinds.append(log.next()[0])
    assert set(kinds) <= {"old progress", "new done"}


def test_of_those_that_wait_only_the_newest_is_done(jobs):
    log, begun, go = Log(), threading.Event(), threading.Event()
    ran = []
    jobs.submit(log.job(lambda _: (begun.set(), go.wait(WAIT)), "deaf "))  # hears of no cancelling
    assert begun.wait(WAIT)
    for k in range(5):
        jobs.submit(log.job(lambda _, k=k: ran.append(k), f"{k} "))
    go.set()
    assert log.next()[0] == "4 done"
    assert ran == [4]


def test_cancel_stops_and_says_nothing(jobs):
    log, held = Log(), Held()
    jobs.submit(log.job(held))
    assert held.begun.wait(WAIT)
    jobs.cancel()
    held.go.set()
    assert held.stopped.wait(WAIT)
    jobs.submit(log.job(lambda _: "next", "next "))
    kinds = []
    while not kinds or kinds[-1] != "next done":
        kinds.append(log.next()[0])
    assert set(kinds) <= {"progress", "next done"}


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (NoPlanError("no grasp"), "no grasp"),
        (
            RuntimeError("two\nlines"),
            "unexpected RuntimeError: two lines; what you set is kept, and the physics begins anew",
        ),
        (ProcessDied("it ended"), "it ended; what you set is kept, and the physics begins anew"),
    ],
)
def test_an_error_is_one_line_and_the_queue_goes_on(jobs, error, text):
    log = Log()

    def run(progress):
        raise error

    jobs.submit(log.job(run))
    assert log.next() == ("failed", text)
    jobs.submit(log.job(lambda _: 1))
    assert log.next() == ("done", 1)


def test_only_what_nobody_expected_frees_what_jobs_use():
    restarts: list[str] = []
    jobs, log = JobQueue("test", lambda: restarts.append("anew")), Log()

    def breaks(error: Exception) -> Callable[[Callable[[float], None]], Any]:
        def run(progress: Callable[[float], None]) -> None:
            raise error

        return run

    try:
        jobs.submit(log.job(breaks(NoPlanError("no grasp"))))
        assert log.next()[0] == "failed"
        assert restarts == []
        jobs.submit(log.job(breaks(RuntimeError("physics"))))
        assert log.next()[0] == "failed"
        assert restarts == ["anew"]
    finally:
        jobs.close()
        jobs.join(WAIT)


def test_close_stops_the_job_and_frees_what_it_used(jobs, finished):
    log, held = Log(), Held()
    jobs.submit(log.job(held))
    assert held.begun.wait(WAIT)
    jobs.close()
    held.go.set()
    jobs.join(WAIT)
    assert held.stopped.is_set()
    assert finished.is_set()
    jobs.submit(log.job(lambda _: 1, "late "))
    with pytest.raises(Empty):
        while log.heard.get_nowait()[0] == "progress":
            pass
