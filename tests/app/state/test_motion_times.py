"""Playing the motion of a plan: where everything is drawn, which task is shown, and how time passes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from app.compute.plan_service import plan_result
from app.html.motion import motion_html
from app.render.drawn_poses import drawn_joint_values, drawn_object_pose
from app.scene3d.tool_path import tool_lines
from app.state import changes
from app.state.plans import plan_changes
from app.state.plans.plan_results import SECONDS_PER_TASK, PlanResults
from app.state.requests import MapRequest, MapResult
from app.state.state import State
from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import ROLLS
from tests.motion.recorded import recorded_motion, recorded_plan


@cache
def opened() -> State:
    plan, scene = recorded_plan(), recorded_motion().scene
    requests = [MapRequest(scene, "panda", task.name) for task in plan.tasks]
    maps = {(r.task, r.arm): MapResult(r, create_map(scene, task=r.task, arm=r.arm)) for r in requests}
    results = PlanResults().found("sequential", (plan_result(plan, scene),), maps, more=False)
    return plan_changes.show_results(State.of(scene, scene.name), results)


def test_what_is_drawn_is_the_motion():
    motion = recorded_motion()
    for t in np.linspace(0, motion.duration, 25):
        state = plan_changes.show_position(opened(), float(t))
        there = motion.at(float(t))
        np.testing.assert_array_equal(drawn_joint_values(state)["panda"], there.values["panda"])
        np.testing.assert_array_equal(drawn_object_pose(state), there.T_world_object)


def test_the_task_is_the_one_that_the_object_is_nearest_to():
    motion = recorded_motion()
    carries = [k for k, segment in enumerate(motion.segments) if segment.kind == "carry"]
    middles = [0.5 * (motion.starts[k] + motion.starts[k + 1]) for k in carries]
    for t in np.linspace(0, motion.duration, 60):
        state = plan_changes.show_position(opened(), float(t))
        task = ["pick", "pour", "place"][sum(bool(m <= t) for m in middles)]
        assert state.shown_task
        assert (state.task, state.shown_task.name) == (task, task)
        assert state.pick is not None  # its cell is marked on the map
        grasp = state.shown_task.holds[0].grasp
        assert state.pick.roll is not None
        assert (state.pick.h, ROLLS[state.pick.roll]) == (grasp.h, grasp.roll)
        assert np.cos(state.pick.theta - grasp.theta) == pytest.approx(1.0)
    for step, carry in ((1, carries[0]), (2, carries[1])):
        state = plan_changes.show_step(opened(), step)
        assert state.plan_results.position == pytest.approx(motion.starts[carry + 1])
        assert state.step == step
        assert state.shown_task
        goal = state.shown_task.object_pose_turned.array()
        np.testing.assert_allclose(drawn_object_pose(state), goal, atol=1e-6)


@pytest.mark.parametrize("speed", [0.25, 1.0, 4.0])
def test_time_passes_at_the_chosen_speed_to_the_end(speed):
    state = plan_changes.play_arms(plan_changes.choose_speed(opened(), speed))
    assert state.plan_results.position == 0
    passed = 0
    while state.plan_results.playing:
        state = plan_changes.played(state, 0.2)
        passed += 1
        if state.plan_results.playing:
            assert state.plan_results.position == pytest.approx(0.2 * speed * passed)
    assert state.plan_results.position == recorded_motion().duration
    assert passed == np.ceil(recorded_motion().duration / (0.2 * speed))


def without_motion() -> State:
    bare = recorded_plan().model_copy(update={"motion": None})
    return plan_changes.motion_found(opened(), 0, bare)


def test_a_motion_that_is_found_takes_the_place_of_the_plan_without():
    without = without_motion()
    assert without.plan_results.end == 2
    played = plan_changes.played(plan_changes.play_arms(without), 0.5)
    assert played.plan_results.position == pytest.approx(0.5 / SECONDS_PER_TASK)
    again = plan_changes.motion_found(played, 0, recorded_plan(), ("the carry meets <crate>",))
    assert (again.plan_results.position, again.plan_results.playing) == (0.0, "")
    assert again.plan_results.end == recorded_motion().duration
    assert len(again.plan_results.plans) == 1
    assert "the carry meets &lt;crate&gt;" in motion_html(again)
    assert plan_changes.motion_found(again, 7, recorded_plan()) is again


def test_words_tell_the_segment_and_whether_there_is_a_motion():
    motion = recorded_motion()
    state = plan_changes.show_position(opened(), 0.5 * (motion.starts[4] + motion.starts[5]))
    text = motion_html(state)
    assert "carry, pick → pour, panda" in text
    assert f"part 5 of 9, {1e3 * motion.segments[4].clearance:.1f} mm clear" in text
    assert "not planned" in motion_html(without_motion())
    assert "carry" not in motion_html(changes.turn(state, 0.3))


def test_lines_follow_the_tool():
    motion = recorded_motion()
    arm = motion.scene.arm()
    points, colors = tool_lines(motion)
    assert points.shape == colors.shape
    moving = [segment for segment in motion.segments if segment.kind not in ("open", "close")]
    ends = [arm.world_tool_pose(segment.joints["panda"][k])[:3, 3] for segment in moving for k in (0, -1)]
    for end in ends:
        assert np.linalg.norm(points.reshape(-1, 3) - end, axis=1).min() < 1e-9
    assert len(np.unique(colors[:, 0], axis=0)) > 3  # segments differ in clearance
