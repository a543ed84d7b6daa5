"""What a page may ask for, and what becomes of it."""

from __future__ import annotations

import json
from typing import get_args, get_type_hints
from unittest.mock import Mock

import numpy as np
import pytest

from app.scene3d.ghost import ghost
from app.server.session.tour import tour_acts
from app.shell.commands import LONGEST, Act, decode
from app.state import changes
from app.state.history import DRAG_PAUSE
from app.state.state import State
from app.state.undo import remember, undo
from symgrasp.reason import Reason
from tests.app.state.states import opened, with_plan
from tests.app.surveyed import BASES, surveyed


def done(state: State, **command: object) -> State:
    return decode(json.dumps(command)).applied(state)


def test_a_pick_is_of_the_map_before_it_is_shifted():
    state = changes.turn(opened(), 0.7)
    after = done(state, do="pick", row=2, column=7)
    assert after.base_cell
    assert (after.base_cell.row, after.base_cell.column) == (2, 7)


def test_a_turn_is_that_of_the_slider():
    assert done(opened(), do="turn", delta=0.25).delta == changes.turn(opened(), 0.25).delta


def test_a_drag_is_one_step_and_picks_are_several():
    state, time = opened(), 0.0
    for command in (
        {"do": "turn", "delta": 0.1}, {"do": "turn", "delta": 0.2},
        {"do": "pick", "row": 1, "column": 1}, {"do": "pick", "row": 1, "column": 2},
    ):  # fmt: skip
        deed = decode(json.dumps(command))
        time += 0.01
        state = remember(state, deed.applied(state), deed.origin, time)
    one = undo(state)
    two = undo(one)
    assert one.pick
    assert (one.delta, two.pick, two.delta, undo(two).delta) == (0.2, None, 0.2, 0.0)


def test_pointing_at_a_feasible_cell_shows_its_grasp_and_changes_nothing_else():
    state = opened()
    assert state.result
    m = state.result.map
    row, column = np.argwhere(state.map_view.roll.reason(m) == Reason.FEASIBLE)[0].tolist()
    pointed = done(state, do="hover", row=row, column=column)
    assert pointed.input_values == state.input_values
    shown = ghost(pointed)
    assert shown
    witness = m.witness((state.map_view.roll.roll(m, row, column), row, column))
    assert witness
    arm = state.scene.arm(state.arm)
    assert np.array_equal(shown.values, arm.robot_values(witness.q, witness.opening))
    assert not shown.hits
    assert ghost(done(pointed, do="leave")) is None
    assert ghost(done(pointed, do="pick", row=row, column=column)) is None  # the arm itself is there


def test_pointing_at_a_cell_that_fails_shows_nothing():
    state = opened()
    assert state.result
    fails = state.map_view.roll.reason(state.result.map) != Reason.FEASIBLE
    row, column = np.argwhere(fails)[0].tolist()
    assert ghost(done(state, do="hover", row=row, column=column)) is None


@pytest.mark.parametrize("kind", ["object", "robot"])
def test_a_place_of_a_survey_is_chosen_as_in_the_3d_view(kind):
    state = surveyed(kind)
    after = done(state, do="place", index=0)
    T = after.T_world_object if kind == "object" else after.robot.T_world_base
    assert np.allclose(T[:2, 3], (0.4, 0.2) if kind == "object" else BASES[0][:2])
    assert done(state, do="place", index=2) is state


@pytest.mark.parametrize("deed", ["pick", "hover"])
def test_a_cell_that_the_map_does_not_have_is_ignored(deed):
    state = opened()
    for row, column in ((1000, 0), (0, 1000)):
        assert done(state, do=deed, row=row, column=column) is state


@pytest.mark.parametrize(
    "message",
    [
        "", "[]", "{}", "null", '{"do":"quit"}', '{"do":"turn"}', '{"do":"turn","delta":"1"}',
        '{"do":"turn","delta":1e9}', '{"do":"turn","delta":NaN}', '{"do":"pick","row":-1,"column":0}',
        '{"do":"pick","row":1.5,"column":0}', '{"do":"pick","row":0,"column":0,"more":1}', b"{}",
        '{"do":"leave"' + " " * LONGEST + "}", '{"do":"press"}', '{"do":"press","number":0}',
        '{"do":"slide","step":-1,"delta":0}', '{"do":"move","step":0,"hand":0,"row":0,"column":70000}',
        '{"do":"pick","row":0,"column":0,"roll":2}', '{"do":"place","index":-1}',
    ],
)  # fmt: skip
def test_anything_else_is_an_error(message):
    with pytest.raises(ValueError, match=r"."):
        decode(message)


@pytest.mark.parametrize("press", [True, False])
def test_a_slow_drag_is_one_step_as_long_as_the_pointer_is_down(press):
    state, time = opened(), 0.0
    messages = [{"do": "press", "number": 7}] if press else []
    messages += [{"do": "turn", "delta": 0.1 * k} for k in range(1, 4)]
    for message in messages:
        deed = decode(json.dumps(message))
        time += 5 * DRAG_PAUSE
        state = remember(state, deed.applied(state), deed.origin, time)
    assert undo(state).delta == (0.0 if press else 0.2)


def test_what_follows_a_release_is_another_step():
    state, time = opened(), 0.0
    for message in (
        {"do": "press", "number": 1}, {"do": "turn", "delta": 0.1}, {"do": "release"},
        {"do": "press", "number": 2}, {"do": "turn", "delta": 0.2}, {"do": "turn", "delta": 0.3},
        {"do": "release"},
    ):  # fmt: skip
        deed = decode(json.dumps(message))
        time += 5 * DRAG_PAUSE
        state = remember(state, deed.applied(state), deed.origin, time)
    assert (undo(state).delta, undo(undo(state)).delta) == (0.1, 0.0)
    assert undo(state).press == state.press == 0


def test_all_maps_of_a_sequence_slide_by_a_share_of_their_turns():
    planned = with_plan("pick_pour_place", "sequential")
    half = done(planned, do="slid", share=0.5)
    assert [half.plan_results.turn(k) for k in range(3)] == [
        pytest.approx(planned.plan_results.turn(k) / 2) for k in range(3)
    ]
    assert done(opened(), do="slid", share=0.5).plan_results.slide == opened().plan_results.slide


@pytest.mark.parametrize("share", [-0.1, 1.5, "all", None])
def test_a_share_that_is_none_is_refused(share):
    with pytest.raises(ValueError):
        decode(json.dumps({"do": "slid", "share": share}))


def test_the_page_may_ask_for_every_step_of_the_tour_and_nothing_else():
    with pytest.raises(ValueError):
        decode(json.dumps({"do": "act", "name": "save"}))
    for name in get_args(get_type_hints(Act)["name"]):
        deed = decode(json.dumps({"do": "act", "name": name}))
        assert isinstance(deed, Act)
        assert name in tour_acts(Mock())
    assert len(tour_acts(Mock())) == len(get_args(get_type_hints(Act)["name"]))
