from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from symgrasp.errors import UrdfError
from symgrasp.references import package_dir
from symgrasp.robot.hand import HANDS
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot

DATA = package_dir("pybullet_data") or Path()
PANDA = DATA / "franka_panda" / "panda.urdf"
KUKA = DATA / "kuka_iiwa" / "model.urdf"


@pytest.fixture(scope="module")
def panda() -> RobotModel:
    return RobotModel(PANDA)


def make_arm(model: RobotModel, home: np.ndarray | None = None) -> Arm:
    robot = Robot("panda", model, np.eye(4), model.default_values() if home is None else home)
    return Arm("panda", robot, "panda_grasptarget", HANDS["franka"])


@pytest.mark.parametrize("path", [PANDA, KUKA])
def test_forward_kinematics_agrees_with_yourdfpy(path):
    model = RobotModel(path)
    urdf = yourdfpy.URDF.load(str(path), load_meshes=False)
    assert urdf.actuated_joint_names == list(model.joint_names)
    q = np.random.default_rng(0).uniform(model.lower, model.upper, (20, len(model.joint_names)))
    poses = model.forward(q)
    for row, values in enumerate(q):
        urdf.update_cfg(values)
        for k, link in enumerate(model.link_names):
            np.testing.assert_allclose(poses[row, k], urdf.get_transform(link, model.root), atol=1e-9)


@pytest.mark.parametrize("path", [PANDA, KUKA])
def test_poses_of_one_link_and_in_parts_are_the_same(path):
    model = RobotModel(path)
    q = np.random.default_rng(2).uniform(model.lower, model.upper, (600, len(model.joint_names)))
    poses, parts = model.forward(q), []
    for k, link in enumerate(model.link_names):
        assert np.array_equal(model.link_pose(q, link), poses[:, k])
        assert np.array_equal(model.link_pose(q[0], link), poses[0, k])
    assert np.array_equal(model.forward_rows(q, lambda: parts.append(None)), poses)
    assert len(parts) == 3
    with pytest.raises(UrdfError, match="no_such_link"):
        model.link_pose(q, "no_such_link")


def test_tool_pose_is_the_chain_read_off_the_urdf(panda):
    arm = make_arm(panda)
    q = np.random.default_rng(1).uniform(arm.lower, arm.upper, (50, 7))
    full = np.stack([arm.robot_values(row, 0.05) for row in q])
    chain = panda.forward(full)[:, panda.link_index("panda_grasptarget")]
    np.testing.assert_allclose(arm.tool_pose(q), chain, atol=1e-12)
    assert arm.tool_pose(q.reshape(5, 10, 7)).shape == (5, 10, 4, 4)


def test_limits_and_names_come_from_the_urdf(panda):
    arm = make_arm(panda)
    assert arm.joint_names == tuple(f"panda_joint{i}" for i in range(1, 8))
    assert arm.lower[3] == -3.1416
    assert arm.upper[5] == 3.8223


def test_full_turns_are_taken_back_into_the_limits(panda):
    arm = make_arm(panda)
    inside = np.random.default_rng(2).uniform(arm.lower, arm.upper, (100, 7))
    turns = np.random.default_rng(3).integers(-2, 3, (100, 7))
    back, ok = arm.within_limits(inside + 2 * np.pi * turns)
    assert ok.all()
    np.testing.assert_allclose(back, inside, atol=1e-12)
    outside = inside.copy()
    outside[:, 3] = 1.0  # joint 4 reaches from -π to 0
    assert not arm.within_limits(outside)[1].any()


def test_a_value_beyond_a_limit_by_a_rounding_is_at_it(panda):
    arm = make_arm(panda)
    q = np.tile(0.5 * (arm.lower + arm.upper), (3, 1))
    q[0, 1], q[1, 1], q[2, 1] = arm.upper[1] + 1e-15, arm.upper[1] + 1e-9, arm.upper[1] + 2e-9
    back, ok = arm.within_limits(q)
    assert ok.tolist() == [True, True, False]
    assert back[:2, 1].tolist() == [arm.upper[1]] * 2


