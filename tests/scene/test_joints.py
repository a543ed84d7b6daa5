"""Which joints an arm of a scene has: named, or guessed and then stated by the scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from symgrasp.errors import SceneError
from symgrasp.scene.scene import Scene

TALOS = "package://example-robot-data/robots/talos_data/robots/talos_reduced.urdf"


def hand(side: str) -> dict[str, Any]:
    """Return a hand of TALOS; its measures do not matter here."""
    base, joint = f"gripper_{side}_base_link", f"gripper_{side}_joint"
    return {
        "name": side, "links": [base], "touch_links": [], "joints": {joint: 0.0}, "min_opening": 0,
        "max_opening": 0.08, "finger_depth": 0.03, "pad_width": 0.02,
        "tool": {"link": base, "pose": {"position": [0, 0, -0.1]}},
    }  # fmt: skip


def scene(content: dict[str, Any], *sides: str, **changes: Any) -> Scene:
    """Return a scene with the arms of TALOS."""
    content["obstacles"] = []
    arms = [{"name": side, "hand": hand(side), **changes.get(side, {})} for side in sides]
    content["robots"] = [{"name": "talos", "urdf": TALOS, "arms": arms}]
    for task in content["tasks"]:
        task["arms"] = [sides[0]]
    return Scene.from_content(content, folder=Path())


def joints(side: str, first: int = 1, last: int = 7) -> tuple[str, ...]:
    return tuple(f"arm_{side}_{k}_joint" for k in range(first, last + 1))


def test_one_arm_of_a_humanoid_leaves_the_torso_at_home_and_the_scene_says_so(content):
    guessed = scene(content, "left")
    assert guessed.arm("left").joint_names == joints("left")
    assert guessed.file.robots[0].arm_files()[0].joints == ("arm_left_1_joint", "arm_left_7_joint")
    assert guessed.notes[0].startswith("talos: srdf: talos.srdf, which lets ")
    assert guessed.notes[1:] == (
        "left: joints: [arm_left_1_joint, arm_left_7_joint], group l_arm of the SRDF; "
        "torso_1_joint, torso_2_joint rest at home",
    )
    again = Scene.from_content(guessed.content)
    assert again.sha256 == guessed.sha256
    assert again.map_sha256 == guessed.map_sha256
    assert again.notes == ()


def test_two_arms_leave_what_they_share_at_home(content):
    both = scene(content, "left", "right")
    assert [arm.joint_names for arm in both.arms.values()] == [joints("left"), joints("right")]
    assert not [note for note in both.notes if "joints" in note]


def test_joints_that_are_named_are_the_arms_and_the_home_is_listed_for_them(content):
    ends = ["torso_2_joint", "arm_left_6_joint"]
    named = scene(content, "left", left={"joints": ends})
    assert named.arm("left").joint_names == ("torso_2_joint", *joints("left", 1, 6))
    assert not [note for note in named.notes if "joints" in note]
    content["robots"][0]["home"] = [0.1, 0.2, 0, 0, 0, 0, 0]
    robot = Scene.from_content(content).robots["talos"]
    values = dict(zip(robot.model.joint_names, robot.home, strict=True))
    assert (values["torso_2_joint"], values["arm_left_1_joint"]) == (0.1, 0.2)


@pytest.mark.parametrize(
    ("ends", "sides", "message"),
    [
        (
            ["arm_right_1_joint", "arm_left_7_joint"],
            ["left"],
            "'arm_right_1_joint': expected a joint that turns",
        ),
        (["arm_left_7_joint", "arm_left_1_joint"], ["left"], "first the one that is nearer to the base"),
        (
            ["torso_2_joint", "arm_left_6_joint"],
            ["left", "right"],
            "'torso_2_joint': expected joints that move",
        ),
    ],
)
def test_joints_that_cannot_be_the_arms_are_refused(content, ends, sides, message):
    with pytest.raises(SceneError, match=r"robots\[0\]\.arms\[0\]\.joints") as error:
        scene(content, *sides, left={"joints": ends})
    assert message in str(error.value)


def test_joints_that_only_some_arms_have_stand_with_the_arms(content):
    content["robots"] = [{"name": "talos", "urdf": TALOS, "joints": ["a", "b"], "arms": []}]
    with pytest.raises(SceneError, match=r"arms: .*at least 1"):
        Scene.from_content(content)
