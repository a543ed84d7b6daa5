"""SRDFs: which one belongs to a URDF, what it says, and what that changes."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from symgrasp.descriptions.srdf import find_srdf, read_srdf
from symgrasp.errors import UrdfError
from symgrasp.references import resolve
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene
from symgrasp.world import checked_self_pairs, prepared

STATE = """<robot name="panda">
  <group name="arm"/>
  <disable_collisions link1="panda_link5" link2="panda_link7" reason="User"/>
  <disable_collisions link1="panda_link5" link2="no_such_link" reason="Never"/>
  <group_state name="bent" group="arm">
    <joint name="panda_joint4" value="-1.5"/><joint name="panda_joint6" value="1.5"/>
    <joint name="root_joint" value="0 0 0 0 0 0 1"/>
  </group_state>
  <group_state name="bent" group="other"><joint name="panda_joint1" value="0.25"/></group_state>
</robot>"""


def test_which_srdf_belongs_to_a_urdf(tmp_path):
    urdf = tmp_path / "urdf/arm.urdf"
    (tmp_path / "srdf").mkdir()
    urdf.parent.mkdir()
    assert find_srdf(urdf) is None
    (tmp_path / "srdf/robot.srdf").touch()
    assert find_srdf(urdf) == tmp_path / "srdf/robot.srdf"  # the only one
    (tmp_path / "srdf/other.srdf").touch()
    assert find_srdf(urdf) is None
    (tmp_path / "srdf/arm.srdf").touch()
    assert find_srdf(urdf) == tmp_path / "srdf/arm.srdf"
    (tmp_path / "urdf/arm.srdf").touch()
    assert find_srdf(urdf) == tmp_path / "urdf/arm.srdf"


def test_the_only_srdf_of_a_folder_is_not_another_robots(content, tmp_path):
    """One of the same stem is; it is said of both that names differ, and names of any case fit."""
    urdf = resolve("package://pybullet_data/franka_panda/panda.urdf", tmp_path)
    assert urdf is not None
    shutil.copytree(urdf.parent, tmp_path / "panda")
    urdf, other = tmp_path / "panda/panda.urdf", tmp_path / "panda/other.srdf"
    robot = {"name": "arm", "urdf": str(urdf), "tool": "panda_grasptarget", "hand": "franka"}
    content["robots"] = [robot]
    names = "it describes robot 'other', and panda.urdf is robot 'panda'"
    other.write_text(STATE.replace('name="panda"', 'name="other"', 1))
    assert find_srdf(urdf) is None
    scene = Scene.from_content(content)
    assert f"arm: srdf: not the one beside it: {names}; srdf: other.srdf in the scene reads it" in scene.notes
    assert scene.robots["arm"].model.srdf is None
    read = Scene.from_content({**content, "robots": [{**robot, "srdf": str(other)}]})
    assert read.robots["arm"].model.srdf is not None

    other.write_text(STATE.replace('name="panda"', 'name="Panda"', 1))
    assert find_srdf(urdf) == other
    assert "arm: srdf: other.srdf, which lets 1 pairs of links touch" in Scene.from_content(content).notes

    other.rename(own := other.with_name("panda.srdf"))
    own.write_text(STATE.replace('name="panda"', 'name="other"', 1))
    assert find_srdf(urdf) == own
    said = f"arm: srdf: panda.srdf, which lets 1 pairs of links touch; {names}"
    assert said in Scene.from_content(content).notes


def test_what_it_says(tmp_path):
    path = tmp_path / "a.srdf"
    path.write_text(STATE)
    srdf = read_srdf(path)
    assert frozenset(("panda_link5", "panda_link7")) in srdf.disabled
    assert srdf.states == {"bent": {"panda_joint4": -1.5, "panda_joint6": 1.5, "panda_joint1": 0.25}}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "expected a valid SRDF document"),
        ("<sdf/>", "expected <robot>, as in an SRDF"),
        (STATE.replace("-1.5", "nan"), "group_state bent: panda_joint4: 'nan': expected a number"),
        (STATE.replace("-1.5", "x"), "group_state bent: panda_joint4: 'x': expected a number"),
    ],
)
def test_what_is_no_srdf_is_one_line(tmp_path, text, message):
    path = tmp_path / "a.srdf"
    path.write_text(text)
    with pytest.raises(UrdfError, match=message):
        read_srdf(path)


def test_links_that_may_touch_are_not_checked_and_are_part_of_the_hash(tmp_path):
    path = tmp_path / "a.srdf"
    path.write_text(STATE)
    urdf = resolve("package://pybullet_data/franka_panda/panda.urdf", tmp_path)
    assert urdf is not None
    plain, described = RobotModel(urdf), RobotModel(urdf, srdf=path)
    assert set(checked_self_pairs(plain)) - set(checked_self_pairs(described)) == {
        ("panda_link5", "panda_link7")
    }
    assert described.allowed_pairs() == {frozenset(("panda_link5", "panda_link7"))}
    assert plain.sha256 != described.sha256
    path.write_text(STATE.replace("panda_link7", "no_link"))
    assert RobotModel(urdf, srdf=path).sha256 == plain.sha256  # of which nothing concerns this robot


def test_a_state_is_the_home_where_none_is_given_and_the_scene_says_so(content, tmp_path):
    urdf = resolve("package://pybullet_data/franka_panda/panda.urdf", tmp_path)
    assert urdf is not None
    shutil.copytree(urdf.parent, tmp_path / "panda")
    (tmp_path / "panda/panda.srdf").write_text(STATE)
    content["robots"][0]["urdf"] = "panda/panda.urdf"
    home = content["robots"][0].pop("home")
    scene = prepared(Scene.from_content(content, folder=tmp_path))
    robot = scene.robots["panda"]
    values = dict(zip(robot.model.joint_names, robot.home, strict=True))
    assert (values["panda_joint1"], values["panda_joint4"], values["panda_joint6"]) == (0.25, -1.5, 1.5)
    assert scene.notes[0] == "panda: srdf: panda.srdf, which lets 1 pairs of links touch"
    assert scene.notes[1].endswith("state 'bent' of the SRDF")
    assert scene.content["robots"][0]["srdf"] == str(tmp_path / "panda/panda.srdf")
    again = Scene.from_content(scene.content)
    assert (again.map_sha256, again.notes) == (scene.map_sha256, ())
    content["robots"][0]["home"] = home
    given = prepared(Scene.from_content(content, folder=tmp_path))
    assert np.allclose(given.robots["panda"].home[:7], home)
