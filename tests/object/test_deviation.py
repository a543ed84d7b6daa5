"""Which meshes are refused, and how far they are said to deviate, against the shapes they were made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.errors import MeshError
from symgrasp.object.measure.measurement import measure_mesh
from symgrasp.poses import from_position_quat

Outline = np.ndarray
"""Corners (n, 2) of a convex polygon around the origin, counterclockwise."""


def regular(sides: int, r: float, turn: float = 0.0) -> Outline:
    angle = turn + 2 * np.pi * np.arange(sides) / sides
    return r * np.column_stack([np.cos(angle), np.sin(angle)])


def round_(r: float) -> Outline:
    return regular(180, r)


def ellipse(a: float, b: float) -> Outline:
    return round_(1.0) * [a, b]


def flattened(r: float, share: float) -> Outline:
    """A circle that is cut off at this share of its radius on one side: a D."""
    half = np.arccos(share)
    angle = np.linspace(half, 2 * np.pi - half, 240)
    return r * np.column_stack([np.cos(angle), np.sin(angle)])


def prism(outline: Outline, low: float, high: float) -> trimesh.Trimesh:
    """A closed convex prism between two heights."""
    n, k = len(outline), np.arange(len(outline))
    after = (k + 1) % n
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(n, z)]) for z in (low, high)] + [[[0, 0, low], [0, 0, high]]]
    )
    faces = [
        np.column_stack(f)
        for f in (
            [k, after, n + after],
            [k, n + after, n + k],
            [after, k, np.full(n, 2 * n)],
            [n + k, n + after, np.full(n, 2 * n + 1)],
        )
    ]
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)


def radius_at(outline: Outline, angles: np.ndarray) -> np.ndarray:
    """Distances (m,) of the polygon's edge from the origin: the nearest of the lines through its sides."""
    side = np.roll(outline, -1, axis=0) - outline
    normal = np.column_stack([side[:, 1], -side[:, 0]]) / np.linalg.norm(side, axis=1, keepdims=True)
    distance = (normal * outline).sum(axis=1)
    along = normal @ np.array([np.cos(angles), np.sin(angles)])
    with np.errstate(divide="ignore"):
        return np.where(along > 1e-9, distance[:, None] / along, np.inf).min(axis=0)


ALL_ROUND = np.linspace(-np.pi, np.pi, 7201)


def deviation(outline: Outline, r: float) -> float:
    """Largest radial distance of the polygon from a circle."""
    return float(np.abs(radius_at(outline, ALL_ROUND) - r).max())


def save(folder: Path, *prisms: tuple[Outline, float, float], pose: np.ndarray | None = None) -> Path:
    mesh = joined([prism(*p) for p in prisms])
    mesh.apply_transform(np.eye(4) if pose is None else pose)
    path = folder / "object.ply"
    mesh.export(path)
    return path


