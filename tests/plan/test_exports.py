from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from symgrasp.cli.main import main
from symgrasp.object.manifold import grasp_to_tool
from symgrasp.plan.exports import to_csv, to_trajectories, to_tsr
from symgrasp.poses import pose_error, rotation_z, translation
from symgrasp.scene.scene import Scene
from tests.plan.test_plan import PLANS, bimanual, sequential


@pytest.mark.parametrize("make", PLANS)
def test_csv_reads_back_exactly(make):
    plan = make()
    rows = list(csv.DictReader(io.StringIO(to_csv(plan))))
    values = {(r["step"], r["task"], r["arm"], r["joint"]): float(r["value"]) for r in rows}
    expected = {
        (str(step), task.name, hold.arm, name): value
        for step, task in enumerate(plan.tasks, start=1)
        for hold in task.holds
        for name, value in {**hold.joints, **hold.hand_joints}.items()
    }
    assert len(rows) == len(values)
    assert values == expected


@pytest.mark.parametrize("make", PLANS)
def test_trajectories_pass_through_the_tasks(make):
    plan = make()
    content = json.loads(to_trajectories(plan))
    for arm, message in content.items():
        holds = [h for task in plan.tasks for h in task.holds if h.arm == arm]
        assert message["joint_names"] == list(holds[0].joints)
        assert [p["positions"] for p in message["points"]] == [list(h.joints.values()) for h in holds]
        times = [p["time_from_start"]["sec"] for p in message["points"]]
        assert times == sorted(set(times))


@pytest.mark.parametrize("make", PLANS)
def test_regions_contain_the_grasps(make):
    """Bw's height and yaw of the grasp, put into the region's formula, give the plan's tool pose."""
    plan = make()
    scene = Scene.from_content(plan.scene.content)
    regions = list(yaml.safe_load_all(to_tsr(plan)))
    holds = [h for task in plan.tasks for h in task.holds]
    assert len(regions) == len({(h.arm, h.grasp.h) for h in holds})
    for task in plan.tasks:
        for hold in task.holds:
            (region,) = [r for r in regions if r["name"].endswith(hold.arm)]
            bounds = np.array(region["Bw"])
            assert bounds.shape == (6, 2)
            assert bounds[2, 0] <= hold.grasp.h <= bounds[2, 1]
            assert bounds[2, 1] - bounds[2, 0] <= 2 * hold.margin_along + 1e-9
            inside = rotation_z(hold.grasp.theta) @ translation([0, 0, hold.grasp.h])
            T = (
                task.object_pose_turned.array()
                @ np.array(region["T_ref_tsr"])
                @ inside
                @ np.array(region["Tw_e"])
            )
            np.testing.assert_allclose(T, hold.tool_pose.array(), atol=1e-8)
            for h in bounds[2]:
                assert scene.arm(hold.arm).hand.pads_rest(scene.profile, float(h))
            assert region["preshape"] == [hold.opening]


@pytest.mark.parametrize("make", PLANS)
def test_poses_drawn_from_a_region_are_grasps(make):
    """Any pose within Bw, by the region's own formula, is a grasp of its height and angle.

    The hand stays at one distance from the axis, so it may be off by what its radius tolerates.
    """
    plan = make()
    scene = Scene.from_content(plan.scene.content)
    rng = np.random.default_rng(0)
    holds = {h.arm: h for task in plan.tasks for h in task.holds}
    for region in yaml.safe_load_all(to_tsr(plan)):
        hold = holds[region["name"].split(": ")[1]]
        hand = scene.arm(hold.arm).hand
        bounds = np.array(region["Bw"])
        for _ in range(50):
            x, y, z, roll, pitch, yaw = rng.uniform(*bounds.T)
            inside = np.eye(4)
            inside[:3, :3] = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
            inside[:3, 3] = x, y, z
            drawn = np.array(region["T_ref_tsr"]) @ inside @ np.array(region["Tw_e"])
            standoff = hand.standoff(float(scene.profile.radius(z)))
            grasp = grasp_to_tool(np.eye(4), z, yaw, hold.grasp.roll, standoff)
            distance, angle = pose_error(drawn, grasp)
            assert distance <= hand.radius_tolerance + 1e-9
            assert angle < 1e-7


@pytest.mark.parametrize("name", ["csv", "trajectory", "tsr"])
def test_on_the_command_line(name, tmp_path, capsys):
    sequential().save(tmp_path / "plan.json")
    out = tmp_path / "out"
    assert main(["export", name, str(tmp_path / "plan.json"), "--out", str(out)]) == 0
    assert out.stat().st_size > 100
    assert main(["export", name, str(tmp_path / "none.json"), "--out", str(tmp_path / "other")]) == 2
    assert not (tmp_path / "other").exists()


def test_two_arms_have_a_trajectory_each():
    assert set(json.loads(to_trajectories(bimanual()))) == {"left", "right"}
