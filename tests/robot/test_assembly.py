from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from symgrasp.descriptions.xml_file import DEEPEST, LARGEST_XML, MOST_ELEMENTS
from symgrasp.errors import MeshError, UrdfError
from symgrasp.meshes import read_mesh
from symgrasp.poses import from_position_rpy, quat_wxyz
from symgrasp.references import resolve
from symgrasp.robot import assembly
from symgrasp.robot.assembly import MOST_LINKS, Frame, Mount, assemble
from symgrasp.robot.model import RobotModel
from tests.hostile import chain_urdf
from tests.meshes.files import collada

WSG = resolve("package://static_scenes/hands/wsg50.urdf", Path()) or Path()
IIWA = resolve("package://pybullet_data/kuka_iiwa/model.urdf", Path()) or Path()
POSE = from_position_rpy([0.01, -0.02, 0.05], [0.3, -0.2, 1.0])
FLANGE = Frame("lbr_iiwa_link_7", tuple(POSE[:3, 3]), tuple(quat_wxyz(POSE)))


def test_a_mounted_hand_is_where_it_was_put():
    iiwa, hand = RobotModel(IIWA), RobotModel(WSG)
    both = RobotModel(IIWA, [Mount(FLANGE, WSG, "")])
    rng = np.random.default_rng(0)
    q = rng.uniform(iiwa.lower, iiwa.upper)
    opened = rng.uniform(hand.lower, hand.upper)
    values = dict(zip(both.joint_names, np.zeros(len(both.joint_names)), strict=True))
    values |= dict(zip(iiwa.joint_names, q, strict=True)) | dict(zip(hand.joint_names, opened, strict=True))
    links = both.forward(np.array(list(values.values())))
    flange = iiwa.forward(q)[iiwa.link_index("lbr_iiwa_link_7")]
    for link, pose in zip(hand.link_names, hand.forward(opened), strict=True):
        np.testing.assert_allclose(links[both.link_index(link)], flange @ POSE @ pose, atol=1e-9)
        assert len(both.hulls(link)) == len(hand.hulls(link))


@pytest.mark.parametrize("up", ["X_UP", "Y_UP", "Z_UP"])
@pytest.mark.parametrize("follow", [False, True])
def test_the_stated_vertical_of_meshes_is_followed_where_asked(tmp_path, up, follow):
    """The scale of the URDF is along the axes of the mesh as it is seen."""
    (tmp_path / "part.dae").write_text(collada(f'<unit meter="0.01"/><up_axis>{up}</up_axis>'))
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(
        '<robot name="r"><link name="l"><collision><origin xyz="0.1 -0.2 0.3" rpy="0.3 -0.2 1"/>'
        '<geometry><mesh filename="part.dae" scale="1 2 3"/></geometry></collision></link></robot>'
    )
    seen = read_mesh(tmp_path / "part.dae", upright=follow).vertices * [1, 2, 3]
    pose = from_position_rpy([0.1, -0.2, 0.3], [0.3, -0.2, 1.0])
    expected = seen @ pose[:3, :3].T + pose[:3, 3]
    (found,) = RobotModel(urdf, follow_up_axis=follow).hulls("l")
    for point in expected:
        assert np.abs(found - point).max(axis=1).min() < 1e-9


