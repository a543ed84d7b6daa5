"""The list of plans as the page has it: every row different, sorted by every column, clicked anywhere."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from app.html.solutions import solutions_html
from app.state.plans import plan_changes
from app.state.plans.solution_order import COLUMNS
from app.state.state import State
from tests.app.state.states import with_plan

CASES = [("pick_pour_place", "sequential"), ("log_two_robots", "bimanual"), ("log_four_robots", "bimanual")]


def rows(state: State) -> list[list[str]]:
    """Return the texts of all rows, the headings first."""
    html = solutions_html(state, lambda key: f"target{key}")
    cell = r'role="(?:cell|columnheader)"[^>]*>([^<]*)<'
    return [re.findall(cell, row) for row in html.split('role="row"')[1:]]


def number(text: str) -> float:
    """Return the first number of a cell; hands that overlap have the least gap."""
    return -1.0 if text == "overlap" else float(text.removeprefix("> ").split(", ")[0])


@pytest.fixture(params=CASES, ids=lambda case: case[0])
def state(request: pytest.FixtureRequest) -> State:
    state = with_plan(*request.param)
    assert len(state.plan_results.plans) > 2
    return state


def test_no_two_rows_look_equal(state):
    texts = [tuple(row[1:]) for row in rows(state)[1:]]
    assert len(texts) == len(state.plan_results.plans) == len(set(texts))


def test_every_column_sorts_and_sorts_back(state):
    heads, *planned = rows(state)
    assert [row[0] for row in planned] == [str(k + 1) for k in range(len(planned))]
    for at, head in enumerate(heads[1:], start=1):
        once = plan_changes.sort_solutions(state, head)
        first = [number(row[at]) for row in rows(once)[1:]]
        wanted = sorted((number(row[at]) for row in planned), reverse=COLUMNS[head])
        assert first == wanted
        assert once.plan is state.plan
        twice = plan_changes.sort_solutions(once, head)
        assert [number(row[at]) for row in rows(twice)[1:]] == wanted[::-1]
    assert sorted(map(tuple, rows(plan_changes.sort_solutions(state, heads[-1]))[1:])) == sorted(
        map(tuple, planned)
    )


def test_rows_and_headings_are_labels_of_what_they_do(state):
    html = solutions_html(state, lambda key: f"target{key}")
    for k in range(len(state.plan_results.plans)):
        assert html.count(f'<label for="target{k}" role="row"') == 1
    heads = rows(state)[0]
    for head in heads[1:]:
        assert f'<label for="target{head}" role="columnheader"' in html
    marked = re.findall(r'for="target(\d+)" role="row" class="sg-now"', html)
    assert marked == [str(state.plan_results.index)]


def test_one_plan_alone_is_no_list(state):
    alone = replace(state.plan_results, plans=state.plan_results.plans[:1])
    assert solutions_html(replace(state, plan_results=alone), str) == ""
    assert np.isclose(number("> 50"), 50)
