"""How far an arm is from its limits and from singular poses, against differences and known poses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from symgrasp.poses import inverse
from symgrasp.robot.posture import LEAST, conditioning, ease, limit_slack
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from tests.plan.test_torso import content

READY = [0, -0.785, 0, -2.356, 0, 1.571, 0.785]


@cache
def arm(name: str) -> Arm:
    """A Panda, or an arm on a torso of two joints."""
    return (Scene.load("bottle_on_table") if name == "panda" else Scene.from_content(content())).arm()


def by_differences(arm: Arm, q: np.ndarray) -> float:
    """The conditioning, with the Jacobian from central differences of the tool pose."""
    first, step = arm.dof - len(arm.H), 1e-6
    length = np.linalg.norm(arm.P[1:], axis=1).sum()
    columns = []
    for j in range(first, arm.dof):
        ahead, back = (arm.tool_pose(q + sign * step * np.eye(arm.dof)[j]) for sign in (1, -1))
        turn = (ahead @ inverse(back))[:3, :3]
        omega = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        columns.append(np.concatenate([omega, (ahead - back)[:3, 3] / length]) / (2 * step))
    values = np.linalg.svd(np.transpose(columns), compute_uv=False)
    return values[-1] / values[0]


@pytest.mark.parametrize("name", ["panda", "left"])
def test_conditioning_is_that_of_the_differences(name):
    rng = np.random.default_rng(1)
    q = rng.uniform(np.maximum(arm(name).lower, -3), np.minimum(arm(name).upper, 3), (20, arm(name).dof))
    expected = [by_differences(arm(name), row) for row in q]
    np.testing.assert_allclose(conditioning(arm(name), q), expected, atol=1e-6)


def test_slack_is_that_of_the_nearest_limit():
    panda = arm("panda")
    middle = 0.5 * (panda.lower + panda.upper)
    near = middle.copy()
    near[3] = panda.upper[3] - 0.01
    outside = middle.copy()
    outside[0] = panda.lower[0] - 0.02
    slack = limit_slack(panda, [middle, near, outside])
    assert slack == pytest.approx([0.5 * (panda.upper - panda.lower).min(), 0.01, -0.02])


def test_ease():
    """1 in a ready pose, less near a limit, and least with the elbow straight; 1 where there is no pose."""
    panda, near = arm("panda"), np.array(READY)
    near[3] = panda.lower[3] + np.deg2rad(1.0)
    assert ease(panda, [READY, near, np.full(7, np.nan)]) == pytest.approx([1.0, 0.2, 1.0])
    iiwa = Scene.load("log_iiwa_and_panda").arm("iiwa")
    straight = np.array([0.3, 0.5, 0.2, 0.0, 0.4, 0.8, 0.1])
    assert conditioning(iiwa, straight) == pytest.approx(0.0, abs=1e-9)
    assert ease(iiwa, straight) == LEAST
