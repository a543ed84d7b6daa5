"""Groups and end effectors of an SRDF: which arms they name, and what is made of that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from symgrasp import found_arms
from symgrasp.cli.main import main
from symgrasp.found_arms import find_arms
from symgrasp.references import resolve
from symgrasp.robot.groups import arm_group, arm_groups, group_links
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene

URDF = Path(__file__).parent.parent / "data/two_arms.urdf"
EXAMPLES = "package://example-robot-data/robots/"
CHAINS = """
<group name="torso"><joint name="lift_joint"/><joint name="waist_joint"/></group>
<group name="l_arm_torso"><group name="torso"/><group name="l_arm"/></group>
<group name="l_arm"><chain base_link="chest" tip_link="left_flange"/></group>
<group name="r_arm">{}</group>
<group name="arms"><group name="l_arm"/><group name="r_arm"/><group name="none"/></group>
<group name="round"><group name="round"/></group>
<group name="upper"><joint name="left_j1"/><joint name="left_j2"/><joint name="no_joint"/></group>
<group name="gap">{}</group>
"""
RIGHT = "".join(f'<joint name="right_j{k}"/>' for k in range(1, 7))
LINKS = "".join(
    f'<link name="right_{part}"/>'
    for part in ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
)
GAP = "".join(f'<joint name="right_j{k}"/>' for k in (1, 2, 3, 4, 6))


def described(folder: Path, groups: str, urdf: Path = URDF) -> RobotModel:
    (folder / "robot.srdf").write_text(f'<robot name="r">{groups}</robot>')
    return RobotModel(urdf, srdf=folder / "robot.srdf")


@pytest.mark.parametrize("right", [RIGHT, LINKS])
def test_arms_are_groups_of_joints_in_a_row(tmp_path, right):
    """By chains, joints or links; not with the torso, not two at once, not with a joint left out."""
    model = described(tmp_path, CHAINS.format(right, GAP))
    groups = {group.name: group for group in arm_groups(model)}
    assert set(groups) == {"l_arm", "r_arm"}
    for name, side in (("l_arm", "left"), ("r_arm", "right")):
        assert groups[name].joints == tuple(f"{side}_j{k}" for k in range(1, 7))
    assert (groups["l_arm"].tip, groups["r_arm"].tip) == ("left_flange", "right_wrist_3")
    assert set(group_links(model, "arms")) >= {"left_wrist_3", "right_wrist_3"}
    assert group_links(model, "no group") == []


def test_a_group_decides_which_joints_of_a_chain_are_the_arms(tmp_path):
    model = described(tmp_path, CHAINS.format(RIGHT, GAP))
    chain = ["waist_joint", *(f"left_j{k}" for k in range(1, 7))]
    group = arm_group(model, chain)
    assert group is not None
    assert list(group.joints) == chain[1:]
    assert arm_group(model, chain[:-1]) is None  # the last joint is not the group's
    assert arm_group(RobotModel(URDF), chain) is None


def test_a_scene_takes_the_joints_of_the_group_and_says_so(tmp_path, content):
    """Seven joints turn, which would all be the arm's."""
    (tmp_path / "robot.srdf").write_text(f'<robot name="r">{CHAINS.format(RIGHT, GAP)}</robot>')
    robot: dict[str, Any] = {
        "name": "two",
        "urdf": str(URDF),
        "hand": "wsg50",
        "mount": {"link": "left_flange"},
    }
    content["tasks"] = [{"name": "hold", "pose": {"position": [0.4, 0, 0.2]}}]
    content["robots"] = [robot]
    assert Scene.from_content(content).arm("two").dof == 7
    content["robots"] = [robot | {"srdf": str(tmp_path / "robot.srdf")}]
    scene = Scene.from_content(content)
    assert scene.arm("two").joint_names == tuple(f"left_j{k}" for k in range(1, 7))
    expected = "two: joints: [left_j1, left_j6], group l_arm of the SRDF; waist_joint rest at home"
    assert expected in scene.notes
    assert scene.file.robots[0].joints == ("left_j1", "left_j6")


def test_the_arms_of_a_robot_are_its_groups(tmp_path):
    """Also those that no guess finds: the arms of this robot have no hands, and it has a leg as long."""
    legs = '<group name="l_leg"><chain base_link="chest" tip_link="left_flange"/></group>'
    arms = find_arms(described(tmp_path, CHAINS.format(RIGHT, GAP) + legs))
    assert [(arm.name, arm.tool, arm.hand and arm.hand.name, arm.named) for arm in arms] == [
        ("l_arm", "left_flange", "wsg50", True),
        ("r_arm", "right_wrist_3", "wsg50", True),
    ]
    assert [arm.resting for arm in arms] == [("waist_joint",)] * 2
    assert arms[0].source == "group l_arm of robot.srdf"
    only = find_arms(described(tmp_path, legs.replace("l_leg", "arm")))
    assert [arm.joints[0] for arm in only] == ["left_j1"]


@pytest.mark.parametrize("effector", ["parent_link", "group"])
def test_an_end_effector_says_where_the_hand_is(tmp_path, monkeypatch, effector):
    """On a link that moves with the palm; or, where that is another one, with links of its group."""
    path = resolve(EXAMPLES + "pr2_description/urdf/pr2.urdf", Path())
    assert path is not None
    parent = "l_wrist_roll_link" if effector == "parent_link" else "l_forearm_link"
    groups = f"""<group name="arm"><chain base_link="torso_lift_link" tip_link="l_wrist_roll_link"/></group>
    <group name="gripper"><joint name="l_gripper_l_finger_joint"/><link name="l_gripper_palm_link"/></group>
    <end_effector name="hand" parent_link="{parent}" parent_group="arm" group="gripper"/>"""
    monkeypatch.setattr(found_arms, "in_catalogue", lambda model: None)
    (arm,) = find_arms(described(tmp_path, groups, path))
    assert (arm.name, arm.tool, arm.named) == ("pr2", "l_gripper_palm_link", False)
    assert arm.hand is not None
    assert arm.hand.max_opening == pytest.approx(0.092, abs=0.01)


def test_the_command_names_the_group(tmp_path, capsys):
    (tmp_path / "two.urdf").write_text(URDF.read_text())
    (tmp_path / "two.srdf").write_text(f'<robot name="r">{CHAINS.format(RIGHT, GAP)}</robot>')
    assert main(["robot", str(tmp_path / "two.urdf")]) == 0
    printed = capsys.readouterr().out
    assert "arm l_arm: 6 joints, left_j1 to left_j6, group l_arm of two.srdf" in printed
