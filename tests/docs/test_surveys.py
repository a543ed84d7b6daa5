"""What docs/surveys.md says of costs is what the benchmark measured."""

from __future__ import annotations

import json

import pytest

from docs.surveys import BEGIN, END, MEASURED, PAGE, costs, seconds
from symgrasp.bench import survey
from symgrasp.bench.figures import keyed


def test_the_page_says_what_was_measured():
    """What fails here is mended by ``python -m docs.surveys``."""
    content = json.loads(MEASURED.read_text(encoding="utf-8"))
    text = PAGE.read_text(encoding="utf-8")
    assert text.split(BEGIN)[1].split(END)[0].strip() == costs(content).strip()


def test_a_survey_takes_what_its_parts_take():
    """A hundred points of 20 ms, every one in a scene of 80 ms, on two cores that are half free."""
    assert seconds(2.0, 0.02, 0.08, 100, 100, 2 * 0.5) == pytest.approx(2.0 + 10.0)


def test_points_cost_little_besides_their_maps_and_scenes_cost_time():
    found = keyed([*survey.overhead(side=4, rounds=1), *survey.scenes(count=3)])
    assert set(found) == {
        "a map alone, one core",
        "a map alone, one core: a point of a survey, with all that is written, over it",
        "a map alone, one core: writing a batch",
        "a world and an engine for another scene, pick_pour_place",
    }
    assert all(value > 0 for figure in found.values() for value in figure.values)
