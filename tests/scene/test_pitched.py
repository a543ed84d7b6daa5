"""What scenes with arms of five joints are asked for, and what they are refused."""

from __future__ import annotations

import pytest

from symgrasp.errors import SceneError, UrdfError
from symgrasp.scene.scene import Scene
from tests.engine.random_scenes import random_pitched_scene


@pytest.fixture
def content():
    return random_pitched_scene(0)


def test_their_values_are_joints_pitch_and_azimuth(content):
    arm = Scene.from_content(content).arm()
    assert arm.pitched
    assert arm.joint_names == ("pan", "lift", "elbow", "flex", "roll")
    assert arm.value_names == (*arm.joint_names, "pitch", "azimuth")
    assert arm.dof == len(arm.home) == 7
    assert arm.robot_values(arm.home) == pytest.approx(arm.robot.home)


def test_no_approach(content):
    """Five joints cannot keep the direction of a hand along a line."""
    with pytest.raises(SceneError, match="five joints") as caught:
        Scene.from_content({**content, "map": {**content["map"], "approach": 0.1}}, "with_five.yaml")
    assert (caught.value.field, caught.value.value) == ("map.approach", 0.1)
    with pytest.raises(SceneError, match="five joints"):
        Scene.from_content(content).with_settings(approach=0.1)


def test_no_support(content):
    (robot,) = content["robots"]
    names = ["pan", "lift", "elbow", "flex", "roll"]
    home = dict(zip(names, robot["home"], strict=True))
    standing = {**robot, "home": home, "support": [[1, 1], [-1, 1], [-1, -1], [1, -1]]}
    with pytest.raises(UrdfError, match="6 or 7 revolute joints on a robot with a support"):
        Scene.from_content({**content, "robots": [standing]})


def test_a_scara_is_told_what_it_lacks(content):
    (robot,) = content["robots"]
    scara = {**robot, "joints": ["pan", "elbow"], "home": robot["home"][:3]}
    with pytest.raises(UrdfError, match="not 3; fewer set the position of the hand, but not the direction"):
        Scene.from_content({**content, "robots": [scara]})
