"""Motions of shipped scenes exist, are free in PyBullet, and do what the plans say."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest

from symgrasp.errors import Cancelled, NoPlanError, SceneError
from symgrasp.ik import redundancy_of, solver_for
from symgrasp.motion.bodies.motion_scene import RESTING
from symgrasp.motion.choosing import Failure, best_motion, failures_in_words
from symgrasp.motion.drafting.ways import Grip, retreating
from symgrasp.motion.paths.lines import configurations
from symgrasp.motion.planning import MotionPlanner, plan_motion
from symgrasp.motion.segments import Motion
from symgrasp.motion.times.timing import timed
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import (
    handover_plans,
    plan_bimanual,
    plan_handover,
    plan_sequential,
    sequential_plans,
)
from symgrasp.poses import inverse, pose_error
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import load_small
from tests.motion.dense import collisions_of

STEP = 5e-3
"""Distance (m) that nothing moves further between two states of a motion that PyBullet looks at here."""


def check(plan: Plan, motion: Motion) -> None:
    scene = motion.scene
    with open_world(scene) as world:
        looked, found = collisions_of(world, motion, STEP)
    assert looked > 100
    assert not found, found[:3]
    at = {name: arm.robot.home[arm.indices] for name, arm in scene.arms.items()}
    for k, segment in enumerate(motion.segments):
        for name, path in segment.joints.items():
            arm = scene.arms[name]
            np.testing.assert_array_equal(path[0], at[name])
            assert ((path >= arm.lower) & (path <= arm.upper)).all()
            at[name] = path[-1]
        lowered = k + 1 < len(motion.segments) and motion.segments[k + 1].kind == "lower"
        if segment.kind in ("carry", "lower") and not lowered:
            count = len(next(iter(segment.joints.values())))
            end = motion.state(k, count - 1, 1.0).T_world_object
            goals = [t.object_pose_turned.array() for t in plan.tasks if t.name == segment.task_to]
            assert min(max(pose_error(end, goal)) for goal in goals) < 1e-5
    for task in plan.tasks:
        for hold in task.holds:
            q = np.array(list(hold.joints.values()))
            rows = np.concatenate([s.joints[hold.arm] for s in motion.segments if hold.arm in s.joints])
            assert (rows == q).all(axis=1).any()


def kinds(motion: Motion) -> list[str]:
    return [kind for kind, _ in groupby(segment.kind for segment in motion.segments)]


def test_a_retreat_ends_where_all_that_may_touch_the_object_is_clear_of_it():
    """The safety box around each hand of TIAGo reaches further than its fingers."""
    scene = Scene.load("tiago_dual_tray")
    arm, profile = scene.arm("left"), scene.profile
    radius = float(profile.radius(0.1))
    tool = arm.hand.tool_pose(np.eye(4), 0.1, 0.0, 0, radius)
    solver = solver_for(arm, 1)
    grip = Grip(arm, solver, solver, tool, arm.hand.opening(radius), 2 * radius)
    end = retreating(grip, np.eye(4), 0.0, profile)[-1]
    model = arm.robot.model
    links = model.forward(arm.robot_values(arm.home, grip.open))
    T_tool_base = inverse(links[model.link_index(arm.tool)])
    outwards = end[:2, 3] / np.linalg.norm(end[:2, 3])
    for link in arm.hand.touch_links:
        pose = end @ T_tool_base @ links[model.link_index(link)]
        for points in model.hulls(link):
            placed = points @ pose[:3, :3].T + pose[:3, 3]
            assert (placed[:, :2] @ outwards).min() > profile.points[:, 1].max(), link


def test_pick_pour_place():
    scene = load_small("pick_pour_place", 12, 24, 8)
    plan, motion = plan_motion(scene, plan_sequential(scene))
    before, after = ["open", "reach", "approach", "close"], ["open", "retreat", "home"]
    assert kinds(motion) == [*before, "lift", "carry", "lower", *after]
    carries = [(s.task_from, s.task_to) for s in motion.segments if s.kind == "carry"]
    assert carries == [("pick", "pour"), ("pour", "place")]
    check(plan, motion)


def test_two_arms_lift_a_log():
    scene = load_small("log_two_robots", 20, 24, 6)
    plan, motion = plan_motion(scene, plan_bimanual(scene))
    assert kinds(motion)[-1] == "lift"
    last = motion.segments[-1]
    assert last.held_by == ("left", "right")
    check(plan, motion)
    # Both hands stay where they are on the log: what one does with it, the other one does too.
    before = motion.state(len(motion.segments) - 1, 0, 0.0).values
    end = motion.state(len(motion.segments) - 1, len(last.joints["left"]) - 1, 1.0).values
    moved = []
    for name in last.held_by:
        arm = scene.arms[name]
        tools = [arm.world_tool_pose(values[arm.robot.name][arm.indices]) for values in (before, end)]
        moved.append(tools[1] @ np.linalg.inv(tools[0]))
    np.testing.assert_allclose(moved[0], moved[1], atol=1e-5)
    assert moved[0][2, 3] > 0.05


def test_handover():
    scene = load_small("handover_between_robots", 12, 24, 8)
    plan, motion = plan_motion(scene, plan_handover(scene))
    held = [s.held_by for s in motion.segments]
    assert ("left",) in held
    assert held.index(("right",)) > held.index(("left",))
    # The second arm comes and closes its hand while the first one holds the object still, and only then
    # that one opens its own.
    kinds_of = [(s.kind, s.arms, s.held_by) for s in motion.segments]
    taken = kinds_of.index(("close", ("right",), ("left",)))
    assert [kind for kind, arms, by in kinds_of[:taken] if arms == ("right",) and by == ("left",)][-2:] == [
        "reach",
        "approach",
    ]
    assert kinds_of[taken + 1] == ("open", ("left",), ("right",))
    check(plan, motion)


def test_arms_that_share_a_torso_hand_over():
    """Whoever holds the object is not moved by the torso of the other arm, and plans keep their margins."""
    scene = load_small("pr2_handover", 12, 24, 8)
    plan, _ = best_motion(scene, handover_plans(scene))
    report = verify(plan)
    assert report, report.failures
    assert plan.motion
    holders = {segment.held_by for segment in plan.motion.segments if segment.held_by}
    assert holders == {("left",), ("right",)}


def carried(tilt_deg: float, **more) -> Scene:
    content = load_small("pick_pour_place", 12, 24, 8).content
    tasks = [task for task in content["tasks"] if task["name"] != "pour"]
    return Scene.from_content({**content, "tasks": tasks, "carry": {"tilt_deg": tilt_deg, **more}})


def test_a_full_glass_is_kept_upright():
    scene = carried(10.0)
    plan, motion = plan_motion(scene, plan_sequential(scene))
    (k,) = (k for k, segment in enumerate(motion.segments) if segment.kind == "carry")
    count = len(next(iter(motion.segments[k].joints.values())))
    rows = np.linspace(0, count - 1, 400)
    z = np.array([motion.state(k, row, row / (count - 1)).T_world_object[2, 2] for row in rows])
    assert np.rad2deg(np.arccos(z.clip(-1, 1))).max() <= 10.0
    check(plan, motion)
    # Nor is it tilted further where the corners are rounded.
    rounded = timed(motion)
    moments = np.linspace(rounded.starts[k], rounded.starts[k + 1], 1000)
    z = np.array([rounded.at(t).T_world_object[2, 2] for t in moments])
    assert 5.0 < np.rad2deg(np.arccos(z.clip(-1, 1))).max() <= 10.0


def test_what_the_object_rests_on_is_no_clearance():
    """In the lift and the lower it may touch the table, and nothing else counts as if it did."""
    scene = load_small("pick_pour_place", 12, 24, 8)
    _, motion = plan_motion(scene, plan_sequential(scene))
    (lift,) = (segment for segment in motion.segments if segment.kind == "lift")
    assert lift.room < RESTING
    carries = [segment for segment in motion.segments if segment.kind in ("lift", "carry", "lower")]
    assert min(segment.clearance for segment in carries) > RESTING


def test_a_limit_of_the_tilt_that_a_task_exceeds_is_refused():
    scene = load_small("pick_pour_place", 12, 24, 8)
    scene = Scene.from_content({**scene.content, "carry": {"tilt_deg": 15}})
    with pytest.raises(SceneError, match=r"carry: tilt_deg.*task pour"):
        plan_motion(scene, plan_sequential(scene))


def test_a_limit_between_tasks_that_do_not_follow_each_other_is_refused():
    with pytest.raises(SceneError, match="carry"):
        carried(15.0, tasks=["place", "pick"])


def test_the_same_seed_gives_the_same_motion():
    scene = load_small("pick_pour_place", 12, 24, 8)
    plan = plan_sequential(scene)
    (_, first), (_, second) = plan_motion(scene, plan, seed=3), plan_motion(scene, plan, seed=3)
    for a, b in zip(first.segments, second.segments, strict=True):
        for name in a.joints:
            np.testing.assert_array_equal(a.joints[name], b.joints[name])


def test_the_first_plan_with_a_motion_is_chosen_and_holds():
    scene = load_small("pick_pour_place", 12, 24, 8)
    plan, failures = best_motion(scene, sequential_plans(scene))
    numbers = [failure.number for failure in failures]
    assert numbers == list(range(1, len(numbers) + 1))
    report = verify(plan)
    assert report, report.failures


def test_a_plan_whose_motion_has_no_times_is_passed_over(monkeypatch):
    scene = load_small("pick_pour_place", 12, 24, 8)
    calls = []

    def timed_the_second_time(motion: Motion, progress: Progress | None) -> Motion:
        calls.append(motion)
        if len(calls) == 1:
            raise NoPlanError("no times")
        return timed(motion, progress)

    monkeypatch.setattr("symgrasp.motion.choosing.timed", timed_the_second_time)
    plan, failures = best_motion(scene, sequential_plans(scene))
    assert "no times" in [failure.reason for failure in failures]
    assert len(calls) == 2
    assert plan.motion


def test_the_motion_may_use_the_configurations_of_all_tasks_that_the_plan_states():
    """Where all of the redundancy is searched, they are at values of it that no sample has."""
    scene = load_small("pick_pour_place", 12, 24).with_settings(redundancy="auto")
    plan = plan_sequential(scene)
    holds, stated = [], []
    with open_world(scene) as world:
        planner = MotionPlanner(scene, world)
        for k, task in enumerate(plan.tasks):
            hold, T = task.holds[0], task.object_pose_turned.array()
            grip = planner.grip([hold])
            phi = redundancy_of(grip.arm, np.array([hold.joints[name] for name in grip.arm.joint_names]))
            assert phi is not None
            near = solver_for(grip.arm, 1, more=[phi + 0.003 * (k + 1)])
            q = configurations(near, grip.tool(T))
            stated.append(q[np.abs(q[:, 6] - near.phi[-1]).argmin()])
            joints = dict(zip(grip.arm.joint_names, stated[-1].tolist(), strict=True))
            holds.append(hold.model_copy(update={"joints": joints}))
        grip = planner.grip(holds)
    for task, q in zip(plan.tasks, stated, strict=True):
        found = grip.configurations(task.object_pose_turned.array())
        assert np.isclose(found, q, atol=1e-9).all(axis=1).any()


def test_planning_can_be_cancelled():
    scene = load_small("pick_pour_place", 12, 24, 8)
    plan = plan_sequential(scene)

    def stop(share: float) -> None:
        assert 0 <= share <= 1
        raise Cancelled

    with pytest.raises(Cancelled):
        plan_motion(scene, plan, progress=stop)


def test_what_failed_is_told_together():
    failures = [Failure(1, "a"), Failure(2, "a"), Failure(3, "b"), Failure(4, "a")]
    assert failures_in_words(failures) == ["plans 1–2: a", "plan 3: b", "plan 4: a"]
