"""Robots in MJCF against MuJoCo's own kinematics and shapes, and against the same robot as a URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.descriptions import mjcf
from symgrasp.descriptions.srdf import read_srdf, srdf_text
from symgrasp.errors import UrdfError
from symgrasp.feasibility.create import create_map
from symgrasp.poses import Array
from symgrasp.robot.link_shapes import collision_hulls
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene

DATA = Path(__file__).parent.parent / "data/arm_description"
URDF, MJCF = DATA / "urdf/arm.urdf.xacro", DATA / "mjcf/arm.xml"
MUJOCO: Any = mujoco


def posed(path: Path, model: RobotModel, q: Array) -> tuple[Any, Any]:
    """Return model and data of MuJoCo, with the joints at the values that a model of the library has."""
    m = MUJOCO.MjModel.from_xml_path(str(path))
    d = MUJOCO.MjData(m)
    indices = {m.joint(k).name: m.jnt_qposadr[k] for k in range(m.njnt)}
    for joint in model.joints:
        if joint.name in indices and joint.source >= 0:
            d.qpos[indices[joint.name]] = joint.ratio * q[joint.source] + joint.offset
    MUJOCO.mj_forward(m, d)
    return m, d


def assert_same_poses(path: Path, model: RobotModel, q: Array) -> None:
    """Compare the poses of all bodies and named sites."""
    m, d = posed(path, model, q)
    links = model.forward(q)
    for kind, positions, rotations in (("body", d.xpos, d.xmat), ("site", d.site_xpos, d.site_xmat)):
        for k in range(len(positions)):
            pose = links[model.link_index(getattr(m, kind)(k).name or f"{kind}{k}")]
            assert np.allclose(pose[:3, 3], positions[k], atol=1e-9)
            assert np.allclose(pose[:3, :3], rotations[k].reshape(3, 3), atol=1e-9)


def written(folder: Path, body: str, rest: str = "", model: str = "r") -> Path:
    path = folder / "robot.xml"
    path.write_text(f'<mujoco model="{model}">{rest}<worldbody>{body}</worldbody></mujoco>')
    return path


numbers = st.floats(-1, 1).map(lambda v: round(v, 3))


def vector(draw: Any, count: int) -> str:
    return " ".join(str(draw(numbers)) for _ in range(count))


@st.composite
def bodies(draw: Any, number: list[int] | None = None, depth: int = 0) -> str:
    """A body with zero to two joints anywhere, a site, and bodies that hang on it."""
    number = [0] if number is None else number
    k = number[0] = number[0] + 1
    turn = draw(
        st.sampled_from(
            [
                'euler="90 0 90"',
                'euler="0 90 0"',
                f'euler="{vector(draw, 3)}"',
                'quat="0.5 0.1 -0.3 0.2"',
                'axisangle="1 2 3 40"',
                'zaxis="1 0.2 0"',
                "",
            ]
        )
    )
    joints = ""
    for i in range(draw(st.integers(0, 2))):
        kind = draw(st.sampled_from(["hinge", "slide"]))
        reference = f' ref="{draw(numbers)}"' if draw(st.booleans()) else ""
        anchor = f' pos="{vector(draw, 3)}"' if draw(st.booleans()) else ""
        axis = f"1 {vector(draw, 2)}"
        joints += f'<joint name="j{k}_{i}" type="{kind}" axis="{axis}" range="-2 3"{reference}{anchor}/>'
    below = "".join(draw(bodies(number, depth + 1)) for _ in range(draw(st.integers(0, 2 - depth))))
    site = f'<site name="s{k}" pos="{vector(draw, 3)}" euler="10 20 30"/>'
    inertia = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
    return (
        f'<frame pos="0.1 0 0"><body name="b{k}" pos="{vector(draw, 3)}" {turn}>{inertia}{joints}{site}'
        f"{below}</body></frame>"
    )


@settings(max_examples=30, deadline=None)
@given(body=bodies(), seed=st.integers(0, 1000))
def test_links_are_where_mujoco_has_them(tmp_path_factory, body, seed):
    """Joints that are anchored elsewhere, several of a body, references, frames, and any orientation."""
    path = written(tmp_path_factory.mktemp("mjcf"), body)
    model = RobotModel(path)
    q = np.random.default_rng(seed).uniform(-1, 1, len(model.joint_names))
    assert_same_poses(path, model, q)


def test_the_same_arm_as_urdf_and_as_mjcf(content):
    urdf, other = RobotModel(URDF), RobotModel(MJCF)
    assert other.joint_names == urdf.joint_names
    assert np.allclose(other.lower, urdf.lower)
    assert np.allclose(other.upper, urdf.upper)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-3, 3, (20, 6)):
        a, b = urdf.forward(q), other.forward(q)
        for k in range(1, 7):
            link = f"link{k}"
            assert np.allclose(b[other.link_index(link)], a[urdf.link_index(link)], atol=1e-12)
            (mine,), (theirs,) = other.hulls(link), urdf.hulls(link)
            assert np.allclose(np.sort(mine, axis=0), np.sort(theirs, axis=0))
        assert_same_poses(MJCF, other, q)
    maps = []
    for path in (URDF, MJCF):
        robot: dict[str, Any] = {"name": "arm", "urdf": str(path), "home": [0, 0, 0, 0, 0, 0]}
        content["robots"] = [robot | {"hand": "wsg50", "mount": {"link": "link6"}}]
        content["tasks"] = [{"name": "hold", "pose": {"position": [0.4, 0, 0.2]}}]
        content["map"] = {"heights": 6, "angles": 16}
        scene = Scene.from_content(content)
        maps.append(create_map(scene))
    assert maps[0].feasible.any()
    assert np.array_equal(maps[0].reason, maps[1].reason)
    assert scene.notes == ("arm: arm.xml lets 1 pairs of links touch",)


SHAPES = """
<body name="b"><joint name="j" axis="1 2 3"/>
<geom name="g0" type="box" size="0.1 0.2 0.3" pos="1 0 0" euler="10 20 30"/>
<geom name="g1" type="cylinder" size="0.1" fromto="0 0 0 0.3 0.4 0.5"/>
<geom name="g2" type="sphere" size="0.2" pos="0 1 0"/>
<geom name="g3" type="capsule" size="0.1" fromto="0 0 1 0.3 0.4 0.5"/>
<geom name="g4" type="mesh" mesh="part" pos="0.1 0.2 0.3" euler="40 50 60"/>
<geom name="g5" type="mesh" mesh="mirrored" pos="0.4 0 0"/>
<geom name="g6" type="mesh" mesh="moved"/>
<geom name="g7" type="mesh" mesh="part" contype="0" conaffinity="0" group="2"/></body>"""
MESHES = """<compiler meshdir="meshes"/><asset><mesh name="part" file="cone.stl"/>
<mesh name="mirrored" file="cone.stl" scale="1 -2 0.5" refpos="0.1 0.2 0.3"/>
<mesh name="moved" file="cone.stl" scale="2 2 2" refpos="0.1 0.2 0.3" refquat="0.5 0.1 -0.3 0.2"/></asset>"""


def test_shapes_are_where_mujoco_has_them(tmp_path):
    (tmp_path / "meshes").mkdir()
    cone = trimesh.creation.cone(0.1, 0.3)
    cone.apply_translation([0.5, 0.6, 0.7])
    cone.export(tmp_path / "meshes/cone.stl")
    path = written(tmp_path, SHAPES, MESHES)
    model = RobotModel(path)
    q = np.array([0.7])
    m, d = posed(path, model, q)
    shapes = list(model.shapes("b"))
    poses = [model.forward(q)[model.link_index("b")] @ shape.pose for shape in shapes]
    assert [shape.kind for shape in shapes] == [
        "box", "cylinder", "sphere", "cylinder", "sphere", "sphere", "mesh", "mesh", "mesh"
    ]  # fmt: skip
    for k, at in enumerate((0, 1, 2, 3)):
        assert np.allclose(poses[at][:3, 3], d.geom_xpos[k])
        assert np.allclose(poses[at][:3, :3], d.geom_xmat[k].reshape(3, 3))
    assert np.allclose(shapes[0].size, 2 * m.geom_size[0])
    for k, at in ((1, 1), (3, 3)):
        assert np.allclose(shapes[at].size, [m.geom_size[k, 0], 2 * m.geom_size[k, 1]])
    ends = d.geom_xpos[3] + np.outer([-1, 1], m.geom_size[3, 1] * d.geom_xmat[3].reshape(3, 3)[:, 2])
    assert np.allclose([poses[4][:3, 3], poses[5][:3, 3]], ends)
    assert [shapes[k].size for k in (2, 4, 5)] == [(0.2,), (0.1,), (0.1,)]
    for geom, shape in zip((4, 5, 6), shapes[6:], strict=True):
        mesh = m.geom_dataid[geom]
        at = m.mesh_vertadr[mesh]
        theirs = m.mesh_vert[at : at + m.mesh_vertnum[mesh]] @ d.geom_xmat[geom].reshape(3, 3).T
        (ours,) = collision_hulls(shape, "b")
        pose = model.forward(q)[model.link_index("b")]
        ours = ours @ pose[:3, :3].T + pose[:3, 3]
        distances = np.linalg.norm((theirs + d.geom_xpos[geom])[:, None] - ours, axis=2)
        assert distances.min(axis=0).max() < 1e-6
    mass, centre = model.masses()
    assert np.isclose(mass.sum(), m.body_mass.sum())
    assert np.allclose(centre[model.link_index("b")], m.body_ipos[1])


def test_joints_that_are_coupled_mimic(tmp_path):
    body = """<body name="a"><joint name="x" type="slide" range="0 1" ref="0.2"/><geom size="0.1"/>
    <body name="b"><joint name="y" range="-9 9" ref="0.1"/><geom size="0.1"/></body></body>"""
    rest = '<equality><joint joint1="y" joint2="x" polycoef="0.3 -2 0 0 0"/></equality>'
    path = written(tmp_path, body, rest)
    model = RobotModel(path)
    assert model.joint_names == ("x",)
    (y,) = [joint for joint in model.joints if joint.name == "y"]
    # y - y0 = 0.3 - 2 (x - x0), https://mujoco.readthedocs.io/en/stable/XMLreference.html#equality-joint
    assert (y.ratio, y.offset) == pytest.approx((-2, np.deg2rad(0.1) + 0.3 + 2 * 0.2))
    assert_same_poses(path, model, np.array([0.5]))


def test_bodies_that_may_touch_and_keyframes(tmp_path):
    body = """<body name="a"><joint name="x"/><geom size="0.1"/>
    <body name="b"><joint name="y"/><geom size="0.1" contype="2" conaffinity="2"/>
    <body name="c"><joint name="z"/><geom size="0.1"/><geom size="0.1" contype="2" conaffinity="0"/></body>
    </body></body>"""
    rest = """<contact><exclude body1="c" body2="a"/></contact>
    <keyframe><key name="home" qpos="0.1 0.2 0.3" ctrl=""/></keyframe>"""
    model = RobotModel(written(tmp_path, body, rest))
    assert model.allowed_pairs() == {frozenset("ac"), frozenset("ab")}
    assert model.srdf is not None
    assert model.srdf.states == {"home": pytest.approx({"x": 0.1, "y": 0.2, "z": 0.3})}
    (tmp_path / "robot.srdf").write_bytes(srdf_text(model.srdf))
    again = read_srdf(tmp_path / "robot.srdf")
    assert (again.disabled, again.states) == (model.srdf.disabled, model.srdf.states)


BALL = '<body name="a"><joint name="x"/><geom name="g" {}/></body>'
MESH = BALL.format('type="mesh" mesh="m"')
TWO = '<body><joint name="x"/><geom size="1"/></body><body><joint name="y"/><geom size="1"/></body>'


@pytest.mark.parametrize(
    ("body", "rest", "message"),
    [
        ('<geom name="floor" type="plane" size="1 1 1"/>', "",
         "geom floor of body world: 'plane': expected the robot alone: floor and"),
        ('<body><freejoint name="x"/><geom size="1"/></body>', "", "joint x: 'a free joint': expected a"),
        ('<body><joint name="x" type="ball"/><geom size="1"/></body>', "", "joint x: 'a ball joint'"),
        ('<body mocap="true" name="m"><geom size="1"/></body>', "", "body m: 'a mocap body'"),
        (BALL.format('type="ellipsoid" size="1 2 3"'), "", "geom g of body a: 'ellipsoid': expected a box"),
        (MESH, '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>',
         "mesh m: '': expected an OBJ or STL file"),
        (MESH, '<asset><mesh name="m" file="no.stl"/></asset>',
         "no.stl': expected an existing file"),
        (BALL.format('size="1"'), '<asset><model name="m" file="no.xml"/></asset>',
         "model: 'no.xml': expected parts joined by <include>"),
        (BALL.format('size="1"') + '<include file="robot.xml"/>', "", "a file that does not include itself"),
        (BALL.format('size="1"'), '<equality><connect body1="a" anchor="0 0 0"/></equality>',
         "'a constraint of the kind connect': expected a tree of links"),
        (BALL.format('size="1"'), '<equality><joint joint1="x"/></equality>', "the kind joint"),
        (TWO,
         '<equality><joint joint1="x" joint2="y" polycoef="0 1 2 0 0"/></equality>', "in proportion"),
        (BALL.format('size="1"'),
         '<tendon><fixed name="t" range="0 1"><joint joint="x" coef="1"/></fixed></tendon>',
         "tendon t: 'a limited tendon'"),
        (BALL.format('siz="1"'), "", "unrecognized attribute"),
        (BALL.format('type="mesh" mesh="no"'), "", "mesh 'no' not found"),
    ],
)  # fmt: skip
def test_what_is_no_plain_arm_is_one_line(tmp_path, body, rest, message):
    with pytest.raises(UrdfError, match=message) as caught:
        RobotModel(written(tmp_path, body, rest))
    assert "\n" not in str(caught.value)


def test_what_is_only_seen_keeps_no_robot_out(tmp_path):
    """Textures, lights, cameras, actuators and sensors, whose files are not even there."""
    rest = """<asset><texture name="t" type="2d" file="no.png"/><material name="m" texture="t"/>
    <hfield name="h" file="no.png" size="1 1 1 1"/></asset>
    <actuator><position joint="x"/></actuator><sensor><jointpos joint="x"/></sensor>"""
    body = """<light/><body name="a"><joint name="x"/><camera/><geom size="0.1" material="m"/>
    <geom type="ellipsoid" size="1 2 3" contype="0" conaffinity="0"/></body>"""
    model = RobotModel(written(tmp_path, body, rest))
    assert [shape.kind for shape in model.shapes("a")] == ["sphere"]


@pytest.mark.parametrize(
    "rest",
    ['<asset><mesh name="m" file="/etc/hostname"/></asset>',
     '<asset><mesh name="m" file="../cone.stl"/></asset>',
     '<compiler meshdir="/etc"/><asset><mesh name="m" file="hostname"/></asset>',
     '<compiler assetdir=".."/><asset><mesh name="m" file="cone.stl"/></asset>',
     '<include file="/etc/hostname"/>', '<include file="../secret.xml"/>'],
)  # fmt: skip
def test_a_file_from_elsewhere_reads_nothing_outside_its_folder(tmp_path, rest):
    from symgrasp.descriptions.description import read_description

    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.xml").write_text("<a><compiler/></a>")
    trimesh.creation.cone(0.1, 0.3).export(tmp_path / "cone.stl")
    with pytest.raises(UrdfError, match="expected a file of the archive"):
        read_description(written(inside, BALL.format('size="1"'), rest), inside=inside)


def test_without_the_extra_the_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(mjcf, "find_spec", lambda name: None)
    with pytest.raises(UrdfError) as caught:
        RobotModel(MJCF)
    assert "'an MJCF file of MuJoCo': expected pip install 'symgrasp[mjcf]', or a URDF" in str(caught.value)
