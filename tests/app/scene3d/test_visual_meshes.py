"""What robots look like."""

from __future__ import annotations

import io
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh

from app.scene3d import visual_meshes
from app.scene3d.visual_meshes import MAX_TRIANGLES, link_visuals
from symgrasp import caching
from symgrasp.errors import SymgraspError
from symgrasp.meshes import reading
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene

URDF = """<robot name="r"><material name="blue"><color rgba="0 0 1 1"/></material>
<link name="base"><visual><origin xyz="0 0 0.5"/><geometry>{shape}</geometry>{material}</visual></link>
</robot>"""


def urdf(folder: Path, shape: str, material: str = '<material name="blue"/>') -> bytes:
    path = folder / "robot.urdf"
    path.write_text(URDF.format(shape=shape, material=material))
    return RobotModel(path).urdf


def loaded(glb: bytes) -> trimesh.Scene:
    return trimesh.load_scene(io.BytesIO(glb), file_type="glb")


def test_every_link_of_the_panda_is_seen_and_its_size_is_right():
    model = Scene.load("bottle_on_table").arm().robot.model
    visuals = link_visuals(model.urdf)
    assert set(visuals) >= {f"panda_link{k}" for k in range(8)} | {"panda_hand", "panda_leftfinger"}
    for link in visuals:
        seen, solid = loaded(visuals[link]).bounds, np.concatenate(model.hulls(link))
        assert np.allclose(seen[0], solid.min(axis=0), atol=0.02)
        assert np.allclose(seen[1], solid.max(axis=0), atol=0.02)


def test_a_hand_that_is_mounted_on_a_robot_is_seen():
    arm = Scene.load("log_iiwa_and_panda").arm("iiwa")
    visuals = link_visuals(arm.robot.model.urdf)
    assert set(arm.hand.links) <= set(visuals)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ('<box size="0.1 0.2 0.3"/>', (0.1, 0.2, 0.3)),
        ('<cylinder radius="0.1" length="0.5"/>', (0.2, 0.2, 0.5)),
        ('<sphere radius="0.1"/>', (0.2, 0.2, 0.2)),
    ],
)
def test_plain_shapes_have_their_size_place_and_colour(tmp_path, shape, size):
    scene = loaded(link_visuals(urdf(tmp_path, shape))["base"])
    assert scene.extents == pytest.approx(size, abs=0.005)
    assert scene.bounds.mean(axis=0) == pytest.approx([0, 0, 0.5], abs=0.005)
    (mesh,) = scene.geometry.values()
    assert mesh.visual.material.baseColorFactor[:3].tolist() == [0, 0, 235]


def two_coloured(folder: Path, names: tuple[str, ...]) -> None:
    faces = "".join(f"usemtl {n}\nf 1 2 {k + 3}\n" for k, n in enumerate(names))
    (folder / "m.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + faces)
    (folder / "m.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl black\nKd 0 0 0\n")


def test_a_mesh_of_one_colour_takes_the_colour_of_the_urdf(tmp_path):
    two_coloured(tmp_path, ("red",))
    scene = loaded(link_visuals(urdf(tmp_path, '<mesh filename="m.obj"/>'))["base"])
    (mesh,) = scene.geometry.values()
    assert mesh.visual.material.baseColorFactor[:3].tolist() == [0, 0, 235]


def test_a_mesh_of_several_colours_keeps_them(tmp_path):
    two_coloured(tmp_path, ("red", "black"))
    scene = loaded(link_visuals(urdf(tmp_path, '<mesh filename="m.obj"/>'))["base"])
    colors = {tuple(m.visual.material.baseColorFactor[:3].tolist()) for m in scene.geometry.values()}
    assert colors == {(235, 0, 0), (0, 0, 0)}


def test_a_mesh_that_cannot_be_read_is_an_error(tmp_path):
    (tmp_path / "m.obj").write_text("this is no mesh")
    with pytest.raises(SymgraspError, match=r"m\.obj.*link base"):
        link_visuals(urdf(tmp_path, '<mesh filename="m.obj"/>'))


def test_a_fine_mesh_is_shown_with_fewer_triangles_in_the_same_place(tmp_path):
    fine = trimesh.creation.torus(0.1, 0.03, major_sections=200, minor_sections=100)
    fine.export(tmp_path / "m.stl")  # every triangle with vertices of its own
    seen = loaded(link_visuals(urdf(tmp_path, '<mesh filename="m.stl"/>'))["base"]).to_mesh()
    assert len(fine.faces) > 10 * MAX_TRIANGLES
    assert 0.9 * MAX_TRIANGLES < len(seen.faces) <= MAX_TRIANGLES
    points = trimesh.sample.sample_surface(fine, 2000, seed=1)[0]
    _, distance, _ = trimesh.proximity.closest_point(seen, points + np.array([0.0, 0.0, 0.5]))
    assert distance.max() < 0.001


def test_a_small_fine_mesh_keeps_its_shape_too(tmp_path):
    """What is lost is a share of the size, whatever that is."""
    fine = trimesh.creation.torus(0.01, 0.003, major_sections=200, minor_sections=100)
    fine.export(tmp_path / "m.stl")
    seen = loaded(link_visuals(urdf(tmp_path, '<mesh filename="m.stl"/>'))["base"]).to_mesh()
    points = trimesh.sample.sample_surface(fine, 2000, seed=1)[0] + np.array([0.0, 0.0, 0.5])
    seen.apply_scale(10.0)  # trimesh is less exact at triangles as small as these
    _, distance, _ = trimesh.proximity.closest_point(seen, 10.0 * points)
    assert distance.max() < 0.001


def test_a_mesh_is_simplified_once(tmp_path, monkeypatch):
    monkeypatch.setattr(caching, "_folder", lambda: tmp_path / "kept")
    trimesh.creation.icosphere(subdivisions=5).export(tmp_path / "ball.stl")
    mesh = '<mesh filename="ball.stl"/>'
    first = link_visuals(urdf(tmp_path, mesh))
    with monkeypatch.context() as none:
        none.setattr(trimesh.Trimesh, "simplify_quadric_decimation", None)
        assert link_visuals(urdf(tmp_path, f"{mesh} ")) == first
    trimesh.creation.icosphere(subdivisions=5, radius=2.0).export(tmp_path / "ball.stl")
    other = loaded(link_visuals(urdf(tmp_path, f" {mesh}"))["base"])
    assert other.extents == pytest.approx([4.0] * 3, abs=0.02)


def test_one_may_cancel_between_the_steps_of_every_mesh(tmp_path, monkeypatch):
    trimesh.creation.icosphere(subdivisions=5).export(tmp_path / "ball.stl")
    events: list[str] = []
    parts = [(reading, "_declared"), (trimesh, "load_scene")]
    parts += [(visual_meshes, name) for name in ("_simplified", "export_glb")]
    for module, name in parts:
        step = getattr(module, name)

        def noting(
            *arguments: object, name: str = name, step: Callable[..., object] = step, **options: object
        ) -> object:
            events.append(name)
            return step(*arguments, **options)

        monkeypatch.setattr(module, name, noting)
    link_visuals(urdf(tmp_path, '<mesh filename="ball.stl"/>'), lambda _: events.append("told"))
    assert [event for event in events if event != "told"] == [name for _, name in parts]
    assert all("told" in pair for pair in pairwise(events))
