"""Times of motions: limits, rest at the ends, and the least time of a move that a formula knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.motion.segments import Motion, Segment
from symgrasp.motion.times.timing import GRIP_TIME, timed
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene
from tests.motion.straight import GRASPED, straight_motion


def motion_along(rows: Array, clearance: float, name: str = "bottle_on_table") -> Motion:
    scene = Scene.load(name)
    arm = scene.arm()
    pose = scene.task().T_world_object
    segment = Segment("reach", (arm.name,), {arm.name: rows}, None, {}, (), "pick", "pick", clearance)
    return Motion(scene, [pose], (segment,))


def check_limits(motion: Motion) -> None:
    """Check the speeds and accelerations of every segment, at rest at both ends."""
    for segment in motion.segments:
        assert segment.times is not None
        step = np.diff(segment.times)[:, None]
        assert np.all(step > 0)
        assert segment.times[0] == 0
        for name, rows in segment.joints.items():
            arm = motion.scene.arms[name]
            v = np.diff(rows, axis=0) / step
            assert np.all(np.abs(v) <= arm.robot.model.velocity[arm.indices])
            between = 0.5 * (step[1:] + step[:-1])
            a = np.concatenate([2 * v[:1] / step[0], np.diff(v, axis=0) / between, -2 * v[-1:] / step[-1]])
            assert np.all(np.abs(a) <= arm.robot.acceleration + 1e-9)


def test_a_straight_move_takes_the_time_of_a_trapezoid():
    start = Scene.load("bottle_on_table").arm().home
    for far in (0.4, 2.0):
        end = start + far * np.array([-1.0, 0.3, 0, 0.2, 0, 0, 0.5])
        motion = timed(motion_along(np.linspace(start, end, 3), 0.01))
        arm = motion.scene.arm()
        v, a = arm.robot.model.velocity[0], arm.robot.acceleration
        expected = 2 * np.sqrt(far / a) if far < v * v / a else far / v + v / a
        assert motion.duration == pytest.approx(expected, rel=0.02)
        check_limits(motion)
        assert motion.segments[0].clearance == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize("clearance", [0.0, 0.003, 0.05])
def test_limits_hold_on_crooked_paths(clearance):
    rng = np.random.default_rng(1)
    home = Scene.load("bottle_on_table").arm().home
    for rows in (rng.normal(0, 0.3, (5, 7)), np.cumsum(rng.normal(0, 0.004, (60, 7)), axis=0)):
        motion = timed(motion_along(home + rows, clearance))
        check_limits(motion)
        kept = motion.segments[0].clearance
        assert (0.3 * clearance <= kept < clearance) or kept == clearance == 0
        found = motion.segments[0].joints[motion.scene.arm().name]
        np.testing.assert_allclose(found[[0, -1]], home + rows[[0, -1]], atol=1e-9)


def test_rounded_corners_save_time():
    turn = np.linspace(0, np.pi / 2, 8)[:, None]
    ways = np.array([[1.0, 0, 0, 0.2, 0, 0, 0.5], [0, 0.4, 0, 0.3, 1.0, 0, 0]])
    rows = Scene.load("bottle_on_table").arm().home + np.sin(turn) * ways[0] + np.cos(turn) * ways[1]
    assert timed(motion_along(rows, 0.05)).duration < 0.5 * timed(motion_along(rows, 0.0)).duration


def test_a_scene_sets_the_acceleration():
    rows = np.linspace(Scene.load("bottle_on_table").arm().home, GRASPED, 2)
    slow = motion_along(rows, 0.0)
    content = slow.scene.content
    robots = [{**robot, "acceleration": 8.0} for robot in content["robots"]]
    quick = replace(slow, scene=Scene.from_content({**content, "robots": robots}))
    assert quick.scene.map_sha256 == slow.scene.map_sha256
    assert timed(quick).duration < 0.7 * timed(slow).duration
    check_limits(timed(quick))


def test_a_scene_sets_lower_speeds_and_no_higher_ones():
    rows = np.linspace(Scene.load("bottle_on_table").arm().home, GRASPED, 2)
    plain = motion_along(rows, 0.0)
    content = plain.scene.content
    took = {}
    for velocity in (0.1, 100.0):
        robots = [{**robot, "velocity": velocity} for robot in content["robots"]]
        motion = timed(replace(plain, scene=Scene.from_content({**content, "robots": robots})))
        check_limits(motion)
        (path,), (segment,) = motion.segments[0].joints.values(), motion.segments
        assert segment.times is not None
        speeds = np.abs(np.diff(path, axis=0)) / np.diff(segment.times)[:, None]
        assert speeds.max() <= velocity
        took[velocity] = motion.duration
    assert took[0.1] > np.abs(rows[-1] - rows[0]).max() / 0.1
    assert took[100.0] == pytest.approx(timed(plain).duration)


def test_hands_take_their_time_and_arms_that_rest_stay():
    scene = Scene.load("bottle_on_table")
    pose = scene.task().T_world_object
    motion = timed(straight_motion(scene, [pose, pose]))
    for segment in motion.segments:
        if segment.kind in ("open", "close"):
            assert segment.duration == pytest.approx(GRIP_TIME, rel=1e-3)
            (rows,) = segment.joints.values()
            np.testing.assert_array_equal(rows[0], rows[-1])
    check_limits(motion)
    wide = replace(motion.segments[0], gripper={scene.arm().name: (None, 0.08)})
    slow = replace(motion, segments=(wide,))
    speed = scene.arm().robot.model.velocity[scene.arm().robot.model.joint_names.index("panda_finger_joint1")]
    assert timed(slow).duration >= 0.04 / speed


def test_arms_move_together_and_share_a_torso_once():
    scene = Scene.load("pr2_handover")
    names = [arm.name for arm in scene.arms.values()][:2]
    rows = {name: np.linspace(scene.arms[name].home, scene.arms[name].home + 0.2, 4) for name in names}
    pose = scene.task().T_world_object
    segment = Segment("reach", tuple(names), rows, None, {}, (), "pick", "pick", 0.01)
    motion = timed(Motion(scene, [pose], (segment,)))
    check_limits(motion)
    assert len({len(path) for path in motion.segments[0].joints.values()}) == 1
