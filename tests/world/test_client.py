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
from symgrasp.world.shapes import link_shapes
from tests.meshes.test_reading import collada, stl

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
    assert len(link_names(client, body)) == len(RobotModel(DATA / "kuka_iiwa/model.urdf").link_names)


@pytest.mark.parametrize("ending", [".obj", ".stl"])
def test_a_mesh_that_is_not_there_yet(tmp_path, client, ending):
    (tmp_path / ("link" + ending)).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    with pytest.raises(MeshError, match="git lfs pull"):
        load_urdf(client, RobotModel(urdf(tmp_path, f'<mesh filename="link{ending}"/>')), np.eye(4))


def test_shapes_that_are_not_known(tmp_path):
    for inner in ('<capsule radius="1" length="1"/>', ""):
        with pytest.raises(UrdfError):
            RobotModel(urdf(tmp_path, inner))
