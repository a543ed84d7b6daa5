"""Surveys that the page could have run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.state.state import State
from app.state.surveys.survey import Places, Stand, SurveyKind, SurveyRun, SurveyValue
from app.state.surveys.survey_changes import change_survey, places_arrived, survey_ended, survey_started
from symgrasp.survey.placement import Base
from tests.conftest import load_small

BASES = (Base(0.1, 0.2, 0.0, 90.0), Base(-0.1, 0.0, 0.0, 0.0))


def surveyed(kind: SurveyKind = "object", value: SurveyValue = "share") -> State:
    """A scene with a survey of two places, the second of which cannot be."""
    state = State.of(load_small("bottle_on_table"), "bottle_on_table")
    state = change_survey(state, lambda s: replace(s, kind=kind, value=value))
    nan = np.nan
    places = Places(
        xy=np.array([[0.4, 0.2], [0.6, -0.2]]), size=np.full(2, 0.2), state=np.array([1, 2]),
        share=np.array([0.5, nan]), margin=np.array([0.01, nan]), plan=np.array([nan, nan]), z=0.0,
        bases=BASES if kind == "robot" else (),
    )  # fmt: skip
    state = survey_started(state, 7, state.survey_request)
    state = places_arrived(state, SurveyRun(7, "Places", 1, 4, 2.0), places)
    return survey_ended(state, 7, (Stand(BASES[0], 0.02),) if kind == "robot" else ())
