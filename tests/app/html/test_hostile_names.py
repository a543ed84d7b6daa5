"""Whatever things are called, a page of them has the same tags, and no control character."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml

import app.html
from app.compute.plan_service import PlanRequest
from app.state import changes, job_changes
from app.state.plans import plan_changes
from app.state.requests import MapResult
from app.state.state import State
from symgrasp.feasibility.create import create_map
from symgrasp.files import SCENES_DIR
from symgrasp.scene.scene import Scene
from tests.app.state.states import results_of
from tests.hostile_names import HOSTILE_NAMES


def functions() -> Iterator[Callable[[State], str]]:
    """Every function of the package that says something of a state alone."""
    for path in sorted(Path(*app.html.__path__).glob("*.py")):
        module = import_module(f"app.html.{path.stem}")
        for name, function in inspect.getmembers(module, inspect.isfunction):
            required = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
            if name.endswith("_html") and [p.name for p in required] == ["state"]:
                yield function


@cache
def page(name: str) -> tuple[str, ...]:
    """Return all HTML of a scene in which everything has this name, with a plan, a pick and a problem."""
    content: dict[str, Any] = yaml.safe_load((SCENES_DIR / "log_two_robots.yaml").read_text())
    names = [name, name[1:] + "2"]
    content["name"], content["object"]["name"] = name, name[1:] + "3"
    for robot, new in zip(content["robots"], names, strict=True):
        robot["name"] = new
    for task in content["tasks"]:
        task.update(name=name, arms=names)
    scene = Scene.from_content(content).with_settings(heights=6, angles=12, redundancy=4)
    state = State.of(scene, name)
    the_map = MapResult(state.request, create_map(scene), ())
    state = job_changes.map_arrived(state, 0, the_map)
    climb = results_of(PlanRequest(scene, "bimanual", "hill_climb", scene.task().name))
    shown = [
        state,
        changes.choose_cell(state, 3, 6),
        job_changes.failed(job_changes.started(state, 1, f"Opening {name}"), f"{name} failed"),
        plan_changes.show_results(state, results_of(PlanRequest(scene, "bimanual", "", scene.task().name))),
        plan_changes.show_results(state, replace(climb)),
    ]
    texts = [function(each) for function in functions() for each in shown]
    return tuple(texts)


class Tags(HTMLParser):
    """The tags of a document, with the names of their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[Any] = []
        self.words = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, [name for name, _ in attrs]))

    def handle_endtag(self, tag: str) -> None:
        self.tags.append(tag)

    def handle_comment(self, data: str) -> None:
        self.tags.append("comment")

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.mark.parametrize("name", HOSTILE_NAMES.values(), ids=HOSTILE_NAMES)
def test_names_are_text(name):
    plain, hostile = page("plain"), page(name)
    assert len(plain) == len(hostile) > 50
    for ours, theirs in zip(plain, hostile, strict=True):
        assert Tags(ours).tags == Tags(theirs).tags
        assert all(c.isprintable() or c == "\n" for c in theirs)
    with_name = sum("plain" in Tags(text).words for text in plain)
    assert sum(name in Tags(text).words for text in hostile) == with_name or not name.isprintable()
