"""Polishing joint values, against the arm's own kinematics in numpy, of arms with axes in any directions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.ik.newton import POLISHED, polish
from symgrasp.poses import from_position_quat, pose_error, rotation_about
from symgrasp.robot.robot import Arm
from tests.ik.synthetic import synthetic


def any_arm(rng: np.random.Generator, joints: int) -> Arm:
    """Return an arm that is its axes alone, in any directions."""
    H, P = rng.normal(size=(joints, 3)), 0.4 * rng.normal(size=(joints + 1, 3))
    return synthetic(H, P, rotation_about(H[0] / np.linalg.norm(H[0]), 1.0))


def packed(arm: Arm) -> np.ndarray:
    return np.concatenate([arm.H, arm.P, arm.R0, np.zeros((1, 3))])


def polished(arm: Arm, fixed: np.ndarray, start: np.ndarray, T: np.ndarray) -> SimpleNamespace:
    """Polish a copy of joint values, and measure in numpy how far the tool is from the pose afterwards."""
    q = start.copy()
    done = polish(packed(arm), fixed, q, T)
    position, rotation = pose_error(arm.tool_pose(q), T)
    return SimpleNamespace(q=q, done=done, error=max(position, rotation))


def only(joint: int, n: int) -> np.ndarray:
    return np.arange(n) == joint


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-6, 1e-4, 1e-2]), st.booleans())
def test_what_is_almost_solved_is_solved(seed, distance, seven):
    rng = np.random.default_rng(seed)
    n = 7 if seven else 6
    arm, fixed = any_arm(rng, n), only(int(rng.integers(n)) if seven else -1, n)
    goal = rng.uniform(-np.pi, np.pi, n)
    away = distance * rng.uniform(-1, 1, n) * ~fixed
    T = arm.tool_pose(goal)
    found = polished(arm, fixed, goal + away, T)
    np.testing.assert_array_equal(found.q[fixed], goal[fixed])
    assert found.done == (found.error <= POLISHED)
    # From a hundredth of a radian, a pose that is all but singular may be lost.
    assert found.done or distance == 1e-2


def test_it_hardly_ever_fails_from_afar():
    rng = np.random.default_rng(0)
    done = 0
    for _ in range(500):
        arm, goal = any_arm(rng, 6), rng.uniform(-np.pi, np.pi, 6)
        start = goal + 0.03 * rng.uniform(-1, 1, 6)
        done += polished(arm, only(-1, 6), start, arm.tool_pose(goal)).done
    assert done >= 495


@pytest.mark.parametrize("gap", [0.0, 1e-4, 1e-2])
def test_singular_poses(gap):
    """A wrist that is straight, or nearly: joints 4 and 6 share their work, and some split of it is found."""
    rng = np.random.default_rng(1)
    x, y, z = np.eye(3)
    arm = synthetic(
        [z, y, y, x, y, x],
        [[0, 0, 0.3], [0, 0, 0], [0.4, 0, 0], [0.35, 0, 0.03], *[[0, 0, 0]] * 2, [0.1, 0, 0]],
    )
    for _ in range(200):
        goal = rng.uniform(-2.5, 2.5, 6)
        goal[4] = gap
        found = polished(arm, only(-1, 6), goal + 1e-6 * rng.normal(size=6), arm.tool_pose(goal))
        assert found.done and found.error <= POLISHED


def test_a_pose_that_nothing_reaches_is_given_up():
    rng = np.random.default_rng(2)
    for _ in range(100):
        arm = any_arm(rng, 6)
        reach = np.linalg.norm(arm.P, axis=1).sum()
        T = from_position_quat(arm.P[0] + [1.01 * reach, 0, 0], rng.normal(size=4))
        found = polished(arm, only(-1, 6), rng.uniform(-np.pi, np.pi, 6), T)
        assert not found.done and np.isfinite(found.q).all()


def test_a_rotation_by_half_a_turn_is_not_taken_for_none():
    """The sine of the missing angle is zero there."""
    arm = any_arm(np.random.default_rng(3), 6)
    goal = np.zeros(6)
    T = arm.tool_pose(goal)
    T[:3, :3] = T[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    found = polished(arm, np.ones(6, dtype=bool), goal, T)
    assert not found.done
    assert found.error == pytest.approx(np.pi)
