"""What people do with surveys: results stay as long as they are about what is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.html.survey import places_html
from app.state.changes import moved, open_scene, turn
from app.state.robot_changes import place_robot
from app.state.surveys.survey import SurveyRun
from app.state.surveys.survey_changes import (
    change_survey,
    choose_place,
    places_arrived,
    stand_at,
    survey_ended,
    survey_started,
)
from app.state.undo import remember, undo
from symgrasp.survey.placement import Base
from tests.app.surveyed import BASES, surveyed
from tests.conftest import load_small


def test_a_chosen_place_takes_the_object_there_and_keeps_the_survey():
    state = choose_place(surveyed(), 0)
    assert state.T_world_object[:3, 3].tolist() == [0.4, 0.2, 0.0]
    assert state.shown_places is not None
    assert choose_place(state, 5) is state  # as of a survey that was replaced meanwhile


@pytest.mark.parametrize("choose", [choose_place, stand_at])
def test_a_chosen_base_takes_the_robot_there_and_keeps_the_survey(choose):
    state = choose(surveyed("robot"), 0)
    base = Base.of(state.robot.T_world_base)
    assert np.allclose(base, BASES[0])
    assert state.shown_places is not None


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("object", lambda s: moved(s, lean=0.3)),
        ("object", lambda s: moved(s, z=0.1)),
        ("object", lambda s: place_robot(s, x=0.1)),
        ("robot", lambda s: moved(s, x=0.4)),
        ("object", lambda s: change_survey(s, lambda own: replace(own, kind="robot"))),
        ("object", lambda s: open_scene(s, load_small("soda_can"), "soda_can")),
    ],
)
def test_a_survey_of_something_else_is_not_shown(kind, change):
    before = surveyed(kind)
    state = change(before)
    assert before.shown_places is not None
    assert state.shown_places is None
    assert "<svg" not in places_html(state)
    assert "something else" in places_html(state)
    assert choose_place(state, 0) is state


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("object", lambda s: moved(s, x=0.1, y=0.3)),
        ("object", lambda s: turn(s, 0.4)),
        ("robot", lambda s: place_robot(s, x=0.3, spin=1.0)),
    ],
)
def test_a_survey_stays_while_only_what_it_moves_is_moved(kind, change):
    assert change(surveyed(kind)).shown_places is not None


def test_undo_brings_the_object_back_and_keeps_the_survey():
    before = surveyed()
    after = remember(before, choose_place(before, 0), "", 1.0)
    back = undo(after)
    assert back.T_world_object[:2, 3].tolist() == before.T_world_object[:2, 3].tolist()
    assert back.survey is after.survey


def test_what_another_survey_says_is_ignored():
    state = surveyed()
    started = survey_started(state, 8, state.survey_request)
    assert state.survey.places
    assert places_arrived(started, SurveyRun(7), state.survey.places) is started
    assert survey_ended(started, 7) is started
    assert survey_ended(started, 8, problem="no").survey.problem == "no"