def joined(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    mesh = trimesh.util.concatenate(parts)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


COLUMN = round_(0.01)
SQUARE = regular(4, 0.05 * 2**0.5)


@pytest.mark.parametrize(
    ("prisms", "true"),
    [
        ([(SQUARE, 0, 0.003)], 0.05 * (2**0.5 - 1)),
        ([(SQUARE, 0, 0.0006)], 0.05 * (2**0.5 - 1)),
        ([(SQUARE, 0, 0.003), (COLUMN, 0.003, 0.15)], 0.05 * (2**0.5 - 1)),
        # The rim of the circle around the square is near to a round plate beside it.
        ([(round_(0.0707), 0, 0.003), (SQUARE, 0.003, 0.006), (COLUMN, 0.006, 0.1)], 0.05 * (2**0.5 - 1)),
        ([(SQUARE, 0, 0.003), (round_(0.06), 0.003, 0.1)], 0.05 * (2**0.5 - 1)),
        ([(COLUMN, 0, 0.1), (regular(6, 0.04), 0.1, 0.102)], 0.04 * (1 - np.cos(np.pi / 6))),
        ([(regular(6, 0.0092), 0, 0.008)], 0.0092 * (1 - np.cos(np.pi / 6))),  # a nut M10
        ([(regular(4, 0.005), 0, 0.2)], 0.005 * (1 - np.cos(np.pi / 4))),  # a stick of 7 x 7 mm
        ([(regular(8, 0.035), 0, 0.15), (round_(0.014), 0.15, 0.2)], 0.035 * (1 - np.cos(np.pi / 8))),
        ([(flattened(0.035, 0.9), 0, 0.15), (round_(0.014), 0.15, 0.2)], 0.0035),
        ([(flattened(0.04, 0.5), 0, 0.004), (COLUMN, 0.004, 0.1)], 0.02),
    ],
    ids=[
        "tile", "sheet", "square foot", "round below, square above", "undercut", "hexagonal top", "nut",
        "square stick", "octagonal bottle", "bottle with a flat side", "D",
    ],
)  # fmt: skip
def test_prisms_are_refused_with_their_true_deviation(tmp_path, prisms, true):
    # The profile runs through the corners of the polygon; the middle of its sides lies inside.
    path = save(tmp_path, *prisms, pose=from_position_quat([0.2, -0.1, 0.3], [0.9, 0.3, -0.2, 0.1]))
    with pytest.raises(MeshError) as caught:
        measure_mesh(path)
    value = float(str(caught.value.value).split(" mm")[0])
    assert value == pytest.approx(-1e3 * true, abs=0.06 + 5e-3 * 1e3 * true)


@given(
    st.sampled_from(["ellipse", "polygon", "D"]),
    st.floats(0.6, 0.98),
    st.integers(3, 24),
    st.floats(0.02, 0.08),
    st.floats(0.001, 0.02),
    st.floats(0.2, 0.9),
)
@settings(max_examples=12, deadline=None, derandomize=True)
def test_deviations_are_those_of_the_shape(tmp_path_factory, kind, share, sides, r, thickness, column):
    outline = {"ellipse": ellipse(r, share * r), "polygon": regular(sides, r), "D": flattened(r, share)}[kind]
    inner = radius_at(outline, ALL_ROUND).min()
    top = thickness + 0.1
    path = save(
        tmp_path_factory.mktemp("shape"),
        (outline, 0.0, thickness),
        (round_(column * inner), thickness, top),
        pose=from_position_quat([0.1, 0.2, 0.3], [1.0, 0.02, 0.03, 0.5]),
    )
    found = measure_mesh(path, tolerance=1.0)
    assert found.points[-1, 0] == pytest.approx(top, abs=1e-5)
    foot = found.heights < thickness
    profile = float(np.interp(thickness / 2, *found.points.T))
    true = deviation(outline, profile)
    assert found.worst[0] == pytest.approx(true, rel=0.01, abs=2e-4)
    assert found.largest[foot].max() == found.largest.max()
    refused = true > max(1.5e-3, 0.03 * r)
    if abs(true - max(1.5e-3, 0.03 * r)) > 2e-4:
        if refused:
            with pytest.raises(MeshError, match="symmetry"):
                measure_mesh(path)
        else:
            measure_mesh(path)


@pytest.mark.parametrize(
    ("sides", "r", "is_round"),
    [
        (3, 0.004, False), (4, 0.003, False), (6, 0.003, False), (7, 0.003, False), (7, 0.015, False),
        (8, 0.003, True), (8, 0.0195, True), (8, 0.02, False), (12, 0.0435, True), (12, 0.045, False),
        (13, 0.05, True), (13, 0.5, True),
    ],
)  # fmt: skip
def test_from_how_many_sides_on_a_polygon_is_a_circle(tmp_path, sides, r, is_round):
    path = save(tmp_path, (regular(sides, r), 0.0, 4 * r))
    if is_round:
        assert measure_mesh(path).points[:, 1] == pytest.approx(r, abs=1e-6)
    else:
        with pytest.raises(MeshError, match="symmetry"):
            measure_mesh(path)


@pytest.mark.parametrize("sides", [8, 16, 64])
def test_facets_are_undone_and_count_as_deviation(tmp_path, sides):
    found = measure_mesh(save(tmp_path, (regular(sides, 0.015), 0.0, 0.1)))
    assert found.points[:, 1] == pytest.approx(0.015, abs=1e-6)
    assert found.worst[0] == pytest.approx(0.015 * (1 - np.cos(np.pi / sides)), rel=0.02)


def test_the_tolerance_that_a_refusal_names_accepts_it(tmp_path):
    path = save(tmp_path, (regular(6, 0.0317), 0.0, 0.1))
    with pytest.raises(MeshError, match=r"to within 1\.5 mm; .* 4\.3 mm .*--tolerance 0\.0043") as caught:
        measure_mesh(path)
    assert "tolerance: 0.0043 in a scene" in str(caught.value)
    found = measure_mesh(path, tolerance=0.0043)
    assert found.tolerance == 0.0043
    with pytest.raises(MeshError):
        measure_mesh(path, tolerance=0.0042)


def test_heights_in_a_refusal_begin_at_the_lowest_point(tmp_path):
    # Two feet reach below what is round.
    feet = [(0.003 * regular(12, 1.0) + [x, 0.0], 0.0, 0.02) for x in (-0.02, 0.02)]
    path = save(tmp_path, *feet, (round_(0.03), 0.02, 0.12))
    with pytest.raises(MeshError) as caught:
        measure_mesh(path)
    height = float(str(caught.value.value).split("height ")[1].split(" m")[0])
    assert 0.0 <= height <= 0.02


def test_an_axial_error_of_a_flat_end_is_no_difference_in_radius(tmp_path):
    mesh = prism(round_(0.03), 0.0, 0.1)
    top = mesh.vertices[:, 2] > 0.05
    mesh.vertices[top, 2] += 0.01 * mesh.vertices[top, 0]  # the top slants by 0.6 mm
    mesh.export(tmp_path / "slanted.ply")
    assert 2e-4 < measure_mesh(tmp_path / "slanted.ply").worst[0] < 3.5e-4


BOTTLE = [(0.033, 0.0), (0.033, 0.15), (0.014, 0.2), (0.014, 0.24)]


def test_an_object_stands_on_its_other_end_when_flipped(tmp_path):
    mesh = trimesh.creation.revolve(np.array([(0, 0), *BOTTLE, (0, 0.24)]), sections=64)
    # A dent of 1 mm at height 4 cm, angle 30°.
    centre = 0.033 * np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0]) + [0, 0, 0.04]
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.006)[:2]
    mesh = trimesh.Trimesh(vertices, faces)
    dent = np.exp(-((np.linalg.norm(mesh.vertices - centre, axis=1) / 0.008) ** 2))
    mesh.vertices[:, :2] *= 1.0 - dent[:, None] / 33
    mesh.apply_transform(from_position_quat([0.5, 0.1, 0.2], [0.3, -0.8, 0.1, 0.4]))
    path = tmp_path / "bottle.ply"
    mesh.export(path)
    found, flipped = measure_mesh(path), measure_mesh(path, flip=True)
    assert flipped.points[::-1] * [-1, 1] + [found.points[-1, 0], 0] == pytest.approx(found.points, abs=1e-12)
    assert flipped.heights.min() > 0
    assert (np.diff(flipped.heights) > 0).all()
    assert (np.diff(flipped.angles) > 0).all()
    for m in (found, flipped):
        # The frame puts the mesh's own vertices on the profile, and the dent where the map says.
        local = trimesh.transform_points(mesh.vertices, np.linalg.inv(m.T_mesh_object))
        beside_ends = np.abs(local[:, 2] - m.points[-1, 0] / 2) < m.points[-1, 0] / 2 - 1e-3
        wall = beside_ends & (np.hypot(local[:, 0], local[:, 1]) > 0.0135)
        h = np.clip(local[wall, 2], 0, m.points[-1, 0])
        depth = np.interp(h, *m.points.T) - np.hypot(*local[wall, :2].T)
        assert np.abs(depth).max() < 1.2e-3
        x, y, z = local[wall][np.argmax(depth)]
        largest, height, angle = m.worst
        assert largest == pytest.approx(1e-3, abs=3e-4)
        assert height == pytest.approx(z, abs=5e-3)
        assert angle == pytest.approx(np.arctan2(y, x), abs=0.1)
    again = flipped.flipped()
    assert again.T_mesh_object == pytest.approx(found.T_mesh_object, abs=1e-12)
    assert np.array_equal(again.deviation, found.deviation)
    with pytest.raises(ValueError, match="read-only"):
        flipped.points[0] = 0.0