def test_neighbours_look_through_links_without_a_shape(panda):
    assert frozenset(("panda_link7", "panda_hand")) in panda.neighbours()
    assert panda.mount_links() == {"panda_link0"}


def test_hand_hulls_open_with_the_hand(panda):
    arm = make_arm(panda)
    for opening in (0.0, 0.03, 0.08):
        _, left, right = arm.hand_hulls(opening)
        gap = left[:, 1].min() - right[:, 1].max()
        assert gap == pytest.approx(opening, abs=5e-4)  # the pads are modelled 0.1 mm proud


def test_palm_stays_behind_the_finger_depth(panda):
    palm, *_ = make_arm(panda).hand_hulls(0.04)
    assert palm[:, 2].max() < -HANDS["franka"].finger_depth


def test_a_shared_model_does_not_share_state(panda):
    home = panda.default_values()
    a, b = make_arm(panda, home), make_arm(panda, home.copy())
    values = a.robot_values(np.full(7, 0.1) * np.sign(a.lower + a.upper + 1e-9), 0.02)
    assert not np.array_equal(values, b.robot.home)
    np.testing.assert_array_equal(a.robot.home, home)


def test_arms_of_five_to_seven_joints_only(panda):
    robot = Robot("panda", panda, np.eye(4), panda.default_values())
    with pytest.raises(UrdfError, match=r"5 to 7 revolute joints, not 4; fewer set the position"):
        Arm("short", robot, "panda_link4", HANDS["franka"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"links": ("panda_paw",)}, "panda_hand"),
        ({"touch_links": ("panda_leftfingr",)}, "did you mean 'panda_leftfinger'"),
        ({"joints": {"panda_finger_joint": 0.5}}, "did you mean 'panda_finger_joint1'"),
    ],
)
def test_a_hand_that_is_not_on_the_robot(panda, change, message):
    robot = Robot("panda", panda, np.eye(4), panda.default_values())
    with pytest.raises(UrdfError, match=message):
        Arm("panda", robot, "panda_grasptarget", replace(HANDS["franka"], **change))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "valid URDF"),
        (
            "<robot name='r'><link name='a'><collision><geometry><box size='-1 1 1'/></geometry></collision>"
            "</link></robot>",
            "sizes that are positive",
        ),
        (
            "<robot name='r'><link name='a'><collision><geometry><sphere radius='nan'/></geometry>"
            "</collision></link></robot>",
            "sizes that are positive",
        ),
        ("<robot name='r'><link name='a'/><link name='a'/></robot>", "not used twice"),
        (
            "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><joint name='j' type='fixed'>"
            "<parent link='a'/><child link='b'/></joint><joint name='j' type='fixed'><parent link='a'/>"
            "<child link='c'/></joint></robot>",
            "joint name: 'j'",
        ),
        ("<robot name='r'><link name='a'/><link name='b'/></robot>", "2 root links"),
        (
            "<robot name='r'><link name='a'><visual><geometry><mesh filename='no.stl'/></geometry>"
            "</visual></link></robot>",
            "no.stl",
        ),
        (
            "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='floating'>"
            "<parent link='a'/><child link='b'/></joint></robot>",
            "floating",
        ),
        ("<robot name='r'/>", "without links"),
        ("<mujoco model='r'><worldbody><bod/></worldbody></mujoco>", "what MuJoCo can read"),
        (
            "<robot name='r'><link name='a'><collision><geometry><plane/></geometry></collision></link>"
            "</robot>",
            "link a: collision: 'plane'",
        ),
        (
            "<robot name='r'><link name='a'><collision><geometry><box size='1 2'/></geometry></collision>"
            "</link></robot>",
            "link a: box: size: '1 2': expected 3 numbers",
        ),
        (
            "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='fixed'>"
            "<parent link='a'/><child link='b'/><origin xyz='0, 1, 2'/></joint></robot>",
            "joint j: origin: xyz: '0, 1, 2'",
        ),
        (
            "<robot name='r'><link name='base'/><joint name='j' type='fixed'><parent link='base'/>"
            "<child link='b'/></joint></robot>",
            "joint j: child: 'b'.*'base'",
        ),
        (
            "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='fixed'>"
            "<parent link='a'/><child link='b'/><origin xyz='0 nan 0'/></joint></robot>",
            "joint j: origin: .*finite",
        ),
        (
            "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='continuous'>"
            "<parent link='a'/><child link='b'/><axis xyz='0 1e400 0'/></joint></robot>",
            "joint j: axis",
        ),
    ],
)
@pytest.mark.filterwarnings("error")
def test_unusable_urdfs(tmp_path, text, message, capfd):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(UrdfError, match=message) as caught:
        RobotModel(path)
    assert caught.value.source == str(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().out == ""


def test_a_missing_urdf(tmp_path):
    with pytest.raises(UrdfError, match="readable URDF"):
        RobotModel(tmp_path / "none.urdf")


def panda_with(folder: Path, old: str, new: str) -> RobotModel:
    """Return the Panda with a piece of its URDF replaced."""
    text = Path(PANDA).read_text().replace("package://", f"{Path(PANDA).parent}/")
    assert old in text
    path = folder / "panda.urdf"
    path.write_text(text.replace(old, new))
    return RobotModel(path)


@pytest.mark.parametrize("limits", ['lower="1" upper="-1"', 'upper="-1"', ""])
def test_limits_matter_where_an_arm_uses_the_joint(tmp_path, limits):
    stated = 'lower="-3.1416" upper="0.0"'
    with pytest.raises(UrdfError, match=r"joint panda_joint4: limit: .*a lower and an upper limit"):
        make_arm(panda_with(tmp_path, stated, limits))
    wheel = (
        '<link name="wheel"/><joint name="spin" type="revolute"><parent link="panda_link0"/>'
        f'<child link="wheel"/><axis xyz="0 0 1"/><limit {limits} effort="1" velocity="1"/></joint></robot>'
    )
    assert make_arm(panda_with(tmp_path, "</robot>", wheel)).dof == 7


def test_limits_without_end_are_none(tmp_path):
    arm = make_arm(panda_with(tmp_path, 'lower="-3.1416" upper="0.0"', 'lower="-1e16" upper="1e16"'))
    assert arm.lower[3] == -np.inf
    assert arm.upper[3] == np.inf


def test_shapes_that_are_only_seen_do_not_matter(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        "<robot name='r'><link name='a'><visual><geometry><capsule radius='1' length='2'/></geometry>"
        "</visual></link></robot>"
    )
    assert RobotModel(path).link_names == ("a",)


def test_links_come_level_by_level_in_the_order_of_the_file(tmp_path):
    """However the joints are ordered, also in a tree of as many links as are allowed."""
    rng = np.random.default_rng(0)
    parents = [0] + [int(rng.integers(max(0, k - 50), k)) for k in range(1, 5000)]
    joints = [
        f'<joint name="j{k}" type="fixed"><parent link="l{parents[k]}"/><child link="l{k}"/></joint>'
        for k in rng.permutation(np.arange(1, 5000))
    ]
    links = [f'<link name="l{k}"/>' for k in range(5000)]
    path = tmp_path / "tree.urdf"
    path.write_text(f'<robot name="r">{"".join(links + joints)}</robot>')
    model = RobotModel(path)
    depth = [0] * 5000
    for k in range(1, 5000):
        depth[k] = depth[parents[k]] + 1
    order = {joint.split('"')[1].replace("j", "l"): k for k, joint in enumerate(joints)}
    expected = sorted(range(1, 5000), key=lambda k: (depth[k], order[f"l{k}"]))
    assert model.link_names == ("l0", *(f"l{k}" for k in expected))
    assert model.mount_links() == frozenset(model.link_names)
