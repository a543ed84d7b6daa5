"""The stack of maps below the main one: what is sent of it, and what drags of its maps do."""

# Plans and maps are there where these tests look.
# pyright: reportOptionalMemberAccess=false

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from app.html.map import sample_columns
from app.render.cell_colors import colored_map
from app.render.drawn_poses import drawn_joint_values
from app.render.palette import OVERLAP
from app.render.prints import task_prints
from app.shell.commands import decode
from app.shell.layers import layers_of
from app.shell.map_parts import map_parts
from app.state.map_view_state import RollChoice
from app.state.plans.plan_changes import hand_cells
from app.state.state import State
from app.state.undo import remember, undo
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS
from tests.app.shown_map import shown
from tests.app.state.states import opened, with_plan

ONE_ROLL = (RollChoice.ZERO, RollChoice.HALF_TURN)


def done(state: State, **command: object) -> State:
    return decode(json.dumps(command)).applied(state)


def expected(m: FeasibilityMap, roll: RollChoice, turn: float) -> np.ndarray:
    colored, shifted = colored_map(m, roll), m.shift(turn).manifold
    whole = round(turn / m.manifold.dtheta)
    return colored.colors[np.roll(colored.index, -whole, axis=1)[::-1, sample_columns(shifted)]]


def test_each_task_of_a_sequence_has_its_map_shifted_by_its_turn():
    state = with_plan("pick_pour_place", "sequential")
    state = done(state, do="slide", step=1, delta=0.7)
    page, plan = shown(state), state.plan.plan
    assert [layer["title"] for layer in page.look["layers"]] == ["1 · pick", "2 · pour", "3 · place"]
    turns = [plan.tasks[0].delta, 0.7, plan.tasks[2].delta]
    for k, (task, turn) in enumerate(zip(plan.tasks, turns, strict=True)):
        m = state.plan_results.maps[task.name, "panda"].map
        roll = ONE_ROLL[ROLLS.index(task.holds[0].grasp.roll)]
        assert np.array_equal(page.layer(k), expected(m, roll, turn))
    assert [layer["planned"] for layer in page.look["layers"]] == [None, plan.tasks[1].delta, None]


def test_sliding_a_map_turns_the_object_of_its_task_and_is_one_step():
    before = state = with_plan("pick_pour_place", "sequential")
    for k in range(5):
        deed = decode(json.dumps({"do": "slide", "step": 2, "delta": 0.1 * k}))
        state = remember(state, deed.applied(state), deed.origin, 0.1 * k)
    assert (state.task, state.delta) == ("place", 0.4)
    assert state.pick == before.pick
    assert undo(state).delta == before.delta
    assert not undo(state).plan_results.turns


def test_a_slide_changes_the_look_alone():
    state = with_plan("pick_pour_place", "sequential")
    before = map_parts(done(state, do="slide", step=0, delta=0.2))
    after = map_parts(done(state, do="slide", step=0, delta=0.3))
    assert [kind for kind in after if before[kind] != after[kind]] == ["look"]


def test_what_was_moved_goes_back_to_the_plan():
    state = with_plan("pick_pour_place", "sequential")
    moved = done(state, do="slide", step=0, delta=1.0)
    assert shown(moved).look["moved"]
    back = done(moved, do="planned")
    assert not shown(back).look["moved"]
    assert [layer.turn for layer in layers_of(back)] == [task.delta for task in state.plan.plan.tasks]


def brute_gap(state: State, first: np.ndarray, second: np.ndarray) -> float:
    """How far (m) two prints are apart, cell by cell: whole cells between them, along or around."""
    grid = state.scene.manifold
    gaps = []
    for (i, j), (k, n) in product(np.argwhere(first), np.argwhere(second)):
        around = min((j - n) % grid.angles, (n - j) % grid.angles)
        along = max(abs(i - k) - 1, 0) * grid.dh
        gaps.append(max(along, max(around - 1, 0) * grid.dtheta * grid.profile.r_max))
    return min(gaps)


