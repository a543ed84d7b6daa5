"""PyBullet has the links of a URDF as the library reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet
import pytest
import trimesh

from symgrasp.errors import MeshError, UrdfError
from symgrasp.meshes import MESH_ENDINGS
from symgrasp.references import package_dir
from symgrasp.robot.model import RobotModel
from symgrasp.world.client import link_names, load_urdf
from symgrasp.world.shapes import MARGIN, link_shapes
from tests.meshes.files import collada, stl

DATA = Path(package_dir("pybullet_data") or "")


@pytest.fixture
def client():
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(client)


def urdf(folder: Path, inner: str, attributes: str = "") -> Path:
    path = folder / "robot.urdf"
    collision = f"<collision{attributes}><geometry>{inner}</geometry></collision>"
    path.write_text(f'<robot name="r"><link name="l">{collision}</link></robot>')
    return path


def in_pybullet(client: int, model: RobotModel, link: str) -> np.ndarray:
    """The box (2, 3) around a link that PyBullet has."""
    body = load_urdf(client, model, np.eye(4))
    shapes = link_shapes(client, body, link_names(client, body).index(link) - 1)
    points = np.concatenate([shape.vertices for shape in shapes])
    return np.array([points.min(axis=0), points.max(axis=0)])


def in_library(model: RobotModel, link: str) -> np.ndarray:
    points = np.concatenate(model.hulls(link))
    return np.array([points.min(axis=0), points.max(axis=0)])


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_links_of_every_format(tmp_path, client, ending):
    box = trimesh.creation.box([0.1, 0.2, 0.3]).apply_translation([0.1, 0.1, 0.4])
    box.export(tmp_path / ("my link" + ending))
    model = RobotModel(urdf(tmp_path, f'<mesh filename="my%20link{ending}" scale="1 -2 1"/>'))
    expected = np.array([[0.05, -0.4, 0.25], [0.15, 0.0, 0.55]])
    assert in_library(model, "l") == pytest.approx(expected, abs=1e-6)
    assert in_pybullet(client, model, "l") == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("up", ["X_UP", "Y_UP", "Z_UP"])
def test_the_unit_of_a_link_counts_but_not_its_vertical(tmp_path, client, up):
    """As other programs that read URDFs have it."""
    (tmp_path / "link.dae").write_text(collada(f'<unit meter="0.1"/><up_axis>{up}</up_axis>'))
    model = RobotModel(urdf(tmp_path, '<mesh filename="link.dae"/>'))
    expected = np.array([[0.0, 0.0, 0.0], [0.02, 0.03, 0.05]])
    assert in_library(model, "l") == pytest.approx(expected, abs=1e-6)
    assert in_pybullet(client, model, "l") == pytest.approx(expected, abs=1e-5)


def boxes(folder: Path, faces: int) -> Path:
    """Two boxes of 0.1 m side, 0.2 m apart, as the groups of an OBJ, of which the first has so many faces."""
    near = trimesh.creation.box([0.1] * 3)
    far = near.copy().apply_translation([0.3, 0, 0])
    lines = [f"v {x} {y} {z}" for x, y, z in (*near.vertices, *far.vertices)]
    for name, triangles in (("near", near.faces[:faces]), ("far", far.faces + len(near.vertices))):
        lines += [f"g {name}", *("f " + " ".join(str(k + 1) for k in triangle) for triangle in triangles)]
    path = folder / "boxes.obj"
    path.write_text("\n".join(lines))
    return urdf(folder, f'<mesh filename="{path.name}"/>')


def distance_from_between(client: int, model: RobotModel) -> float:
    """Distance (m) of a ball of 1 mm, half way between the boxes, from the link."""
    body = load_urdf(client, model, np.eye(4))
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.001, physicsClientId=client)
    ball = pybullet.createMultiBody(0, shape, basePosition=[0.15, 0, 0], physicsClientId=client)
    return min(p[8] for p in pybullet.getClosestPoints(body, ball, 1.0, physicsClientId=client))


def test_closed_groups_of_an_obj_are_hulls_of_their_own(tmp_path, client):
    model = RobotModel(boxes(tmp_path, faces=12))
    assert len(model.hulls("l")) == 2
    assert distance_from_between(client, model) == pytest.approx(0.1 - MARGIN - 0.001, abs=1e-5)


def test_groups_that_are_patches_are_one_hull(tmp_path, client):
    model = RobotModel(boxes(tmp_path, faces=11))
    assert len(model.hulls("l")) == 1
    assert distance_from_between(client, model) < -0.04


def test_a_cylinder_is_not_cut_off(tmp_path, client):
    """PyBullet's own would be a prism inside it."""
    body = load_urdf(client, RobotModel(urdf(tmp_path, '<cylinder radius="1" length="2"/>')), np.eye(4))
    for angle in np.linspace(0, 2 * np.pi, 100):
        at = [2 * np.cos(angle), 2 * np.sin(angle), 0]
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.5, physicsClientId=client)
        ball = pybullet.createMultiBody(0, shape, basePosition=at, physicsClientId=client)
        distance = min(p[8] for p in pybullet.getClosestPoints(body, ball, 1.0, physicsClientId=client))
        assert 0.5 - 5e-3 < distance < 0.5


