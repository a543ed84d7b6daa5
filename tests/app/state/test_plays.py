"""Playing plans task after task, with no page."""

# A plan or a climb may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from app.render.drawn_poses import drawn_joint_values, drawn_object_pose
from app.render.playback import plan_joint_values
from app.state import changes
from app.state.plans import plan_changes
from tests.app.state.states import with_plan

DATA = Path(__file__).parents[2] / "data"


@pytest.mark.parametrize("position", [0.0, 0.4, 0.6, 1.3, 2.0])
def test_without_a_motion_the_play_shows_one_task_after_the_other(position):
    """Nothing is shown between two tasks: nobody knows whether the arms can be there."""
    state = plan_changes.show_position(with_plan("pick_pour_place", "sequential"), position)
    step = min(int(position + 0.5), 2)
    assert (state.step, state.task) == (step, ["pick", "pour", "place"][step])
    task = state.shown_task
    expected = plan_joint_values(state.scene, task)["panda"]
    assert np.array_equal(drawn_joint_values(state)["panda"], expected)
    assert np.allclose(drawn_object_pose(state), task.object_pose_turned.array())


def test_the_play_passes_the_tasks_in_order_and_stops_at_the_end():
    state = plan_changes.play_arms(with_plan("pick_pour_place", "sequential"))
    seen, positions = [], []
    while state.plan_results.playing:
        state = plan_changes.played(state, 0.1)
        seen.append(state.task)
        positions.append(state.plan_results.position)
    assert list(dict.fromkeys(seen)) == ["pick", "pour", "place"]
    assert np.all(np.diff(positions) > 0)
    assert positions[-1] == 2
    assert np.allclose(drawn_object_pose(state), state.T_world_object)
    again = plan_changes.play_arms(state)
    assert (again.plan_results.playing, again.plan_results.position, again.step) == ("arms", 0.0, 0)
    assert not plan_changes.play_arms(again).plan_results.playing


def test_whoever_moves_on_stops_the_play():
    playing = plan_changes.played(plan_changes.play_arms(with_plan("pick_pour_place", "sequential")), 0.3)
    for move_on in (
        lambda s: changes.turn(s, 0.1),
        lambda s: changes.choose(s, 0.1, 0.0),
        lambda s: changes.choose_task(s, "place"),
    ):
        state = move_on(playing)
        assert state.step is None
        stopped = plan_changes.played(state, 0.1)
        assert not stopped.plan_results.playing
        assert (stopped.task, stopped.delta, stopped.pick) == (state.task, state.delta, state.pick)


def test_a_plan_of_one_task_has_nothing_to_play():
    state = with_plan("bottle_on_table", "sequential")
    assert plan_changes.play_arms(state).plan_results.playing == ""
    assert plan_changes.show_position(state, math.nan).step == 0
