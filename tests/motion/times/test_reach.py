"""How far points of a robot move, against forward kinematics of all its vertices."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.motion.times.reach import joint_reach
from symgrasp.poses import Array
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene


def points(model: RobotModel, q: Array, held: tuple[str, Array]) -> Array:
    poses = model.forward(q)
    at = [(link, hull) for link in model.link_names for hull in model.hulls(link)] + [held]
    return np.concatenate(
        [p @ poses[model.link_index(link)][:3, :3].T + poses[model.link_index(link)][:3, 3] for link, p in at]
    )


@pytest.mark.parametrize("name", ["bottle_on_table", "pr2_pour", "ur5_bottle"])
def test_no_point_moves_further(name):
    scene = Scene.load(name)
    arm = scene.arm()
    model = arm.robot.model
    held = np.array([[0.1, 0.0, 0.2]])
    reach = joint_reach(model, {arm.tool: float(np.linalg.norm(held))})
    rng = np.random.default_rng(0)
    low, high = (np.nan_to_num(v, neginf=-3, posinf=3) for v in (model.lower, model.upper))
    worst = 0.0
    for k in range(40):
        q = rng.uniform(low, high)
        step = rng.normal(0, 0.02, len(q)) * (rng.random(len(q)) < (0.1 if k % 2 else 1.0))
        after = np.clip(q + step, low, high)
        moved = np.linalg.norm(
            points(model, after, (arm.tool, held)) - points(model, q, (arm.tool, held)), axis=1
        )
        bound = float(reach @ np.abs(after - q))
        assert moved.max() <= bound + 1e-9
        worst = max(worst, moved.max() / bound if bound else 0.0)
    assert worst > 0.1  # a bound, not just any large number
