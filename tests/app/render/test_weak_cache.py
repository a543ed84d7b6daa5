"""What is kept with a map goes with it."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np

from app.html.map import map_html
from app.html.stack import shared_columns, stack_html
from app.render.cell_colors import cell_colors
from app.render.prints import shown_prints
from app.render.weak_cache import cached_with_first
from app.shell.map_parts import map_parts
from app.state import plan_changes
from app.state.map_view_state import RollChoice
from app.state.plan_results import PlanResults
from app.state.state import State
from symgrasp.object.manifold import ROLLS
from tests.app.state.test_state import opened, planned


class Kept:
    """May go."""


def test_a_result_is_made_once_and_goes_with_what_it_was_made_from():
    made: list[str] = []

    @cached_with_first
    def make(_: Kept, name: str) -> Kept:
        made.append(name)
        return Kept()

    one, other = Kept(), Kept()
    first = make(one, "a")
    assert make(one, "a") is first
    assert make(one, "b") is not first
    assert make(other, "a") is not first
    assert made == ["a", "b", "a"]
    result = weakref.ref(first)
    del one, first
    gc.collect()
    assert result() is None
    make(other, "a")
    assert made == ["a", "b", "a"]


def results_of_its_own() -> PlanResults:
    """A plan whose maps nobody else has."""
    plan_results = planned("pick_pour_place", "sequential")
    maps = {key: replace(result, map=replace(result.map)) for key, result in plan_results.maps.items()}
    return replace(plan_results, maps=maps)


def drawn() -> list[weakref.ref[object]]:
    """Draw a plan in every way; return what was drawn."""
    state = opened("pick_pour_place")
    state = replace(state, scene=replace(state.scene))
    state = plan_changes.show_results(state, results_of_its_own())
    state = replace(state, map_view=replace(state.map_view, handprint=True))
    assert state.map
    for slide in (0.5, 1.0):
        stack_html(replace(state, plan_results=replace(state.plan_results, slide=slide)))
    map_html(state.map, RollChoice.EITHER)
    map_parts(state)
    cell_colors(state, state.map)
    assert len(shown_prints(state)) == 1
    maps = [result.map for result in state.plan_results.maps.values()]
    return [weakref.ref(kept) for kept in (state.scene, state.map, *maps)]


def test_no_picture_keeps_the_maps_and_the_scene_of_a_closed_page():
    drawn_from = drawn()
    gc.collect()
    assert [reference() for reference in drawn_from] == [None] * 5


def test_cells_that_serve_all_tasks_are_those_of_the_turned_maps():
    state: State = opened("pick_pour_place")
    m = state.result.map if state.result else None
    assert m
    turns = (0.3, -1.7)
    for roll in range(len(ROLLS)):
        both = [shared_columns((m,), (turn,), roll) for turn in turns]
        for turn, columns in zip(turns, both, strict=True):
            turned = m.shift(turn)
            assert np.array_equal(columns, shared_columns((turned,), (0.0,), roll))
        assert np.array_equal(shared_columns((m, m), turns, roll), both[0] & both[1])
