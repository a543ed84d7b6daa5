"""What is kept with a map goes with it."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

from app.html.map import map_html
from app.render.cell_colors import cell_colors
from app.render.prints import shown_prints
from app.render.weak_cache import cached_with_first
from app.shell.map_parts import map_parts
from app.state.map_view_state import RollChoice
from app.state.plans import plan_changes
from app.state.plans.plan_results import PlanResults
from tests.app.state.states import opened, planned


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
