"""URDFs are read as yourdfpy reads them."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from symgrasp.descriptions.urdf import ROUNDED_ANGLE, UrdfJoint, UrdfShape, read_urdf
from symgrasp.errors import UrdfError
from symgrasp.poses import from_position_rpy
from symgrasp.robot.model import RobotModel
from tests.conftest import SHIPPED, load_small

LINKS = '<link name="a">{}</link><link name="b"/>'
JOINT = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{}</joint>'


def check_origin(origin: np.ndarray, expected: np.ndarray | None) -> None:
    """Right angles that a file rounds are right here, and as the file has them there."""
    np.testing.assert_allclose(origin, np.eye(4) if expected is None else expected, atol=2 * ROUNDED_ANGLE)


def check_shape(shape: UrdfShape, expected: yourdfpy.Collision) -> None:
    geometry = expected.geometry
    assert geometry is not None
    check_origin(shape.origin, expected.origin)
    if geometry.box is not None:
        size = geometry.box.size
    elif geometry.cylinder is not None:
        size = geometry.cylinder.radius, geometry.cylinder.length
    elif geometry.sphere is not None:
        size = (geometry.sphere.radius,)
    else:
        assert geometry.mesh is not None
        assert shape.path == Path(geometry.mesh.filename)
        size = np.broadcast_to(1.0 if geometry.mesh.scale is None else geometry.mesh.scale, 3)
    assert getattr(geometry, shape.kind) is not None
    assert shape.size == tuple(size)


def check_joint(joint: UrdfJoint, expected: yourdfpy.Joint) -> None:
    assert (joint.name, joint.type) == (expected.name, expected.type)
    assert (joint.parent, joint.child) == (expected.parent, expected.child)
    check_origin(joint.origin, expected.origin)
    np.testing.assert_array_equal(joint.axis, expected.axis)
    limit, mimic = expected.limit, expected.mimic
    assert joint.limit == (None if limit is None else (limit.lower, limit.upper, limit.velocity))
    assert joint.mimic == (None if mimic is None else (mimic.joint, mimic.multiplier, mimic.offset))


def check(urdf: bytes) -> None:
    robot = read_urdf(ET.fromstring(urdf))
    expected = yourdfpy.URDF.load(io.BytesIO(urdf), build_scene_graph=False, load_meshes=False).robot
    assert robot.name == expected.name
    assert [link.name for link in robot.links] == [link.name for link in expected.links]
    for link, other in zip(robot.links, expected.links, strict=True):
        assert len(link.collisions) == len(other.collisions)
        for shape, of_other in zip(link.collisions, other.collisions, strict=True):
            check_shape(shape, of_other)
        mass = None if other.inertial is None else other.inertial.mass
        assert (link.inertial and link.inertial.mass) == mass
        if link.inertial and other.inertial:
            check_origin(link.inertial.origin, other.inertial.origin)
    assert len(robot.joints) == len(expected.joints)
    for joint, of_other in zip(robot.joints, expected.joints, strict=True):
        check_joint(joint, of_other)


@pytest.mark.parametrize("scene", SHIPPED)
def test_the_robots_of_the_shipped_scenes(scene):
    for robot in load_small(scene).robots.values():
        check(robot.model.urdf)


def test_what_a_file_may_leave_out_or_state():
    shape = (
        '<collision><origin rpy="0.1 -0.2 3"/><geometry><mesh filename="m.stl" scale="{}"/></geometry>'
        "</collision>"
    )
    for scale in ("2", "1 -1 2"):
        link = f'<inertial><origin xyz="1 2 3"/><mass value="2"/></inertial>{shape.format(scale)}'
        joint = '<axis/><limit lower="-1" effort="3"/><mimic joint="k"/>'
        check(f'<robot name="r">{LINKS.format(link)}{JOINT.format(joint)}</robot>'.encode())


@pytest.mark.parametrize("stated", ["1.57079632679", "-1.5707963268", "3.14159265359", "4.712388980385"])
@pytest.mark.parametrize("place", range(3))
def test_right_angles_are_right_up_to_the_rounding_of_urdfs(stated, place):
    """Axes that meet by their URDF then meet, and no others are moved."""
    for text, exact in ((stated, True), (stated[:9], False)):
        angles = ["0.3", "-0.2", "0.7"]
        angles[place] = text
        origin = f"<origin xyz='1 2 3' rpy='{' '.join(angles)}'/>"
        robot = ET.fromstring(f'<robot name="r">{LINKS.format("")}{JOINT.format(origin)}</robot>')
        (joint,) = read_urdf(robot).joints
        as_stated = [float(angle) for angle in angles]
        right = list(as_stated)
        right[place] = np.round(float(text) / (np.pi / 2)) * np.pi / 2
        off = np.abs(joint.origin - from_position_rpy([1, 2, 3], right)).max()
        assert (off == 0) == exact
        np.testing.assert_allclose(joint.origin, from_position_rpy([1, 2, 3], as_stated), atol=1e-9)


@pytest.mark.parametrize(
    ("link", "joint"),
    [
        ("<collision/>", ""),
        ("<collision><geometry><cylinder radius='1'/></geometry></collision>", ""),
        ("<collision><geometry><mesh/></geometry></collision>", ""),
        ("<inertial><mass value='heavy'/></inertial>", ""),
        ("", "<limit velocity='fast'/>"),
        ("", "<mimic/>"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(tmp_path, link, joint):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{LINKS.format(link)}{JOINT.format(joint)}</robot>')
    with pytest.raises(UrdfError) as refused:
        RobotModel(path)
    assert "\n" not in str(refused.value)


def test_a_joint_needs_two_links(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{LINKS.format("")}<joint name="j" type="fixed"/></robot>')
    with pytest.raises(UrdfError, match="parent"):
        RobotModel(path)