def chain(folder: Path, kinds: list[str]) -> RobotModel:
    """Balls of 2 cm in a row, joined by joints of these types."""
    lines = []
    for k in range(len(kinds) + 1):
        lines.append(
            f'<link name="l{k}"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>'
        )
    for k, kind in enumerate(kinds):
        lines.append(
            f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/>'
            '<origin xyz="0.05 0.01 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/></joint>'
        )
    path = folder / "chain.urdf"
    path.write_text(f'<robot name="c">{"".join(lines)}</robot>')
    return RobotModel(path)


def test_many_links_are_where_they_should_be(tmp_path, client):
    """More than 128, of which as many move as PyBullet sets."""
    model = chain(tmp_path, ["fixed"] * 100 + ["revolute"] * 128 + ["fixed"] * 20)
    body = load_urdf(client, model, np.eye(4))
    index = {link: k - 1 for k, link in enumerate(link_names(client, body))}
    q = np.random.default_rng(0).uniform(-1, 1, 128)
    moving = [index[model.link_names[j.child]] for j in model.joints if j.source >= 0]
    pybullet.resetJointStatesMultiDof(body, moving, q[:, None].tolist(), physicsClientId=client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.02, physicsClientId=client)
    ball = pybullet.createMultiBody(0, shape, basePosition=[0, 0, 50], physicsClientId=client)
    for link, pose in zip(model.link_names, model.forward(q), strict=True):
        points = pybullet.getClosestPoints(body, ball, 99, index[link], -1, physicsClientId=client)
        assert points[0][8] == pytest.approx(np.linalg.norm(pose[:3, 3] - [0, 0, 50]) - 0.04, abs=1e-9)


def test_more_joints_than_pybullet_sets(tmp_path, client):
    with pytest.raises(UrdfError, match=r"chain\.urdf: joints: 129 that move .* at most 128"):
        load_urdf(client, chain(tmp_path, ["revolute"] * 129), np.eye(4))


