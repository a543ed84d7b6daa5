"""Changes of the state by surveys, and by what a person does with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from symgrasp.survey.placement import Base

from ..changes import moved
from ..object_pose import ObjectPose
from ..robot_changes import robot_put_at
from ..state import State
from .survey import Places, Stand, SurveyRequest, SurveyRun, SurveyState

__all__ = [
    "change_survey", "choose_place", "places_arrived", "stand_at", "survey_ended", "survey_started",
]  # fmt: skip


def change_survey(state: State, change: Callable[[SurveyState], SurveyState]) -> State:
    """Change the part of the state about surveys."""
    return replace(state, survey=change(state.survey))


def survey_started(state: State, number: int, request: SurveyRequest) -> State:
    """Record that a survey was started, in place of the one under way."""
    run = SurveyRun(number)
    survey = replace(state.survey, request=request, places=None, stands=(), run=run, problem="", shown=True)
    return replace(state, survey=survey)


def places_arrived(state: State, run: SurveyRun, places: Places) -> State:
    """Show what a survey has found so far, and how far it is, if it is the one under way."""
    if state.survey.run is None or state.survey.run.number != run.number:
        return state
    return change_survey(state, lambda s: replace(s, run=run, places=places))


def survey_ended(state: State, number: int, stands: tuple[Stand, ...] = (), problem: str = "") -> State:
    """Record that a survey has ended, was stopped or failed; what it has found so far stays."""
    if state.survey.run is None or state.survey.run.number != number:
        return state
    return change_survey(state, lambda s: replace(s, run=None, stands=stands, problem=problem))


def choose_place(state: State, index: int) -> State:
    """Put the object to a place of the survey; or the robot, to the best base that was tried there."""
    places = state.shown_places
    if places is None or not 0 <= index < len(places.xy):
        return state
    x, y = places.xy[index].tolist()
    if not places.bases:
        x, y = places.xy[index].tolist()
        return moved(replace(state, step=None), x=x, y=y)
    return _moved_to(state, places.bases[index])


def stand_at(state: State, index: int) -> State:
    """Put the robot to one of the best bases."""
    if state.shown_places is None or not 0 <= index < len(state.survey.stands):
        return state
    return _moved_to(state, state.survey.stands[index].base)


def _moved_to(state: State, base: Base) -> State:
    pose = base.moved(state.robot.T_world_base)
    return robot_put_at(state, state.robot.name, ObjectPose.of(pose))
