"""What docs/surveys.md says of costs is what the benchmark measured."""

from __future__ import annotations

import json

import pytest

from docs.surveys import BEGIN, END, MEASURED, PAGE, Costs, costs
from symgrasp.bench import survey
from symgrasp.bench.figures import keyed


def test_the_page_says_what_was_measured():
    """What fails here is mended by ``python -m docs.surveys``."""
    content = json.loads(MEASURED.read_text(encoding="utf-8"))
    text = PAGE.read_text(encoding="utf-8")
    assert text.split(BEGIN)[1].split(END)[0].strip() == costs(content).strip()


def test_a_survey_takes_what_its_parts_take():
    costs = Costs(start=2.0, point=0.02, scene=0.08, batch=0.5)
    assert costs.seconds(640, 640, 2 * 0.5) == pytest.approx(2.0 + 64.0)
    assert costs.seconds(640, 1, 1000) == pytest.approx(2.0 + 5.0)  # as fast as ten batches are handed out


def test_points_cost_little_besides_their_maps_and_scenes_cost_time():
    found = keyed([*survey.overhead(sides=(4,), most=4, rounds=1), *survey.scenes(count=3)])
    assert set(found) == {
        "a map alone, one core",
        "a map alone, one core: a point of 16, with all that is written, over it",
        "a map alone, one core: writing a batch of 1",
        "a world and an engine for another scene, pick_pour_place",
    }
    assert all(value > 0 for figure in found.values() for value in figure.values)