def test_moving_a_hand_moves_its_print_alone_and_the_gap_is_that_of_the_cells():
    state = with_plan("log_two_robots", "bimanual")
    cells = hand_cells(state, 0)
    row, column = cells[0].row - 3, (cells[0].column + 5) % state.scene.manifold.angles
    moved = done(state, do="move", step=0, hand=0, row=row, column=column)
    (left, right), (old_left, old_right) = task_prints(moved, 0), task_prints(state, 0)
    assert np.array_equal(right, old_right)
    assert not np.array_equal(left, old_left)
    assert hand_cells(moved, 0) == (cells[0]._replace(row=row, column=column), cells[1])
    page = shown(moved)
    assert page.look["apart"] == f"gap {1e3 * brute_gap(moved, left, right):.0f} mm"
    over = page.layer_prints(1)
    assert np.array_equal(over > 0, left | right)
    assert page.look["layers"][0]["marks"] == page.look["layers"][1]["marks"]


def test_a_hand_moved_onto_the_other_shares_cells_with_it():
    state = with_plan("log_two_robots", "bimanual")
    _, other = hand_cells(state, 0)
    moved = done(state, do="move", step=0, hand=0, row=other.row, column=other.column)
    left, right = task_prints(moved, 0)
    shared = int((left & right).sum())
    assert shared
    assert shown(moved).look["apart"] == f"prints share {shared} cells"
    assert np.array_equal(shown(moved).layer_prints(0) == OVERLAP, left & right)


def test_the_arm_takes_a_grasp_where_its_hand_is_moved_to_or_goes_home():
    state = with_plan("log_two_robots", "bimanual")
    task, grid = state.plan.plan.tasks[0], state.scene.manifold
    cell = hand_cells(state, 0)[0]
    m = state.plan_results.maps[task.name, "left"].map.shift(task.delta)
    for feasible in (True, False):
        rows, columns = np.nonzero(m.feasible[cell.roll] == feasible)
        at = int(rows[0]), int(columns[0])
        to = grid.cell(float(m.manifold.h[at[0]]), float(m.manifold.theta[at[1]]))
        moved = done(state, do="move", step=0, hand=0, row=to[0], column=to[1])
        arm = state.scene.arm("left")
        witness = m.witness((cell.roll, *at))
        q = arm.robot_values(witness.q, witness.opening) if witness else arm.robot.home
        assert bool(witness) is feasible
        assert np.array_equal(drawn_joint_values(moved)[arm.robot.name], q)


def test_both_rolls_side_by_side_turn_with_the_object_and_are_picked_from():
    state = opened()
    assert not layers_of(state)
    state = replace(state, map_view=replace(state.map_view, rolls_apart=True))
    turned = done(state, do="turn", delta=0.5)
    for k, roll in enumerate(ONE_ROLL):
        assert np.array_equal(shown(turned).layer(k), expected(state.result.map, roll, 0.5))
        picked = done(turned, do="pick", row=2, column=7, roll=k)
        assert picked.base_cell == (k, 2, 7)


@pytest.mark.parametrize(
    "command",
    [
        {"do": "slide", "step": 9, "delta": 1.0},
        {"do": "move", "step": 0, "hand": 0, "row": 0, "column": 0},
    ],
)
def test_maps_that_are_not_there_are_ignored(command):
    state = with_plan("pick_pour_place", "sequential")
    assert done(state, **command) is state


@pytest.mark.parametrize(
    "change",
    [{"step": 5}, {"hand": 2}, {"row": 1000}, {"column": 1000}],
    ids=lambda change: next(iter(change)),
)
def test_hands_and_cells_that_are_not_there_are_ignored(change):
    state = with_plan("log_two_robots", "bimanual")
    assert done(state, **({"do": "move", "step": 0, "hand": 0, "row": 1, "column": 1} | change)) is state
