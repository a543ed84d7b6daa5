from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
import yaml

from symgrasp.cli import main
from symgrasp.exports import to_csv, to_trajectories, to_tsr
from symgrasp.poses import rotation_z, translation
from symgrasp.scene import Scene
from tests.test_plan import PLANS, bimanual, sequential


@pytest.mark.parametrize("make", PLANS)
def test_csv_reads_back_exactly(make):
    plan = make()
    rows = list(csv.DictReader(io.StringIO(to_csv(plan))))
    values = {(r["task"], r["arm"], r["joint"]): float(r["value"]) for r in rows}
    assert len(rows) == len(values)
    for task in plan.tasks:
        for hold in task.holds:
            for name, value in {**hold.joints, **hold.hand_joints}.items():
                assert values[task.name, hold.arm, name] == value


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