def test_a_mesh_without_a_vertical_is_not_turned(tmp_path):
    (tmp_path / "part.dae").write_text(collada("<up_axis>W_UP</up_axis>"))
    urdf = tmp_path / "robot.urdf"
    shape = '<collision><geometry><mesh filename="part.dae"/></geometry></collision>'
    urdf.write_text(f'<robot name="r"><link name="l">{shape}</link></robot>')
    with pytest.raises(MeshError, match=r"link l.*W_UP.*expected a COLLADA file with an up_axis"):
        RobotModel(urdf, follow_up_axis=True)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (chain_urdf(MOST_LINKS + 1), f"links: 5,001 of them: expected at most {MOST_LINKS:,} of them"),
        (chain_urdf(15_000), "links: 15,000 of them"),
        ("<a>" * (LARGEST_XML // 3), f"elements nested more than {DEEPEST} deep"),
        (f"<robot name='r'>{'<a/>' * 1_000_000}</robot>", f"more than {MOST_ELEMENTS:,} elements"),
        (" " * (LARGEST_XML + 1), "more than 5 MB"),
        (
            f"<!DOCTYPE r [<!ENTITY a '{'b' * 100_000}'>]><robot name='r'>{'&a;' * 10_000}</robot>",
            "amplification",
        ),
    ],
    ids=lambda value: value[:20],
)
def test_a_hostile_urdf_is_refused_before_it_is_taken_apart(content, message, tmp_path, monkeypatch):
    monkeypatch.setattr(assembly, "_no_repeats", None)
    path = tmp_path / "robot.urdf"
    path.write_text(content)
    with pytest.raises(UrdfError, match=message) as caught:
        RobotModel(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_chain_of_as_many_links_as_are_allowed_is_read_in_order(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(chain_urdf(MOST_LINKS))
    assert RobotModel(path).link_names == tuple(f"l{i}" for i in range(MOST_LINKS))


def test_the_same_hand_twice_takes_a_prefix():
    other = Frame("lbr_iiwa_link_3")
    both = RobotModel(IIWA, [Mount(FLANGE, WSG, ""), Mount(other, WSG, "second_")])
    assert {"wsg50_tool", "second_wsg50_tool"} <= set(both.link_names)
    assert {"wsg50_joint", "second_wsg50_joint"} <= set(both.joint_names)
    mirror = next(j for j in both.joints if j.name == "second_wsg50_mirror_joint")
    assert both.joint_names[mirror.source] == "second_wsg50_joint"
    with pytest.raises(UrdfError, match="not used twice"):
        RobotModel(IIWA, [Mount(FLANGE, WSG, ""), Mount(other, WSG, "")])


def test_a_frame_without_a_body_may_stand_on_a_mounted_hand():
    mounts = [Mount(FLANGE, WSG, ""), Mount(Frame("wsg50_base", (0.0, 0.0, 0.2)), None, "tip")]
    model = RobotModel(IIWA, mounts)
    links = model.forward(model.default_values())
    base, tip = links[model.link_index("wsg50_base")], links[model.link_index("tip")]
    np.testing.assert_allclose(tip[:3, 3], base[:3, 3] + 0.2 * base[:3, 2], atol=1e-12)
    assert not model.has_shape("tip")


def test_a_link_that_is_not_there():
    with pytest.raises(UrdfError, match="did you mean 'lbr_iiwa_link_7'") as caught:
        assemble(IIWA, [Mount(Frame("lbr_iiwa_link_8"), WSG, "")])
    assert caught.value.field == "mount: link"


def test_what_is_mounted_has_one_root(tmp_path):
    two = tmp_path / "two.urdf"
    two.write_text("<robot name='two'><link name='a'/><link name='b'/></robot>")
    with pytest.raises(UrdfError, match="2 root links"):
        assemble(IIWA, [Mount(FLANGE, two, "")])
    with pytest.raises(UrdfError, match="readable URDF"):
        assemble(IIWA, [Mount(FLANGE, tmp_path / "none.urdf", "")])


def test_meshes_become_absolute_and_colours_stay_apart(tmp_path):
    """Both files have a material called grey; each keeps its own."""
    for name, color in (("arm", "1 0 0 1"), ("hand", "0 1 0 1")):
        (tmp_path / f"{name}.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        (tmp_path / f"{name}.urdf").write_text(
            f"<robot name='{name}'><material name='grey'><color rgba='{color}'/></material>"
            f"<link name='{name}'><visual><geometry><mesh filename='{name}.obj'/></geometry>"
            "<material name='grey'/></visual></link></robot>"
        )
    robot = ET.fromstring(assemble(tmp_path / "arm.urdf", [Mount(Frame("arm"), tmp_path / "hand.urdf", "")]))
    meshes = [mesh.get("filename") for mesh in robot.iter("mesh")]
    assert meshes == [str(tmp_path / "arm.obj"), str(tmp_path / "hand.obj")]
    colors = {m.get("name"): m.find("color") for m in robot.findall("material")}
    used = [m.get("name") for m in robot.iterfind("link/visual/material")]
    assert len(set(used)) == 2
    assert [c.get("rgba") for name in used if (c := colors[name]) is not None] == ["1 0 0 1", "0 1 0 1"]


@pytest.mark.parametrize("robot", ["talos_data/robots/talos_reduced", "ur_description/urdf/ur5_robot"])
def test_robots_of_a_data_package_find_their_meshes(robot):
    """The first refers to them with three slashes."""
    path = resolve(f"package://example-robot-data/robots/{robot}.urdf", Path())
    assert path is not None
    model = RobotModel(path)
    meshes = [shape.path for link in model.colliding_links() for shape in model.shapes(link)]
    assert all(mesh is None or mesh.is_file() for mesh in meshes)
    assert any(meshes)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("arm.urdf.xacro", '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"/>', "without links"),
        ("arm.sdf", "<sdf/>", "'an SDF file of Gazebo': expected a URDF"),
    ],
)  # fmt: skip
def test_a_file_of_another_kind_is_called_what_it_is(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(UrdfError) as error:
        assemble(tmp_path / name)
    assert message in str(error.value)
