"""Prints how long the page waits for maps while a survey runs in the background: ``make background``."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from queue import SimpleQueue
from statistics import median

import numpy as np

from app.compute.compute_process import ComputeProcess
from app.compute.process_pool import ProcessPool
from app.compute.survey_service import SurveyPart
from app.state import changes
from app.state.state import State
from app.state.surveys.survey_changes import change_survey
from symgrasp.errors import Cancelled
from symgrasp.scene.scene import Scene

__all__ = ["waits"]

SCENE = "bottle_on_table"

SPACING = 0.02
"""Distance (m) of the places of the survey, which then takes longer than is measured."""

COUNT, ROUNDS = 20, 6
"""How many maps a round has, and how often rounds without and with a survey take turns."""

PAUSE = 0.1
"""Time (s) between two maps, in which the survey goes on."""


def waits(count: int = COUNT, rounds: int = ROUNDS) -> Iterator[tuple[bool, float]]:
    """Yield whether a survey ran, and the time (s) from the request of a map until it is there, many times.

    As sessions do it: maps in one process, the survey in another that rests meanwhile. No two maps are for
    the same pose.

    Args:
        count: how many maps a round has.
        rounds: how often rounds without and with a survey take turns.
    """
    pool, found = ProcessPool(()), SimpleQueue[SurveyPart | None]()
    maps = ComputeProcess(pool)
    surveys = ComputeProcess(pool, part=found.put, background=True)
    state = State.of(Scene.load(SCENE), SCENE)
    state = change_survey(state, lambda own: replace(own, spacing={**own.spacing, "object": SPACING}))
    places = iter(np.linspace(0.4, 0.6, 1 + 2 * rounds * count).tolist())

    def wait() -> float:
        request = changes.moved(state, x=next(places)).request
        began = time.perf_counter()
        maps.map(request, lambda _: None)
        return time.perf_counter() - began

    try:
        wait()  # which starts the process
        for _ in range(rounds):
            for runs in (False, True):
                with _running(surveys, state, found) if runs else _nothing():
                    for _ in range(count):
                        time.sleep(PAUSE)
                        yield runs, wait()
    finally:
        maps.close()
        surveys.close()
        pool.close()


@contextmanager
def _nothing() -> Iterator[None]:
    yield


@contextmanager
def _running(surveys: ComputeProcess, state: State, found: SimpleQueue[SurveyPart | None]) -> Iterator[None]:
    """Run a survey in the ``with`` block, which begins when it has found something, and until it has again.

    Args:
        surveys: the process that computes it.
        state: says which survey.
        found: receives what the survey finds; and None at its end.

    Raises:
        RuntimeError: the survey has ended by itself.
    """
    stop = threading.Event()

    def progress(_: float) -> None:
        if stop.is_set():
            raise Cancelled

    def run() -> None:
        try:
            surveys.survey(state.survey_request, progress)
        except Cancelled:
            return
        finally:
            found.put(None)

    def goes_on() -> None:
        """Wait until the survey finds something more."""
        waiting = [found.get() for _ in range(max(1, found.qsize()))]
        if None in waiting:
            raise RuntimeError("the survey ended by itself meanwhile")

    thread = threading.Thread(target=run)
    thread.start()
    try:
        goes_on()
        yield
        goes_on()
    finally:
        stop.set()
        thread.join()
        while not found.empty():
            found.get()


if __name__ == "__main__":
    times: dict[bool, list[float]] = {False: [], True: []}
    for runs, taken in waits():
        times[runs].append(taken)
    for runs, own in times.items():
        what = "while a survey runs" if runs else "while none runs"
        most = np.quantile(own, 0.95)
        print(f"a map {what}: median {1e3 * median(own):.0f} ms, 95 % within {1e3 * most:.0f} ms")
    print(f"median over median: × {median(times[True]) / median(times[False]):.2f}")
