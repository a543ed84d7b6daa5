"""The state of a motion at a moment, against forward kinematics and by continuity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.motion.segments import Motion
from symgrasp.poses import inverse, pose_error, rotation_z
from symgrasp.scene.scene import Scene
from tests.motion.straight import CARRIED, GRASPED, straight_motion

TIMES = (0.5, 3.0, 0.5, 2.0)


def timed() -> Motion:
    scene = Scene.load("bottle_on_table")
    arm = scene.arm()
    start = scene.task().T_world_object
    carried = arm.world_tool_pose(CARRIED) @ inverse(arm.world_tool_pose(GRASPED)) @ start
    motion = straight_motion(scene, [start, carried])
    segments = zip(motion.segments, TIMES, strict=True)
    return replace(
        motion,
        segments=tuple(
            replace(s, times=np.linspace(0.0, seconds, len(s.joints[arm.name]))) for s, seconds in segments
        ),
    )


def test_the_motion_starts_at_home_and_passes_every_row():
    motion = timed()
    arm = motion.scene.arm()
    home = motion.at(0.0).values[arm.robot.name]
    np.testing.assert_allclose(home, arm.robot.home, atol=1e-12)
    assert motion.duration == pytest.approx(sum(TIMES))
    for start, segment in zip(motion.starts, motion.segments, strict=False):
        assert segment.times is not None
        for t, row in zip(segment.times, segment.joints[arm.name], strict=True):
            state = motion.at(start + t)
            np.testing.assert_allclose(state.values[arm.robot.name][arm.indices], row, atol=1e-9)


def test_values_and_object_are_continuous():
    motion = timed()
    arm = motion.scene.arm()
    times = np.linspace(-0.1, motion.duration + 0.1, 2000)
    states = [motion.at(t) for t in times]
    values = np.array([state.values[arm.robot.name] for state in states])
    assert np.abs(np.diff(values, axis=0)).max() < 0.01
    poses = np.array([state.T_world_object for state in states])
    distance, angle = pose_error(poses[1:], poses[:-1])
    assert distance.max() < 0.01
    assert angle.max() < 0.01


def test_the_object_moves_with_the_hand_that_holds_it():
    motion = timed()
    arm = motion.scene.arm()
    start, end = motion.starts[3:]
    in_hand = inverse(arm.world_tool_pose(GRASPED)) @ motion.poses[0]
    for t in np.linspace(start, end, 7):
        state = motion.at(t)
        q = state.values[arm.robot.name][arm.indices]
        distance, angle = pose_error(state.T_world_object, arm.world_tool_pose(q) @ in_hand)
        assert distance < 1e-9
        assert angle < 1e-9
    distance, angle = pose_error(motion.at(end).T_world_object, motion.poses[1])
    assert distance < 1e-9
    assert angle < 1e-9


def test_the_object_stays_as_it_was_put_down_where_a_task_is_done_at_two_turns():
    motion = timed()
    again = motion.poses[1] @ rotation_z(0.7)
    wait = replace(motion.segments[0], task_from="place", task_to="place")
    motion = replace(motion, poses=[*motion.poses, again], segments=(*motion.segments, wait))
    np.testing.assert_array_equal(motion.at(motion.duration).T_world_object, motion.poses[1])


def test_the_hand_opens_from_home_and_closes():
    motion = timed()
    arm = motion.scene.arm()
    fingers = [arm.robot.model.joint_names.index(name) for name in arm.hand.joints]
    for t, opening in ((0.5, 0.06), (3.0, 0.06), (3.75, 0.055), (4.0, 0.05), (6.0, 0.05)):
        expected = list(arm.hand.joint_values(opening).values())
        np.testing.assert_allclose(motion.at(t).values[arm.robot.name][fingers], expected, atol=1e-12)
    half = 0.5 * (arm.robot.home[fingers] + list(arm.hand.joint_values(0.06).values()))
    np.testing.assert_allclose(motion.at(0.25).values[arm.robot.name][fingers], half, atol=1e-12)
