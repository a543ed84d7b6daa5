"""Meshes that are not of revolution, and files that cannot be read."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from symgrasp.errors import MeshError
from symgrasp.object.measure.measurement import measure_mesh
from symgrasp.object.measure.mesh_io import read_single_object
from tests.object.known_shapes import MUG, joined, random_pose, save


@pytest.mark.parametrize("axis", [None, 3, 11])
def test_the_mug_is_refused_at_its_handle(tmp_path, axis):
    path = MUG
    if axis is not None:
        mesh = trimesh.load_mesh(MUG, process=False)
        mesh.apply_transform(random_pose(np.random.default_rng(axis)))
        path = save(tmp_path, mesh, "mug.stl")
    with pytest.raises(MeshError) as caught:
        measure_mesh(path)
    assert caught.value.field == "symmetry"
    # The handle spans 17 to 83 mm and reaches 40 mm out; the file has it along +y.
    value = str(caught.value.value)
    assert value.startswith("+39.")
    height, angle = value.split("height ")[1].split(" m, angle ")
    assert 0.017 < float(height) < 0.083
    if axis is None:
        assert 80 < float(angle.rstrip("°")) < 100
    # Whoever insists gets the mug without its handle, and the handle on the map.
    found = measure_mesh(path, tolerance=0.05)
    assert found.points[:, 1].max() == pytest.approx(0.041, abs=3e-4)
    assert found.worst[0] == pytest.approx(0.0397, abs=2e-4)


def test_tolerance_grows_with_the_object(tmp_path):
    squeezed = np.diag([1.05, 1.0, 1.0, 1.0])
    small = trimesh.creation.cylinder(0.03, 0.1, sections=64).apply_transform(squeezed)
    large = trimesh.creation.cylinder(0.3, 0.6, sections=64).apply_transform(squeezed)
    assert measure_mesh(save(tmp_path, small)).tolerance == 1.5e-3
    found = measure_mesh(save(tmp_path, large))
    assert found.tolerance == pytest.approx(0.03 * found.points[:, 1].max())
    assert 5e-3 < found.worst[0] < found.tolerance
    with pytest.raises(MeshError, match="symmetry"):
        measure_mesh(save(tmp_path, small), tolerance=5e-4)


def knob(offset: float) -> trimesh.Trimesh:
    top = trimesh.creation.cylinder(0.006, 0.02, sections=24)
    top.apply_translation([offset, 0, 0.055])
    return joined([trimesh.creation.cylinder(0.03, 0.1, sections=48), top])


def slanted() -> trimesh.Trimesh:
    mesh = trimesh.creation.cylinder(0.03, 0.3, sections=48)
    upper = mesh.vertices[:, 2] > 0
    mesh.vertices[upper, 2] += 0.5 * mesh.vertices[upper, 0]
    return mesh


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box([0.05, 0.05, 0.1]),
        trimesh.creation.cylinder(0.03, 0.1, sections=6),
        knob(0.02),
        slanted(),
    ],
    ids=["box", "hexagon", "knob beside the axis", "slanted end"],
)
def test_what_is_not_of_revolution_is_refused(tmp_path, mesh):
    with pytest.raises(MeshError) as caught:
        measure_mesh(save(tmp_path, mesh))
    assert caught.value.field == "symmetry"


def test_a_knob_on_the_axis_is_part_of_the_object(tmp_path):
    found = measure_mesh(save(tmp_path, knob(0.0)))
    assert found.points[-1] == pytest.approx([0.115, 0.006], abs=2e-5)


def refused(path: Path, field: str, **options: Any) -> str:
    with pytest.raises(MeshError) as caught:
        measure_mesh(path, **options)
    assert caught.value.field == field
    text = str(caught.value)
    assert "\n" not in text
    assert path.name in text
    return text


CAN = trimesh.creation.cylinder(0.033, 0.115, sections=32)


def test_millimetres_are_refused_with_the_remedy(tmp_path):
    path = save(tmp_path, CAN.copy().apply_scale(2000), "can.stl")
    text = refused(path, "size")
    assert "230 m" in text
    assert "; scale 0.001 would make it" in text
    tiny = save(tmp_path, CAN.copy().apply_scale(1e-3), "tiny.stl")
    assert "; scale 1000 would make it" in refused(tiny, "size")


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_scales(tmp_path, scale):
    refused(save(tmp_path, CAN), "scale", scale=scale)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan")])
def test_bad_tolerances(tmp_path, tolerance):
    refused(save(tmp_path, CAN), "tolerance", tolerance=tolerance)


@pytest.mark.parametrize("offset", [[0.1, 0, 0], [0.05, 0.05, 0.01], [0, 0, 0.2], [0, 0.0665, 0]])
def test_bodies_apart_are_refused(tmp_path, offset):
    pair = joined([CAN, CAN.copy().apply_translation(offset)])
    assert "2" in refused(save(tmp_path, pair), "bodies")


def test_parts_that_touch_or_enclose_are_one_body(tmp_path):
    inside = trimesh.creation.cylinder(0.02, 0.1, sections=32)
    stacked = trimesh.creation.cylinder(0.02, 0.05, sections=32).apply_translation([0, 0, 0.0825])
    # Touches the body only by way of the one below it.
    higher = trimesh.creation.cylinder(0.025, 0.05, sections=32).apply_translation([0, 0, 0.1325])
    found = measure_mesh(save(tmp_path, joined([CAN, inside, stacked, higher])))
    assert found.points[-1] == pytest.approx([0.215, 0.025], abs=2e-5)


def test_open_meshes_are_refused(tmp_path):
    half = CAN.copy()
    half = half.subdivide().subdivide().subdivide()
    half.update_faces(half.triangles_center[:, 0] > 0)
    assert "open" in refused(save(tmp_path, half), "surface")
    sheet = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]])
    refused(save(tmp_path, sheet), "surface")
    point = trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False)
    refused(save(tmp_path, point, "point.obj"), "surface")


def test_empty_and_broken_files_are_refused(tmp_path):
    only_points = tmp_path / "points.obj"
    only_points.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    refused(only_points, "content")
    missing_vertex = tmp_path / "index.obj"
    missing_vertex.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    refused(missing_vertex, "content")
    for ending in ("stl", "obj", "ply", "off", "glb"):
        whole = save(tmp_path, CAN, "whole." + ending).read_bytes()
        for name, content in [
            ("empty", b""),
            ("text", b"no mesh at all\n" * 9),
            ("half", whole[: len(whole) // 2]),
        ]:
            path = tmp_path / f"{name}.{ending}"
            path.write_bytes(content)
            refused(path, "content")


def test_content_must_be_what_the_ending_says(tmp_path):
    endings = ("stl", "obj", "ply", "off", "glb")
    for said, is_ in zip(endings, endings[1:] + endings[:1], strict=True):
        path = tmp_path / f"wrong.{said}"
        path.write_bytes(save(tmp_path, CAN, "right." + is_).read_bytes())
        assert is_.upper() in refused(path, "content")


def test_missing_files_and_unknown_endings(tmp_path):
    refused(tmp_path / "none.stl", "file")
    (tmp_path / "folder.stl").mkdir()
    refused(tmp_path / "folder.stl", "file")
    assert ".glb" in refused(tmp_path / "can.step", "ending")


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    content = bytearray(save(tmp_path, CAN, "nan.stl").read_bytes())
    content[84 + 12 : 84 + 16] = struct.pack("<f", float("nan"))
    (tmp_path / "nan.stl").write_bytes(content)
    assert "finite" in refused(tmp_path / "nan.stl", "content")
    lines = save(tmp_path, CAN, "nan.obj").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("v "))
    lines[first] = "v nan 0 0"
    (tmp_path / "nan.obj").write_text("\n".join(lines))
    assert "finite" in refused(tmp_path / "nan.obj", "content")


def test_ascii_stl_is_read(tmp_path):
    path = tmp_path / "can.stl"
    path.write_text(CAN.export(file_type="stl_ascii"))
    assert len(read_single_object(path).faces) == len(CAN.faces)
