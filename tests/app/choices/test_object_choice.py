"""Objects for the page: the library's and uploaded meshes."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from app.choices import object_choice as module
from app.choices.object_choice import OWN, UNITS, from_library, from_mesh, object_options
from symgrasp.errors import SymgraspError
from symgrasp.object.library import library_objects, load_object

BOTTLE = load_object("wine_bottle")[1]


def stl(scale: float = 1.0) -> bytes:
    mesh = BOTTLE.mesh(64)
    mesh.apply_scale(scale)
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


@pytest.fixture
def scratch(tmp_path, monkeypatch) -> Path:
    """Where temporary files go."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("unit", UNITS)
def test_a_mesh_is_measured_in_its_unit_and_leaves_no_file(unit, scratch):
    choice = from_mesh("my bottle.STL", stl(1 / UNITS[unit]), UNITS[unit])
    assert (choice.name, choice.option) == ("my bottle", "my bottle.STL (upload)")
    h = np.linspace(0.01, BOTTLE.h_max - 0.01, 50)
    assert np.allclose(choice.profile.radius(h), BOTTLE.radius(h), atol=4e-4)
    assert choice.measurement is not None
    assert choice.measurement.source == "my bottle.STL"
    assert list(scratch.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "content", "line"),
    [
        ("a.stl", stl(1000), r"^a\.stl: size: 300 m: expected .*; choose the unit of the mesh$"),
        ("a.step", stl(), r"^a\.step: ending: '\.step': expected one of .*'\.stl'"),
        ("a.ply", stl(), r"^a\.ply: content: 'STL data': expected a complete PLY file"),
        ("a.stl", b"", r"^a\.stl: content: 'empty file'"),
        ("../../a.obj", b"mtllib /etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "flat sheet"),
    ],
)
def test_a_mesh_that_is_unusable_is_refused_in_a_line_that_names_it(name, content, line, scratch):
    with pytest.raises(SymgraspError, match=line) as caught:
        from_mesh(name, content, 1.0)
    assert str(scratch) not in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert list(scratch.iterdir()) == []


def test_a_mug_is_refused_at_its_handle():
    mug = Path(pybullet_data.getDataPath(), "objects", "mug.obj").read_bytes()
    with pytest.raises(SymgraspError, match=r"^mug\.obj: symmetry: .*mm at height"):
        from_mesh("mug.obj", mug, 1.0)


def test_a_tolerance_accepts_what_the_refusal_says():
    oval = BOTTLE.mesh(64)
    oval.vertices[:, 0] *= 1.2
    content = oval.export(file_type="stl")
    assert isinstance(content, bytes)
    with pytest.raises(
        SymgraspError, match=r"to within 1\.5 mm; a tolerance of [\d.]+ mm would accept it; choose it$"
    ) as caught:
        from_mesh("oval.stl", content, 1.0)
    assert "--" not in str(caught.value)
    needed = float(str(caught.value).split("a tolerance of ")[1].split()[0])
    measurement = from_mesh("oval.stl", content, 1.0, needed / 1e3).measurement
    assert measurement is not None
    assert measurement.tolerance == pytest.approx(needed / 1e3)


def test_a_measured_object_can_stand_on_its_other_end():
    choice = from_mesh("b.stl", stl(), 1.0)
    flipped = choice.flipped()
    h = np.linspace(0, choice.profile.h_max, 50)
    assert flipped.profile.radius(choice.profile.h_max - h) == pytest.approx(choice.profile.radius(h))
    assert (flipped.name, flipped.option) == (choice.name, choice.option)
    assert flipped.measurement is not None
    assert flipped.profile.T_mesh_object is flipped.measurement.T_mesh_object
    assert from_library("tennis_ball").flipped().measurement is None


def test_a_file_over_the_limit_is_refused_before_it_is_looked_at(monkeypatch):
    monkeypatch.setattr(module, "measure_mesh", None)
    monkeypatch.setattr(module, "UPLOAD_LIMIT", 1_000_000)
    with pytest.raises(SymgraspError, match=r"^a\.stl: .*1\.0 MB: expected a mesh file of at most 1 MB"):
        from_mesh("a.stl", bytes(1_000_001), 1.0)


def test_the_library_is_offered_and_nothing_else_is_loaded():
    assert object_options() == (OWN, *library_objects())
    uploaded = from_mesh("b.stl", stl(), 1.0)
    assert object_options(uploaded)[-1] == "b.stl (upload)"
    choice = from_library("tennis_ball")
    assert np.array_equal(choice.profile.points, load_object("tennis_ball")[1].points)
    for name in ("no_such", "static_scenes/objects/tennis_ball.yaml", "/etc/passwd"):
        with pytest.raises(SymgraspError, match="tennis_ball"):
            from_library(name)
