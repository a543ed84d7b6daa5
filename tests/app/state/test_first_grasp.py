"""The grasp that a page begins with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.state import changes, job_changes
from app.state.first_grasp import most_room, with_first_grasp
from app.state.state import State
from tests.app.state.states import opened, small_map
from tests.conftest import load_small


def test_the_first_grasp_has_the_most_room():
    state = with_first_grasp(replace(opened(), holds_first=True))
    assert state.map
    assert state.cell
    feasible = state.map.feasible
    _, heights, angles = feasible.shape

    def room(roll: int, row: int, column: int) -> int:
        """How many steps along and around alike all lead to feasible cells."""
        steps = 0
        while steps < angles // 2:
            rows = [row - steps, row + steps]
            if min(rows) < 0 or max(rows) >= heights:
                break
            cells = [(i, column) for i in rows] + [(row, (column + k) % angles) for k in (-steps, steps)]
            if not all(feasible[roll, i, j] for i, j in cells):
                break
            steps += 1
        return steps

    cells = [tuple(map(int, at)) for at in np.argwhere(feasible)]
    assert room(*state.cell) == max(room(*at) for at in cells) > 1
    assert state.map.witness(state.cell)
    assert not state.holds_first


def test_it_waits_for_the_exact_map():
    begun = replace(State.of(load_small("bottle_on_table"), "bottle_on_table"), holds_first=True)
    assert with_first_grasp(begun) is begun
    result = small_map("bottle_on_table", begun.task, begun.arm)
    coarse = replace(result, map=replace(result.map, preliminary=True), preliminary=True)
    early = job_changes.preliminary_arrived(begun, coarse)
    assert with_first_grasp(early) is early
    assert with_first_grasp(job_changes.map_arrived(early, 0, result)).pick


def test_a_grasp_that_was_picked_meanwhile_stays():
    picked = changes.choose_cell(replace(opened(), holds_first=True), 3, 4)
    assert picked.pick
    assert with_first_grasp(picked).pick == picked.pick
    assert with_first_grasp(with_first_grasp(picked)) is not picked


def test_where_nothing_is_feasible_no_grasp_is_picked():
    state = opened()
    assert state.result
    assert state.result.map.feasible.any()
    reason = np.minimum(state.result.map.reason, state.result.map.reason.max() - 1)
    nothing = replace(state.result.map, reason=reason)
    assert most_room(nothing) is None
    none = replace(state, result=replace(state.result, map=nothing), holds_first=True)
    assert with_first_grasp(none).pick is None
