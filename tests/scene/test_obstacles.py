"""A mesh is the same obstacle whichever way it comes into a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from symgrasp.errors import MeshError, SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.poses import from_position_rpy
from symgrasp.scene import building
from symgrasp.scene.format import PoseFile
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, BulletWorld
from tests.conftest import write_scene
from tests.engine.identity import assert_same, assert_true
from tests.meshes.files import collada


def crate() -> trimesh.Trimesh:
    """A crate without a lid, of a bottom and four walls, that the bottle stands in."""
    walls = [trimesh.creation.box([0.3, 0.3, 0.01]).apply_translation([0, 0, -0.005])]
    for x, y in ((0.145, 0), (-0.145, 0), (0, 0.145), (0, -0.145)):
        size = [0.01 if x else 0.3, 0.01 if y else 0.3, 0.12]
        walls.append(trimesh.creation.box(size).apply_translation([x, y, 0.06]))
    mesh = trimesh.util.concatenate(walls)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def link(name: str, shape: str, origin: str = "") -> str:
    collision = f'<collision concave="yes">{origin}<geometry>{shape}</geometry></collision>'
    return f'<link name="{name}">{collision}</link>'


def mesh(name: str, attributes: str = "") -> str:
    return f'<mesh filename="{name}" {attributes}/>'


@pytest.fixture
def small(content: dict[str, Any]) -> dict[str, Any]:
    """A bottle before a Panda, without obstacles, on a small grid."""
    content["tasks"] = [{"name": "pick", "pose": {"position": [0.5, 0, 0.002]}}]
    content["map"] = {"heights": 5, "angles": 10, "redundancy": 6}
    return content


def map_with(content: dict[str, Any], folder: Path, **obstacle: Any) -> np.ndarray:
    """The feasible cells with one obstacle, where engine and reference agree on them."""
    content["obstacles"] = [{"name": "thing", "pose": {"position": [0.5, 0, 0]}, **obstacle}]
    scene = Scene.load(write_scene(folder, content))
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        exact = maker.map()
        assert_same(exact, maker.map(method="reference"))
        assert_true(world, scene, scene.arm(), exact)
    return exact.feasible


def test_a_crate_is_hollow_as_a_mesh_and_in_a_urdf(small, tmp_path):
    crate().export(tmp_path / "crate.stl")
    crate().copy().apply_scale(1000).export(tmp_path / "crate_mm.obj")
    (tmp_path / "crate.urdf").write_text(f'<robot name="c">{link("c", mesh("crate.stl"))}</robot>')
    scaled = mesh("crate_mm.obj", 'scale="0.001 0.001 0.001"')
    (tmp_path / "crate_mm.urdf").write_text(f'<robot name="c">{link("c", scaled)}</robot>')
    as_mesh = map_with(small, tmp_path, mesh="crate.stl")
    assert as_mesh.any()
    assert not as_mesh.all()
    assert np.array_equal(map_with(small, tmp_path, mesh="crate_mm.obj", scale=0.001), as_mesh)
    assert np.array_equal(map_with(small, tmp_path, urdf="crate.urdf"), as_mesh)
    assert np.array_equal(map_with(small, tmp_path, urdf="crate_mm.urdf"), as_mesh)


def test_the_shapes_of_a_urdf_are_exact(small, tmp_path):
    """A box, a cylinder and a ball on links behind joints, against the same ones as single obstacles."""
    shapes = {
        "a": ('<box size="0.1 0.4 0.2"/>', {"box": [0.1, 0.4, 0.2]}),
        "b": ('<cylinder radius="0.05" length="0.3"/>', {"cylinder": {"radius": 0.05, "height": 0.3}}),
        "c": ('<sphere radius="0.06"/>', {"sphere": {"radius": 0.06}}),
    }
    joints = {  # from the root: pose, type, motion at the default value
        "a": ("0.25 0 0.1", "0 0 0.3", "fixed", from_position_rpy([0, 0, 0], [0, 0, 0])),
        "b": ("0 -0.25 0.1", "0.5 0 0", "prismatic", from_position_rpy([0, 0, 0.02], [0, 0, 0])),
        "c": ("0 0.2 0.1", "0 0.2 0", "revolute", from_position_rpy([0, 0, 0], [0, 0, 0.1])),
    }
    text, own = '<link name="root"/>', []
    base = from_position_rpy([0.5, 0, 0], [0, 0, 0])
    for name, (shape, key) in shapes.items():
        xyz, rpy, kind, motion = joints[name]
        limit = {"prismatic": "0.02", "revolute": "0.1"}.get(kind, "0")
        text += link(name, shape, '<origin xyz="0 0 0.01" rpy="0 0 0.2"/>')
        text += (
            f'<joint name="j{name}" type="{kind}"><parent link="root"/><child link="{name}"/>'
            f'<axis xyz="0 0 1"/><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<limit lower="{limit}" upper="1" effort="1" velocity="1"/></joint>'
        )
        joint = from_position_rpy([float(v) for v in xyz.split()], [float(v) for v in rpy.split()])
        pose = base @ joint @ motion @ from_position_rpy([0, 0, 0.01], [0, 0, 0.2])
        own.append((key, pose))
    (tmp_path / "things.urdf").write_text(f'<robot name="things">{text}</robot>')
    found = map_with(small, tmp_path, urdf="things.urdf")
    assert found.any()
    assert not found.all()
    small["obstacles"] = [
        {"name": f"o{k}", **key, "pose": PoseFile.of(pose).model_dump(exclude_none=True)}
        for k, (key, pose) in enumerate(own)
    ]
    scene = Scene.from_content(small)
    with BulletWorld(scene) as world:
        assert np.array_equal(MapMaker(world).map().feasible, found)


def test_the_object_inside_a_closed_mesh_of_a_urdf(small, tmp_path):
    trimesh.creation.box([0.5, 0.5, 0.9]).export(tmp_path / "solid.stl")
    (tmp_path / "solid.urdf").write_text(f'<robot name="c">{link("body", mesh("solid.stl"))}</robot>')
    small["obstacles"] = [{"name": "thing", "urdf": "solid.urdf", "pose": {"position": [0.5, 0, 0]}}]
    with BulletWorld(Scene.load(write_scene(tmp_path, small))) as world:
        assert [c.b for c in world.object_contacts()] == [BodyName("thing", "body")]


def test_an_obstacle_stands_upright(small, tmp_path):
    (tmp_path / "wall.dae").write_text(collada('<unit meter="0.01"/><up_axis>Y_UP</up_axis>'))
    small["obstacles"] = [{"name": "thing", "mesh": "wall.dae", "scale": 10}]
    ((_, shape),) = Scene.load(write_scene(tmp_path, small)).obstacles[0].shapes()
    assert shape.mesh("thing").bounds == pytest.approx(np.array([[0, -0.05, 0], [0.02, 0, 0.03]]))


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_obstacles_of_implausible_sizes_are_refused(small, tmp_path, factor):
    crate().apply_scale(factor).export(tmp_path / "crate.stl")
    small["obstacles"] = [{"name": "thing", "mesh": "crate.stl"}]
    scene = Scene.load(write_scene(tmp_path, small))
    said = r"scene\.yaml: obstacles\[0\]\.mesh: crate\.stl: mesh: .*"
    with pytest.raises(MeshError, match=said + rf"scale {1 / factor:g} would make it 0\.3 m"):
        BulletWorld(scene)


def shelf(mesh_name: str) -> str:
    """A URDF with one board."""
    return f"<robot name='shelf'>{link('board', mesh(mesh_name))}</robot>"


@pytest.mark.parametrize(
    ("entry", "where"),
    [
        ({"mesh": "bad.stl"}, r"obstacles\[1\]\.mesh: bad\.stl: mesh: .*expected a complete STL file"),
        (
            {"urdf": "shelf.urdf"},
            r"obstacles\[1\]\.urdf: bad\.stl: link board: .*expected a complete STL file",
        ),
        ({"mesh": "fine.stl"}, r"obstacles\[1\]\.mesh: fine\.stl: mesh: .*expected at most \d+ between"),
    ],
)
def test_an_unusable_mesh_names_the_scene_and_its_field(small, tmp_path, entry, where):
    (tmp_path / "bad.stl").write_text("no mesh")
    (tmp_path / "shelf.urdf").write_text(shelf("bad.stl"))
    trimesh.creation.icosphere(subdivisions=6).export(tmp_path / "fine.stl")
    box = {"name": "box", "box": [0.1, 0.1, 0.1], "pose": {"position": [2, 2, 0]}}
    small["obstacles"] = [box, {"name": "thing", **entry}]
    scene = Scene.load(write_scene(tmp_path, small))
    with pytest.raises(MeshError, match=rf"scene\.yaml: {where}"):
        BulletWorld(scene)


def test_a_mesh_that_cannot_be_read_names_the_scene_and_its_field(small, tmp_path, monkeypatch):
    def refuse(_: Path) -> str:
        raise PermissionError(13, "Permission denied")

    crate().export(tmp_path / "crate.stl")
    small["obstacles"] = [{"name": "thing", "mesh": "crate.stl"}]
    monkeypatch.setattr(building, "file_sha256", refuse)
    with pytest.raises(SceneError, match=r"scene\.yaml: obstacles\[0\]\.mesh: 'Permission denied'"):
        Scene.load(write_scene(tmp_path, small))


def test_a_scale_belongs_to_a_mesh(small, tmp_path):
    small["obstacles"] = [{"name": "thing", "box": [1, 1, 1], "scale": 0.001}]
    with pytest.raises(SceneError, match="a scale only of a mesh"):
        Scene.from_content(small)
    crate().export(tmp_path / "crate.stl")
    small["obstacles"] = [{"name": "thing", "mesh": "crate.stl"}]
    plain = Scene.load(write_scene(tmp_path, small))
    assert "scale" not in plain.content["obstacles"][0]
    small["obstacles"][0]["scale"] = 2.0
    assert Scene.load(write_scene(tmp_path, small)).map_sha256 != plain.map_sha256