def test_links_without_shapes_are_left_out(tmp_path, client):
    """A tool frame, a joint that moves nothing, and a flange between two fixed joints."""
    box = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>"
    lines = [f'<link name="{name}">{inner}</link>' for name, inner in
             {"base": "", "arm": "", "flange": "", "hand": box, "tool": "", "wheel": ""}.items()]  # fmt: skip
    for child, parent, kind, angle in (
        ("arm", "base", "revolute", "0.3 0 0"),
        ("flange", "arm", "fixed", "0 1.5707963267948966 0.2"),
        ("hand", "flange", "fixed", "0.4 0 0.7"),
        ("tool", "hand", "fixed", "0 0 0"),
        ("wheel", "base", "continuous", "0 0 0"),
    ):
        lines.append(
            f'<joint name="{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0.1 0.2 0.3" rpy="{angle}"/>'
            '<axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>'
        )
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(lines)}</robot>')
    model = RobotModel(path)
    body = load_urdf(client, model, np.eye(4))
    assert link_names(client, body) == ["base", "arm", "hand"]
    pybullet.resetJointState(body, 0, 0.8, physicsClientId=client)
    state = pybullet.getLinkState(body, 1, computeForwardKinematics=True, physicsClientId=client)
    pose = model.forward([0.8, 0.0])[model.link_index("hand")]
    assert state[4] == pytest.approx(pose[:3, 3], abs=1e-7)
    turned = np.reshape(pybullet.getMatrixFromQuaternion(state[5]), (3, 3))
    assert turned == pytest.approx(pose[:3, :3], abs=1e-7)


@pytest.mark.parametrize("name", ["franka_panda/panda.urdf", "kuka_iiwa/model.urdf", "pr2_gripper.urdf"])
def test_robots_that_others_made(client, name):
    model = RobotModel(DATA / name)
    for link in model.colliding_links():
        assert in_pybullet(client, model, link) == pytest.approx(in_library(model, link), abs=1e-3)


def test_a_link_is_convex_whatever_its_file_says(tmp_path, client):
    (tmp_path / "link.stl").write_text(stl())
    model = RobotModel(urdf(tmp_path, '<mesh filename="link.stl"/>', ' concave="yes"'))
    assert in_pybullet(client, model, "l") == pytest.approx(np.array([[0, 0, 0], [0.2, 0.3, 0.5]]), abs=1e-5)


def test_line_breaks_do_not_matter(tmp_path, client):
    text = " ".join((DATA / "kuka_iiwa/model.urdf").read_text().split())
    text = text.replace('filename="meshes', f'filename="{DATA}/kuka_iiwa/meshes')
    assert "\n" not in text
    assert len(text) > 8192
    path = tmp_path / "line.urdf"
    path.write_text(text)
    body = load_urdf(client, RobotModel(path), np.eye(4))
    shaped = RobotModel(DATA / "kuka_iiwa/model.urdf").colliding_links()
    assert set(shaped) <= set(link_names(client, body))


@pytest.mark.parametrize("ending", [".obj", ".stl"])
def test_a_mesh_that_is_not_there_yet(tmp_path, client, ending):
    (tmp_path / ("link" + ending)).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    with pytest.raises(MeshError, match="git lfs pull"):
        load_urdf(client, RobotModel(urdf(tmp_path, f'<mesh filename="link{ending}"/>')), np.eye(4))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"solid\nendsolid\n", "no triangles"),
        (trimesh.creation.box([0.2, 0.3, 0.0]).export(file_type="stl"), "a flat surface"),
        (trimesh.creation.box([200.0, 300.0, 100.0]).export(file_type="stl"), "scale 0.001"),
        (trimesh.creation.box([9.0, 1.0, 1.0]).export(file_type="stl"), "at most 8 m"),
        (b"", "empty file"),
    ],
)
def test_meshes_that_no_link_can_have(tmp_path, client, content, said):
    """One line that names the URDF, the link and the mesh."""
    (tmp_path / "mesh.stl").write_bytes(content)
    with pytest.raises((MeshError, UrdfError), match=said) as error:
        load_urdf(client, RobotModel(urdf(tmp_path, '<mesh filename="mesh.stl"/>')), np.eye(4))
    for name in ("robot.urdf", "link l", "mesh.stl"):
        assert name in str(error.value)
    assert "\n" not in str(error.value)


def test_shapes_that_are_not_known(tmp_path):
    for inner in ('<capsule radius="1" length="1"/>', ""):
        with pytest.raises(UrdfError):
            RobotModel(urdf(tmp_path, inner))
