"""What is wrong with a file is said in the words of the file formats, not in those of Python."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import yaml

from symgrasp.errors import SymgraspError, as_written
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import plan_sequential
from symgrasp.scene.scene import Scene
from symgrasp.survey.format import SurveyFile
from symgrasp.survey.survey import Survey
from tests.conftest import load_small

PYTHON = re.compile(
    r"(?<![.\w'])(None|True|False|NoneType|tuple|Tuple|dict|dictionary|Dictionary|instance|float64|inf|nan|str|bool)\b"
)

WRONG: tuple[Any, ...] = (
    None, [], {}, True, "x", -5, 0.5, [None], {"a": None}, [True, []], float("nan"), float("inf"), [[1]], "",
    10**400, [*range(10)],
)  # fmt: skip


def places(data: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the places of plain data; of lists, those of the first entry."""
    yield at
    entries = (
        data.items() if isinstance(data, dict) else enumerate(data[:1]) if isinstance(data, list) else ()
    )
    for key, below in entries:
        yield from places(below, (*at, key))


def replaced(data: Any, at: tuple[Any, ...], value: Any) -> Any:
    if not at:
        return value
    data = inner = copy.deepcopy(data)
    for key in at[:-1]:
        inner = inner[key]
    inner[at[-1]] = value
    return data


def scene_content(name: str) -> Any:
    return json.loads(json.dumps(load_small(name).content))


def plan_content() -> Any:
    return json.loads(plan_sequential(load_small("soda_can")).model_dump_json())


@pytest.mark.parametrize(
    ("content", "read"),
    [
        (lambda: scene_content("pick_pour_place"), lambda data: Scene.from_content(data, "scene.yaml")),
        (lambda: scene_content("log_two_robots"), lambda data: Scene.from_content(data, "scene.yaml")),
        (plan_content, lambda data: Plan.parse(json.dumps(data).encode(), "plan.json")),
    ],
    ids=["sequence", "hands", "plan"],
)
def test_no_wrong_value_is_answered_in_words_of_python(
    content: Callable[[], Any], read: Callable[[Any], object]
):
    data, refused = content(), 0
    for at in places(data):
        for value in WRONG:
            try:
                read(replaced(data, at, value))
            except SymgraspError as error:
                refused += 1
                assert not PYTHON.search(str(error)), str(error)
    assert refused > 500


def test_a_survey_is_answered_so_as_well(tmp_path):
    axis = {"name": "x", "of": "position.x", "values": [0.5]}
    data = {"schema_version": 1, "name": "small", "scene": "soda_can", "axes": [axis]}
    SurveyFile.model_validate(data)
    path = tmp_path / "survey.yaml"
    for at in places(data):
        for value in (None, [], {}, True, [True, None]):
            path.write_text(yaml.safe_dump(replaced(data, at, value)))
            try:
                Survey.load(path)
            except SymgraspError as error:
                assert not PYTHON.search(str(error)), str(error)


@pytest.mark.parametrize(
    "value",
    [
        None, True, 3, 0.1, -0.0, 1e-300, "a", "it's", "", "null", "1", [], {}, ["a", None, True, [1.5]],
        {"a": None, "b c": [False], "x.y": {"z": "w"}}, float("inf"),
    ],
)  # fmt: skip
def test_what_is_written_of_a_value_is_read_back(value):
    assert yaml.safe_load(as_written(value)) == value


def test_what_yaml_does_not_have_is_written_as_what_it_stands_for(tmp_path):
    assert as_written(("a", tmp_path)) == f"['a', '{tmp_path}']"
    assert as_written({"b", "a"}) == "['a', 'b']"
    assert as_written(list(range(9))) == "[0, 1, 2, 3, 4, 5, 6, 7, …]"
    assert as_written([[[[[1]]]]]) == "[[[[[…]]]]]"
