"""What a page is sent of the map, against the map."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.html.map import sample_columns
from app.render.cell_colors import colored_map
from app.render.palette import faded
from app.render.patterns import cell_patterns
from app.render.prints import shown_prints
from app.shell.map_parts import UNKNOWN, map_parts
from app.state import changes, job_changes
from app.state.map_view_state import RollChoice
from app.state.requests import MapResult
from app.state.state import State
from symgrasp.feasibility.color_by import ColorBy, color_map
from symgrasp.feasibility.refined import Refined
from symgrasp.object.manifold import Manifold
from symgrasp.reason import Reason
from tests.app.shown_map import shown
from tests.app.state.states import opened, with_plan
from tests.conftest import load_small


@settings(deadline=None)
@given(steps=st.integers(-720, 720), roll=st.sampled_from(RollChoice), color_by=st.sampled_from(ColorBy))
def test_the_page_shows_the_shifted_map_in_its_colours(steps, roll, color_by):
    state = changes.turn(opened(), np.deg2rad(steps / 4))
    state = replace(state, map_view=replace(state.map_view, roll=roll, color_by=color_by))
    assert state.map
    colored = colored_map(state.map, roll, color_by)
    expected = colored.colors[colored.index[::-1, sample_columns(state.map.manifold)]]
    picture = shown(state).picture()
    assert picture is not None
    assert np.array_equal(picture, expected)


@pytest.mark.parametrize("roll", RollChoice)
def test_what_is_not_proven_to_hold_as_a_whole_is_lighter(roll):
    """Of both rolls, an infeasible cell is proven where both are, a feasible one where the shown one is."""
    plain = opened()
    assert plain.map
    certified = np.random.default_rng(0).random(plain.map.reason.shape) < 0.5
    known = replace(plain.map, certified=certified)
    state = job_changes.map_arrived(plain, 0, MapResult(plain.request, known, ()))
    before, after = (
        shown(replace(s, map_view=replace(s.map_view, roll=roll))).picture() for s in (plain, state)
    )
    assert before is not None and after is not None
    if roll is RollChoice.EITHER:
        one = np.take_along_axis(certified, roll.rolls(known)[None], axis=0)[0]
        proven = np.where(known.feasible.any(axis=0), one, certified.all(axis=0))
    else:
        proven = certified[list(RollChoice).index(roll) - 1]
    proven = proven[::-1, sample_columns(known.manifold)]
    assert (after[proven] == before[proven]).all()
    assert (after[~proven].astype(int).sum(axis=-1) > before[~proven].astype(int).sum(axis=-1)).all()
    message = map_parts(state)["cells"]
    head = json.loads(message[4 : 4 + int.from_bytes(message[:4], "little")])
    half = len(head["colors"]) // 2
    assert head["patterns"] == 2 * cell_patterns(ColorBy.REASON)
    assert len(head["patterns"]) == 2 * half
    assert state.map_view.color_by is ColorBy.REASON
    look = map_parts(state)["look"]
    assert "lighter: not proven as a whole" in look[4:].decode()


@pytest.mark.parametrize("roll", RollChoice)
@pytest.mark.parametrize("color_by", [ColorBy.REASON, ColorBy.FEASIBLE])
def test_split_cells_are_drawn_part_by_part(roll, color_by):
    """Where either roll is shown, a part is feasible where one is, and proven infeasible where both are."""
    plain = opened()
    assert plain.map
    rng, grid = np.random.default_rng(0), plain.map.manifold
    fine = Manifold(grid.profile, 3 * grid.heights, 2 * grid.angles)
    shape = (2, fine.heights, fine.angles)
    reason = rng.choice([Reason.JOINT_LIMITS, Reason.FEASIBLE], shape).astype(np.uint8)
    known = replace(
        plain.map,
        certified=rng.random(plain.map.reason.shape) < 0.5,
        refined=Refined(fine, reason, rng.random(shape) < 0.7),
    )
    state = changes.turn(job_changes.map_arrived(plain, 0, MapResult(plain.request, known, ())), 0.3)
    state = replace(state, map_view=replace(state.map_view, roll=roll, color_by=color_by))
    assert state.map
    parts = state.map.refined
    assert parts
    rows = [0, 1] if roll is RollChoice.EITHER else [list(RollChoice).index(roll) - 1]
    feasible, proven = parts.feasible[rows], parts.certified[rows]
    some_hold, none_do = np.logical_or.reduce(feasible & proven), np.logical_and.reduce(~feasible & proven)
    picture = shown(state).picture()
    assert picture is not None
    columns = sample_columns(parts.manifold)
    assert picture.shape[:2] == (parts.manifold.heights, len(columns)) != state.map.reason[0].shape
    # The proven colours of what is feasible are those of nothing else.
    colored = color_map(color_by, np.array([[Reason.FEASIBLE]]), np.zeros((1, 1)), np.ones((1, 1), bool))
    holds = (picture == colored.colors[colored.index[0, 0]]).all(axis=-1)
    assert not holds[none_do[::-1, columns]].any()
    if roll is not RollChoice.EITHER:
        assert np.array_equal(holds, some_hold[::-1, columns])
    assert holds[some_hold[::-1, columns]].any()
    assert "drawn are the parts" in map_parts(state)["look"].decode(errors="ignore")
    clearance = replace(state, map_view=replace(state.map_view, color_by=ColorBy.CLEARANCE))
    assert "drawn are the parts" not in map_parts(clearance)["look"].decode(errors="ignore")
    whole = shown(clearance).picture()
    assert whole is not None and len(whole) == state.map.manifold.heights


def test_a_turn_changes_nothing_but_the_look():
    before, after = map_parts(opened()), map_parts(changes.turn(opened(), 0.3))
    assert [kind for kind in before if before[kind] != after[kind]] == ["look"]


def test_every_cell_has_its_reason_roll_and_clearance():
    state = opened()
    m, roll = state.map, state.map_view.roll
    assert m
    message = map_parts(state)["cells"]
    data = message[4 + int.from_bytes(message[:4], "little") :]
    size = m.reason[0].size
    clearance = np.frombuffer(data[: 2 * size], "<u2").reshape(m.reason[0].shape)
    reason, rolls = (
        np.frombuffer(data[k * size : (k + 1) * size], np.uint8).reshape(clearance.shape) for k in (3, 4)
    )
    assert np.array_equal(reason, roll.reason(m))
    assert np.array_equal(np.take_along_axis(m.reason, rolls[None].astype(int), 0)[0], reason)
    feasible = reason == Reason.FEASIBLE
    assert feasible.any()
    assert np.abs(clearance[feasible] - 1e4 * roll.of(m, m.clearance)[feasible]).max() <= 0.5
    assert (clearance[~feasible] == UNKNOWN).all()


def test_a_map_of_an_earlier_pose_is_faded_and_said_to_be_one():
    state = changes.moved(opened(), x=0.5)
    page = shown(state)
    assert "of an earlier pose" in page.title
    fresh = shown(opened()).picture()
    assert fresh is not None
    stale = page.picture()
    assert stale is not None
    assert np.array_equal(stale, faded(fresh))


def test_there_is_no_picture_before_the_first_map():
    page = shown(State.of(load_small("bottle_on_table"), ""))
    assert page.picture() is None
    assert page.look["busy"]
    assert page.legend == []


def test_the_picked_cell_is_that_of_the_map_before_it_is_shifted():
    state = changes.turn(changes.choose_surface_cell(opened(), 3, 5), 1.0)
    look = shown(state).look
    assert state.base_cell
    assert look["picked"] == [state.base_cell.row, state.base_cell.column]
    assert state.pick
    assert look["marks"] == [[state.pick.h, pytest.approx(state.pick.theta), ""]]


def test_the_hands_of_a_plan_are_named():
    page = shown(with_plan("log_two_robots", "bimanual"))
    assert page.has_prints
    assert page.legend[-2:] == ["hand of left", "hand of right"]


@pytest.mark.parametrize("roll", RollChoice)
def test_the_legend_counts_every_place_once(roll):
    state = opened()
    look = shown(replace(state, map_view=replace(state.map_view, roll=roll))).look
    assert state.map
    reason = roll.reason(state.map)
    assert sum(cells for _, _, cells in look["legend"]) == reason.size
    assert look["legend"][0][1] == "feasible"
    assert len(look["legend"]) == len(np.unique(reason))
    assert look["counted"].startswith(f"{reason.size} places on the object, each with ")


def test_the_legend_of_values_is_a_scale_in_their_unit():
    state = opened()
    look = shown(replace(state, map_view=replace(state.map_view, color_by=ColorBy.CLEARANCE))).look
    label, high, _ = look["scale"]
    assert label == "clearance (mm)"
    assert state.map
    assert high >= 1e3 * np.nanmax(state.map.clearance)
    assert "scale" not in shown(state).look


@pytest.mark.parametrize("color_by", ColorBy)
def test_turning_the_object_leaves_the_legend(color_by):
    state = opened()
    state = replace(state, map_view=replace(state.map_view, color_by=color_by))
    assert shown(changes.turn(state, 0.7)).look["legend"] == shown(state).look["legend"]


def test_both_hands_are_in_the_legend_where_their_prints_overlap(monkeypatch):
    state = with_plan("log_two_robots", "bimanual")
    left, _ = shown_prints(state)
    monkeypatch.setattr("app.shell.map_parts.shown_prints", lambda _: [left, np.roll(left, 1, axis=1)])
    assert shown(state).legend[-1] == "both hands"
