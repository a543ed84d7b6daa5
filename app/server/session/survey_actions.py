"""What the widgets about surveys do: surveys run on a thread and in a process of their own."""

from __future__ import annotations

import itertools
import time

from symgrasp.progress import Progress

from ...compute.compute_process import ComputeProcess
from ...compute.job_queue import Job, JobQueue
from ...compute.process_pool import ProcessPool
from ...compute.survey_service import SurveyPart
from ...state.surveys.survey import Stand, SurveyRun
from ...state.surveys.survey_changes import places_arrived, survey_ended, survey_started
from .session_api import SessionApi

__all__ = ["SurveyActions"]


class SurveyActions:
    """The actions about surveys of one browser; see `app.panels.actions.SurveyActions`.

    Maps go before surveys: a survey rests whenever anybody computes something else.

    Args:
        session: the browser's session.
        pool: starts the process.
        client_id: number of the browser.
    """

    def __init__(self, session: SessionApi, pool: ProcessPool, client_id: int) -> None:
        self._session = session
        self._numbers = itertools.count(1)
        self._process = ComputeProcess(pool, part=self._show, background=True)
        self._jobs = JobQueue(f"jobs of surveys {client_id}", self._process.close)
        self._computed, self._since = (
            0,
            0.0,
        )  # the number of the survey that is computed; of the queue's thread

    def close(self) -> None:
        """End the thread and the process."""
        self._jobs.close()

    def run(self) -> None:
        """Run the survey of what is shown, in place of the one under way."""
        state = self._session.state
        if state is None:
            return
        number, request = next(self._numbers), state.survey_request

        def run(progress: Progress) -> tuple[Stand, ...]:
            self._computed, self._since = number, time.monotonic()
            return self._process.survey(request, progress)

        self._session.change(lambda s: survey_started(s, number, request))
        self._jobs.submit(
            Job(
                run,
                progress=lambda _: None,
                compiling=lambda: None,
                waiting=lambda: None,
                done=lambda stands: self._session.change(lambda s: survey_ended(s, number, stands)),
                failed=lambda problem: self._session.change(
                    lambda s: survey_ended(s, number, problem=problem)
                ),
            )
        )

    def stop(self) -> None:
        """Stop the survey under way; what it has found stays."""
        self._jobs.cancel()
        self._session.change(lambda s: survey_ended(s, s.survey.run.number) if s.survey.run else s)

    def _show(self, part: SurveyPart) -> None:
        run = SurveyRun(self._computed, part.label, part.points, part.of, time.monotonic() - self._since)
        self._session.change(lambda s: places_arrived(s, run, part.places))
