"""COLLADA and glTF, which place meshes in scenes, are read completely, or refused in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from symgrasp.meshes import read_mesh, read_parts
from symgrasp.meshes.reading import MOST_INSTANCES, MOST_TRIANGLES
from tests.meshes.files import CORNERS, FACES, collada, glb, refused, same_triangles, write

# -- COLLADA ------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.001, 0.0254])
def test_the_unit_of_collada_counts(tmp_path, unit):
    path = write(tmp_path, "wall.dae", collada(f'<unit meter="{unit}"/><up_axis>Z_UP</up_axis>'))
    for upright in (True, False):
        assert read_mesh(path, upright=upright).extents == pytest.approx(unit * np.array([0.2, 0.3, 0.5]))
    assert read_parts(path)[0].extents == pytest.approx(unit * np.array([0.2, 0.3, 0.5]))


@pytest.mark.parametrize(
    ("up", "right", "upwards", "inwards"),
    [("X_UP", -1, 0, 2), ("Y_UP", 0, 1, 2), ("Z_UP", 0, 2, -1), (None, 0, 1, 2)],
)
def test_the_vertical_of_collada_counts(tmp_path, up, right, upwards, inwards):
    """Its specification names the axes that point right, up and towards the viewer: x, z and -y here."""
    asset = f"<up_axis>{up}</up_axis>" if up else ""
    found = read_mesh(write(tmp_path, "wall.dae", collada(asset))).triangles
    seen = CORNERS[FACES]
    signed = lambda axis: -seen[..., 1] if axis == -1 else seen[..., axis]  # noqa: E731
    assert same_triangles(found, np.stack([signed(right), -signed(inwards), signed(upwards)], axis=-1))


def test_polygons_and_placed_meshes_of_collada_are_counted(tmp_path):
    quads = '<polylist count="2">INPUT<vcount>4 3</vcount><p>0 1 2 3 0 1 3</p></polylist>'
    twice = (
        '<node><instance_node url="#n"/></node><node><translate>1 0 0</translate>'
        '<instance_node url="#n"/></node>'
    )
    nodes = '<node id="n"><instance_geometry url="#g"/></node>'
    mesh = read_mesh(write(tmp_path, "wall.dae", collada(scene=twice, faces=quads, nodes=nodes)))
    assert len(mesh.faces) == 6
    assert mesh.extents[0] == pytest.approx(1.2)


def test_nodes_that_double_each_other_are_refused_at_once(tmp_path):
    nodes = "".join(
        f'<node id="n{k}"><instance_node url="#n{k + 1}"/><instance_node url="#n{k + 1}"/></node>'
        for k in range(60)
    )
    nodes += '<node id="n60"><instance_geometry url="#g"/></node>'
    path = write(tmp_path, "wall.dae", collada(scene='<node><instance_node url="#n0"/></node>', nodes=nodes))
    assert str(4 * 2**60) in refused(path)
    circle = '<node id="n"><instance_node url="#n"/></node>'
    text = collada(scene='<node><instance_node url="#n"/></node>', nodes=circle)
    assert "contains itself" in refused(write(tmp_path, "circle.dae", text))


# -- glTF ---------------------------------------------------------------------------------------


def test_every_instance_of_a_mesh_is_read(tmp_path):
    mesh = read_mesh(write(tmp_path, "wall.glb", glb(instances=3)))
    assert len(mesh.faces) == 12
    assert mesh.bounds[:, 0] == pytest.approx([0.0, 2.2])


def test_too_many_instances_are_refused_before_any_is_made(tmp_path, monkeypatch):
    def load_scene(*_: object, **__: object) -> None:
        raise AssertionError("the file was read")

    monkeypatch.setattr(trimesh, "load_scene", load_scene)
    assert "20000" in refused(write(tmp_path, "wall.glb", glb(instances=20_000)))
    assert MOST_INSTANCES < 20_000
    large = {
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * 2_000, "type": "SCALAR"},
        ]
    }
    assert str(2_000 * 2_000) in refused(write(tmp_path, "large.glb", glb(large, instances=2_000)))
    assert MOST_TRIANGLES < 2_000 * 2_000
    soup = b" " * 80 + (MOST_TRIANGLES + 1).to_bytes(4, "little") + bytes(50 * (MOST_TRIANGLES + 1))
    assert "at most" in refused(write(tmp_path, "large.stl", soup))


ATTRIBUTES = {"attributes": {"POSITION": 0}, "indices": 1}

DAMAGED_GLB: dict[str, tuple[dict[str, Any], str]] = {
    "two scenes": ({"scenes": [{"nodes": [0]}, {"nodes": [0]}]}, "2 scenes"),
    "no scene": ({"scenes": []}, "0 scenes"),
    "a mesh that is not placed": ({"scenes": [{"nodes": []}]}, "does not place"),
    "a node in a circle": ({"nodes": [{"mesh": 0, "children": [0]}]}, "contains itself"),
    "a node that is missing": ({"scenes": [{"nodes": [5]}]}, "GLB"),
    "a fan": ({"meshes": [{"primitives": [{**ATTRIBUTES, "mode": 6}]}]}, "0 of its 10"),
    "a camera in its place": ({"nodes": [{"mesh": 0, "camera": 0}], "cameras": [
        {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]}, "0 of its 4"),
    "another file": ({"buffers": [{"byteLength": 96, "uri": "/etc/passwd"}]}, "other files"),
    "compressed": ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression"),
    "a skin": ({"nodes": [{"mesh": 0, "skin": 0}]}, "bent"),
    "morphed": ({"meshes": [{"primitives": [{**ATTRIBUTES, "targets": [{"POSITION": 0}]}]}]}, "bent"),
    "zeros without data": ({"accessors": [
        {"componentType": 5126, "count": 4_000_000_000, "type": "VEC3"}]}, "not in the file"),
    "corners that are none": ({"accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}]}, "corner"),
    "a node twice": ({"nodes": [{"mesh": 0}, {"children": [0]}, {"children": [0]}],
                      "scenes": [{"nodes": [1, 2]}]}, "4 of its 8"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED_GLB)
def test_gltf_that_cannot_be_read_completely_is_refused(tmp_path, name):
    change, words = DAMAGED_GLB[name]
    assert words in refused(write(tmp_path, "wall.glb", glb(change)))
