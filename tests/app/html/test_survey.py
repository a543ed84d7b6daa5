"""Surveys in words and as a picture."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from app.html.survey import places_html, run_html, stands_html
from app.state.surveys.survey import SurveyRun
from app.state.surveys.survey_changes import places_arrived, survey_started
from tests.app.surveyed import surveyed


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("share", ["feasible cells (%)", "50<"]),
        ("margin", ["largest margin (mm)", "10<"]),
        ("plan", ["a plan for all tasks: 0 places", "none: 1 place<"]),
    ],
)
def test_the_picture_says_what_its_colours_are(value, words):
    html = places_html(surveyed("object", value))
    assert html.count("<rect") == 2
    assert "the object would be inside something: 1 place<" in html
    assert all(word in html for word in words)


def test_every_place_has_its_number_and_marks_let_clicks_through():
    state = surveyed()
    assert state.survey.places
    root = ElementTree.fromstring(places_html(state).partition("</svg>")[0] + "</svg>")
    places = {int(rect.attrib["data-place"]): rect.attrib for rect in root.findall("rect")}
    for k, (x, y) in enumerate(state.survey.places.xy):
        half = float(places[k]["width"]) / 2
        assert float(places[k]["x"]) + half == pytest.approx(x, abs=1e-3)
        assert float(places[k]["y"]) + half == pytest.approx(-y, abs=1e-3)
    (marks,) = root.findall("g")
    assert marks.attrib["pointer-events"] == "none"
    assert {child.tag for child in root} == {"rect", "g"}


def test_progress_says_rate_and_time_left():
    state = surveyed()
    places = state.survey.places
    assert places
    state = survey_started(state, 9, state.survey_request)
    assert "Preparing" in run_html(state)
    run = SurveyRun(9, "Places", 10, 40, 5.0)
    state = places_arrived(state, run, places)
    assert "Places: 10 of 40, 2.0 a second, 0:00:15 left" in run_html(state)


def test_bases_are_listed():
    html = stands_html(surveyed("robot"))
    assert "<td>10</td><td>20</td><td>90°</td><td>20.0 mm</td>" in html
    assert stands_html(surveyed()) == ""
