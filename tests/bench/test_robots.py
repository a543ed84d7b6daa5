"""The bench of robots measures maps, and its search finds what solvers lose."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from symgrasp.bench.arms import robots
from symgrasp.bench.arms.ik import bare_arm, random_configurations
from symgrasp.bench.arms.numerical import INSIDE, reach
from symgrasp.cli.main import main
from symgrasp.errors import SceneError
from symgrasp.feasibility.create import create_map
from symgrasp.ik import CompiledIK
from symgrasp.reason import Reason
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.scene.scene import Scene

ROBOTS = {robot.name: robot for robot in CATALOGUE}


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_the_search_reaches_what_can_be_reached(name):
    """Pinocchio says where the tool is, and no step leads out of the limits."""
    pinocchio = pytest.importorskip("pinocchio")
    arm = bare_arm(ROBOTS[name], ROBOTS[name].arms[0])
    model = pinocchio.buildModelFromUrdf(str(arm.robot.model.path))
    data, frame = model.createData(), model.getFrameId(arm.tool)
    rng = np.random.default_rng(0)

    def pose(q) -> np.ndarray:
        values = pinocchio.neutral(model)
        for joint, value in zip(arm.joint_names, q, strict=True):
            values[model.joints[model.getJointId(joint)].idx_q] = value
        pinocchio.framesForwardKinematics(model, data, values)
        return data.oMf[frame].homogeneous

    for q in random_configurations(arm, 10, 1):
        found = reach(arm, pose(q), rng)
        assert found is not None
        np.testing.assert_allclose(pose(found), pose(q), atol=1e-8)
        assert np.all((found >= arm.lower + 0.9 * INSIDE) & (found <= arm.upper - 0.9 * INSIDE))
    far = np.eye(4)
    far[0, 3] = 5.0
    assert reach(arm, far, rng) is None


@pytest.fixture(scope="module")
def ur5() -> robots.RobotRow:
    return robots.measure(ROBOTS["ur5"], 50)


def test_a_robot_is_measured(ur5):
    assert (ur5.problem, ur5.engine, ur5.hand) == ("", "exact", "wsg50")
    assert (ur5.found, ur5.poses) == (50, 50)
    assert ur5.milliseconds > 0
    assert 0 < ur5.feasible < 1
    assert (ur5.unreached.cells, ur5.unreached.reached, ur5.unreached.refuted) == (robots.CHECKED, 0, ())
    assert (ur5.control.cells, ur5.control.missed, ur5.control.refuted) == (robots.CHECKED, 0, ())
    assert ur5.control.reached >= 0.95 * robots.CHECKED
    assert Scene.from_content(ur5.content).manifold.heights == robots.GRID["heights"]
    assert "closed form, three parallel axes" in ur5.line()


def test_wrong_maps_and_solvers_are_found_out(ur5, monkeypatch):
    """A map that calls feasible cells unreachable, by a solver that finds nothing inside the limits."""
    scene = Scene.from_content(ur5.content)
    right = create_map(scene)
    wrong = replace(right, reason=np.where(right.feasible, Reason.UNREACHABLE, right.reason))
    solve = CompiledIK.solve

    def blind(self, T):
        found = solve(self, T)
        return found._replace(inside=np.zeros_like(found.inside))

    monkeypatch.setattr(robots, "CHECKED", 100)
    sound = robots.check(scene, [wrong], [Reason.UNREACHABLE])
    assert 10 < sound.reached == len(sound.refuted) < 60
    assert sound.missed == 0
    for cell in sound.refuted:
        assert right.feasible[cell.cell]
        tool = scene.manifold.tool_poses(cell.T_world_object, scene.arm().hand.finger_depth)[cell.cell]
        np.testing.assert_allclose(scene.arm().world_tool_pose(cell.q), tool, atol=1e-8)
    monkeypatch.setattr(CompiledIK, "solve", blind)
    lost = robots.check(scene, [wrong], [Reason.UNREACHABLE])
    assert lost.missed == lost.reached == sound.reached
    assert all(cell.missed for cell in lost.refuted)


def test_problems_are_rows():
    absent = replace(ROBOTS["panda"], urdf="package://no_such_package/robot.urdf")
    row = robots.measure(absent, 1)
    assert row.problem == f"urdf: {absent.urdf}, expected pip install pybullet"
    assert "no solver, no map: urdf" in row.line()
    assert row.line().endswith("expected pip install pybullet")
    assert not row.family


def test_what_is_known_of_a_robot_without_a_scene(monkeypatch):
    def nowhere(*_):
        raise SceneError("ur5", "arm arm", 8, "a place where it reaches an upright can")

    monkeypatch.setattr(robots, "starter_scene", nowhere)
    row = robots.measure(ROBOTS["ur5"], 20)
    assert (row.problem, row.found) == ("arm arm: 8, expected a place where it reaches an upright can", 20)
    assert "recall 100.000 %, no map" in row.line()


def test_on_the_command_line(monkeypatch, tmp_path, capsys):
    absent = replace(ROBOTS["so101"], urdf="package://no_such_package/robot.urdf")
    monkeypatch.setattr(robots, "CATALOGUE", [absent])
    assert main(["bench", "robots", "--poses", "1", "--out", str(tmp_path / "robots.json")]) == 0
    assert capsys.readouterr().out.startswith("so101 ")
    (row,) = json.loads((tmp_path / "robots.json").read_text())["robots"]
    assert row["name"] == "so101"