def repeated(mesh: trimesh.Trimesh, kind: str) -> trimesh.Trimesh:
    """The mesh with faces written more than once."""
    f = mesh.faces
    more = {
        "doubled": [f],
        "two-sided": [f[:, ::-1]],
        "three times": [f, f[:, ::-1]],
        "some doubled": [np.roll(f[::3], 1, axis=1)],
        "some two-sided": [f[: len(f) // 2, ::-1]],
    }[kind]
    faces = np.concatenate([f, *more])
    rng = np.random.default_rng(0)
    return trimesh.Trimesh(mesh.vertices, faces[rng.permutation(len(faces))], process=False)


KINDS = ["doubled", "two-sided", "three times", "some doubled", "some two-sided"]
CUP = [(0, 0), (0.03, 0), (0.04, 0.12), (0.0375, 0.12), (0.028, 0.008), (0, 0.008)]


@pytest.mark.parametrize("ending", [".stl", ".ply"])
def test_repeated_faces_count_once(tmp_path, ending):
    mesh = trimesh.creation.revolve(np.array(CUP, dtype=float), sections=80)
    mesh.export(tmp_path / ("cup" + ending))
    once = measure_mesh(tmp_path / ("cup" + ending))
    for kind in KINDS:
        repeated(mesh, kind).export(tmp_path / (kind + ending))
        more = measure_mesh(tmp_path / (kind + ending))
        assert more.points == pytest.approx(once.points, abs=1e-9), kind
        assert more.worst == pytest.approx(once.worst, abs=1e-9), kind
        assert more.T_mesh_object == pytest.approx(once.T_mesh_object, abs=1e-9), kind


@pytest.mark.parametrize("noise", [1e-8, 1e-7, 1e-6])
def test_nearly_repeated_faces_are_one_body(tmp_path, noise):
    # Some of their vertices are merged and some are not, so edges have two, three or four faces.
    mesh = trimesh.creation.revolve(np.array(CUP, dtype=float), sections=300)
    second = mesh.copy()
    second.vertices += noise * np.random.default_rng(1).standard_normal(mesh.vertices.shape)
    joined([mesh, second]).export(tmp_path / "cup.ply")
    mesh.export(tmp_path / "once.ply")
    found, once = measure_mesh(tmp_path / "cup.ply"), measure_mesh(tmp_path / "once.ply")
    h = np.linspace(1e-4, 0.1199, 500)
    assert np.interp(h, *found.points.T) == pytest.approx(np.interp(h, *once.points.T), abs=1e-5)
    assert found.worst[0] < 1e-4


def test_a_body_with_an_inner_wall_keeps_both_sides(tmp_path):
    # A cup is told from a full glass by its inside: it stands on the closed end though the mouth is wider.
    mesh = trimesh.creation.revolve(np.array(CUP, dtype=float), sections=80)
    turned = repeated(mesh, "two-sided").apply_transform(
        trimesh.transformations.rotation_matrix(np.deg2rad(120), [1, 0, 0])
    )
    turned.export(tmp_path / "cup.stl")
    found = measure_mesh(tmp_path / "cup.stl")
    assert found.points[0, 1] == pytest.approx(0.03, abs=1e-5)
    assert found.points[-1, 1] == pytest.approx(0.04, abs=1e-5)


def test_a_wall_that_two_bodies_share_does_not_take_them_apart(tmp_path):
    # Every edge of the ring where the lid meets the can belongs to three faces.
    can = trimesh.creation.revolve(np.array([(0, 0), (0.03, 0), (0.03, 0.1), (0, 0.1)]), sections=400)
    neck = trimesh.creation.revolve(np.array([(0.03, 0.1), (0.02, 0.12), (0, 0.12)]), sections=400)
    joined([can, neck]).export(tmp_path / "can.stl")
    assert measure_mesh(tmp_path / "can.stl").points == pytest.approx(
        np.array([[0, 0.03], [0.1, 0.03], [0.12, 0.02]]), abs=1e-5
    )
