"""``symgrasp robot`` and ``symgrasp robots``: what they print, and the scenes that they write."""

from __future__ import annotations

from pathlib import Path

import pytest

from symgrasp.cli.main import main
from symgrasp.feasibility.create import create_map
from symgrasp.found_arms import find_arms
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene

CATALOGUED = {robot.name: robot for robot in CATALOGUE}


@pytest.mark.parametrize("name", ["iiwa", "ur5", "romeo", "icub", "tiago_dual"])
def test_the_scene_has_feasible_cells(name, tmp_path, capsys):
    """Of hands that open a little only, and of those with four fingers in a row, too."""
    out = tmp_path / "scene.yaml"
    assert main(["robot", CATALOGUED[name].urdf, "--scene", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "solver: closed form" in printed
    assert "in reach of" in printed
    scene = Scene.load(out)
    assert [robot.urdf for robot in scene.file.robots] == [CATALOGUED[name].urdf]
    assert list(scene.arms) == [arm.name for arm in CATALOGUED[name].arms]
    assert scene.settings.redundancy == "auto"
    assert create_map(scene).feasible.any()


def test_arms_are_found_without_the_catalogue(tmp_path):
    """The joints that people call the arms of a PR2, from a copy that is not the catalogue's file."""
    path = resolve(CATALOGUED["pr2"].urdf, Path())
    assert path is not None
    text = path.read_text().replace("package://example-robot-data", str(path.parents[3]))
    (tmp_path / "mine.urdf").write_text(text)
    arms = find_arms(RobotModel(tmp_path / "mine.urdf"))
    ends = {(arm.joints[0], arm.joints[-1]) for arm in arms}
    assert ends == {arm.joints for arm in CATALOGUED["pr2"].arms}
    assert all(arm.hand is not None and arm.hand.max_opening == pytest.approx(0.092) for arm in arms)


def test_arms_end_at_hands_that_cannot_be_measured(capsys):
    """Not at the tips of their fingers; why is said."""
    folder = CATALOGUED["vega"].urdf.rpartition("/")[0]
    assert main(["robot", f"{folder}/vega_1_f5d6.urdf"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  arm")]
    assert lines == [
        f"  arm {side}_hand_base: 7 joints, {side}_arm_j1 to {side}_arm_j7" for side in ("L", "R")
    ]


def test_another_arm_can_be_the_one_that_reaches(tmp_path, capsys):
    out = tmp_path / "scene.yaml"
    assert main(["robot", CATALOGUED["pr2"].urdf, "--scene", str(out), "--arm", "right"]) == 0
    assert Scene.load(out).task().arms == ("right",)
    assert main(["robot", CATALOGUED["pr2"].urdf, "--arm", "middle"]) == 2
    assert "--arm: 'middle': expected one of 'left', 'right'" in capsys.readouterr().err


def test_meshes_that_are_turned_only_where_asked(tmp_path, capsys):
    """Of an iCub that is not the catalogue's file, all meshes state y as up."""
    path = resolve(CATALOGUED["icub"].urdf, Path())
    assert path is not None
    text = path.read_text().replace("package://example-robot-data", str(path.parents[3]))
    (tmp_path / "mine.urdf").write_text(text)
    assert main(["robot", str(tmp_path / "mine.urdf")]) == 0
    assert "56 COLLADA meshes state another axis than z as up" in capsys.readouterr().out
    assert main(["robot", str(tmp_path / "mine.urdf"), "--follow-up-axis"]) == 0
    assert "COLLADA" not in capsys.readouterr().out


def test_what_is_no_robot_with_an_arm(tmp_path, capsys):
    assert main(["robot", "package://pybullet_data/r2d2.urdf"]) == 0
    assert "no arm" in capsys.readouterr().out
    out = tmp_path / "scene.yaml"
    assert main(["robot", "package://pybullet_data/r2d2.urdf", "--scene", str(out)]) == 2
    assert "expected an arm with a solver and a hand" in capsys.readouterr().err
    assert not out.exists()
    assert main(["robot", "no.urdf"]) == 2
    assert "expected an existing URDF file" in capsys.readouterr().err


def test_the_list_names_every_robot_and_what_to_install(capsys, monkeypatch, thorough):
    listed = CATALOGUE if thorough else [CATALOGUED[name] for name in ("ur5", "z1", "romeo", "j2s6")]
    monkeypatch.setattr("symgrasp.robot.catalogue.CATALOGUE", listed)
    assert main(["robots"]) == 0
    printed = capsys.readouterr().out
    assert all(robot.title in printed and robot.urdf in printed for robot in listed)
    assert "ur5: 6 joints, shoulder_pan_joint to wrist_3_joint; closed form, three parallel axes" in printed
    assert "hand wsg50, mounted on tool0, opens from 0 to 110 mm" in printed
    assert "hand at gripperStator opens from 1 to 73 mm" in printed
    assert "hand at r_gripper opens from 0 to 50 mm" in printed
    assert "for none of its own can be used: tool: 'j2s6s200_end_effector'" in printed
    monkeypatch.setattr("symgrasp.references.resolve", lambda *_: None)
    assert main(["robots"]) == 0
    assert capsys.readouterr().out.count("not installed; pip install example-robot-data") == sum(
        robot.package == "example-robot-data" for robot in listed
    )
