"""Plans in the state of a page: how they are shown, and what drops them."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import numpy as np
import pytest

from app.panels.keyboard import next_arm
from app.render.drawn_poses import drawn_joint_values
from app.state import changes, job_changes
from app.state.plans import plan_changes
from symgrasp.errors import SymgraspError
from symgrasp.object.manifold import ROLLS
from tests.app.state.states import opened, with_plan


def test_a_new_object_drops_the_plan():
    state = with_plan("log_two_robots", "bimanual")
    changed = changes.choose_object(state, state.scene, None)
    assert (changed.plan, changed.step, changed.shown_task) == (None, None, None)


def test_a_plan_is_shown_task_by_task_with_one_grasp():
    state = with_plan("pick_pour_place", "sequential")
    plan = state.plan.plan
    grasps = set()
    for k, task in enumerate(plan.tasks):
        shown = plan_changes.show_step(state, k)
        assert (shown.task, shown.delta) == (task.name, task.delta)
        assert np.allclose(shown.T_world_object, task.object_pose_turned.array())
        assert shown.is_current
        assert shown.map.feasible[shown.cell]
        assert ROLLS[shown.cell.roll] == task.holds[0].grasp.roll
        grasps.add((shown.pick.h, shown.pick.theta))
        joints = task.holds[0].joints
        names = state.scene.robots["panda"].model.joint_names
        values = drawn_joint_values(shown)["panda"]
        assert {n: values[names.index(n)] for n in joints} == joints
    assert len(grasps) == 1


def test_both_arms_hold_in_a_bimanual_plan_and_either_map_can_be_seen():
    state = with_plan("log_two_robots", "bimanual")
    values = drawn_joint_values(state)
    for name, robot in state.scene.robots.items():
        assert not np.allclose(values[name], robot.home)
    other = changes.choose_arm(state, "right")
    assert other.shown_task is state.shown_task
    assert other.arm == "right"
    assert other.map.feasible[other.cell]
    prints = [state.plan.prints[0][arm] for arm in ("left", "right")]
    assert all(p.any() for p in prints)
    assert not (prints[0] & prints[1]).any()


def test_only_an_arm_of_the_task_can_be_chosen():
    state = opened("handover_between_robots")
    assert (state.task, state.arm) == ("pick", "left")
    assert next_arm(state).arm == "left"
    with pytest.raises(SymgraspError, match=r"page: arm.*'right'.*one of 'left'"):
        changes.choose_arm(state, "right")
    both = changes.choose_arm(changes.choose_task(state, "hand over"), "right")
    assert both.arm == "right"
    assert next_arm(both).arm == "left"


def test_moving_an_object_drops_the_plan_and_the_planning():
    state = with_plan("bottle_on_table", "sequential")
    assert changes.moved(state, x=0.5).plan is None
    assert changes.moved(job_changes.started(state, 2, "Planning"), x=0.5).busy is None
    assert changes.turn(state, 0.5).plan is not None
    assert changes.turn(state, 0.5).step is None


def test_which_planner_has_something_to_do():
    assert opened().can_plan("sequential")
    assert not opened().can_plan("bimanual")
    assert not opened("log_two_robots").can_plan("sequential")
    assert opened("log_two_robots").can_plan("bimanual")
