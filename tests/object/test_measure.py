"""Measured profiles against those that meshes are made of."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.errors import MeshError
from symgrasp.object.measure.measurement import SIMPLIFY_TOLERANCE, Measurement, measure_mesh
from symgrasp.object.measure.meridian import column_angles, cut, envelope
from symgrasp.object.measure.outline import distance_outside, simplify
from symgrasp.object.profile import Profile
from symgrasp.poses import inverse
from tests.object.known_shapes import BOTTLE, SHAPES, STRAIGHT, Case, outline_distance, random_pose, save


def some_cases() -> list[tuple[str, int, float, int, str]]:
    """Each shape with many and few facets, with noise and without, each time in another pose."""
    endings = (".stl", ".obj", ".ply", ".off", ".glb")
    grid = [(s, f, n) for s in SHAPES for f in (24, 37, 120) for n in (0.0, 2e-4)]
    grid += [(s, 256, 2e-4) for s in ("bottle", "glass", "barrel")]
    return [(*case, k, endings[k % len(endings)]) for k, case in enumerate(grid)]


@pytest.mark.parametrize(("shape", "facets", "noise", "seed", "ending"), some_cases())
def test_known_profiles_are_found_in_any_pose(tmp_path, shape, facets, noise, seed, ending):
    found = Case(tmp_path, shape, facets, noise, seed, ending)
    assert found.axis_error < (0.2 if noise else 0.01)
    assert found.off_axis < found.facet + 3e-4
    assert outline_distance(found.truth, found.outline) < found.facet + 3e-4
    assert found.found.simplification <= SIMPLIFY_TOLERANCE <= 2e-4


@pytest.mark.parametrize("shape", STRAIGHT)
def test_facets_do_not_shrink_a_straight_profile(tmp_path, shape):
    # The vertices lie on the true surface, so even a prism of 24 sides has the exact radius.
    found = Case(tmp_path, shape, 24, 0.0, 5, ".stl")
    assert outline_distance(found.truth, found.outline) < 2e-5
    assert found.axis_error < 1e-4
    assert found.off_axis < 1e-6


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("facets", [32, 200])
def test_flat_ends_stay_flat_under_noise(tmp_path, facets, seed):
    # One vertex in the middle of each end moves the whole disc, yet r(h) holds up to the ends.
    found = Case(tmp_path, "cylinder", facets, 2e-4, seed, ".ply").found
    h = np.linspace(0.0, found.points[-1, 0], 500)
    assert np.interp(h, *found.points.T) == pytest.approx(
        0.033, abs=3e-4 + 0.033 * (1 - np.cos(np.pi / facets))
    )
    assert found.points[-1, 0] == pytest.approx(0.115, abs=3e-4)


@pytest.mark.parametrize(("shape", "seed"), [("bottle", 1), ("glass", 2), ("tumbler", 3), ("frustum", 4)])
def test_objects_stand_on_their_closed_or_wider_end(tmp_path, shape, seed):
    # The tumbler's mouth is wider than its base, but hollow.
    assert Case(tmp_path, shape, 48, 0.0, seed, ".ply").up


@pytest.mark.parametrize(("ending", "turn"), [(".ply", 0.0), (".glb", -np.pi / 2)])
def test_an_upright_mesh_stays_upright(tmp_path, ending, turn):
    # A bottle upside down in the file, and 5° off: z is up in PLY, y in GLB.
    mesh = trimesh.creation.revolve(np.array(BOTTLE, dtype=float), sections=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi + np.deg2rad(5) + turn, [1, 0, 0]))
    mesh.apply_translation([0.3, 0.2, 0.1])
    found = measure_mesh(save(tmp_path, mesh, "upside_down" + ending))
    assert found.T_mesh_object[2, 2] > np.cos(np.deg2rad(6))
    assert found.points[0, 1] == pytest.approx(0.014, abs=1e-5)


def test_the_pose_puts_the_mesh_on_the_profile(tmp_path):
    mesh = trimesh.creation.revolve(np.array(BOTTLE, dtype=float), sections=64)
    mesh.apply_transform(random_pose(np.random.default_rng(8)))
    path = save(tmp_path, mesh)
    profile = Profile.from_mesh(path)
    assert profile.T_mesh_object is not None
    x, y, h = (trimesh.transform_points(mesh.vertices, inverse(profile.T_mesh_object))).T
    assert h.min() == pytest.approx(0.0, abs=1e-5)
    on_wall = np.hypot(x, y) > 1e-3
    inside = np.clip(h, profile.h_min, profile.h_max)
    assert np.hypot(x, y)[on_wall] == pytest.approx(profile.radius(inside[on_wall]), abs=5e-5)
    assert Profile(BOTTLE_POINTS).T_mesh_object is None


BOTTLE_POINTS = [[0, 0.033], [0.15, 0.033], [0.20, 0.014], [0.24, 0.014]]


def test_scale_is_metres_in_a_unit_of_the_file(tmp_path):
    mesh = trimesh.creation.revolve(1000 * np.array(BOTTLE, dtype=float), sections=32)
    found = measure_mesh(save(tmp_path, mesh), scale=0.001)
    assert found.points == pytest.approx(np.array(BOTTLE_POINTS), abs=1e-5)


def test_a_sharp_step_stays_sharp(tmp_path):
    jar = [(0, 0), (0.03, 0), (0.03, 0.08), (0.035, 0.08), (0.035, 0.1), (0, 0.1)]
    points = measure_mesh(save(tmp_path, trimesh.creation.revolve(np.array(jar), sections=48))).points
    assert len(points) == 4
    assert points[2, 0] - points[1, 0] < 2e-5
    assert points[1:3, 1] == pytest.approx([0.03, 0.035], abs=1e-5)


def test_holes_in_the_ends_do_not_matter(tmp_path):
    mesh = trimesh.creation.revolve(np.array(BOTTLE, dtype=float), sections=48)
    mesh.update_faces(np.abs(mesh.face_normals[:, 2]) < 0.99)
    assert not mesh.is_watertight
    assert measure_mesh(save(tmp_path, mesh)).points == pytest.approx(np.array(BOTTLE_POINTS), abs=1e-5)


def bumped(height: float, angle: float, size: float, width: float = 4e-3) -> trimesh.Trimesh:
    """A finely meshed can with a round bump or dent."""
    rows = np.linspace(0, 0.12, 61)
    mesh = trimesh.creation.revolve(np.array([(0, 0), *((0.03, z) for z in rows), (0, 0.12)]), sections=120)
    centre = [0.03 * np.cos(angle), 0.03 * np.sin(angle), height]
    rise = size * np.exp(-((np.linalg.norm(mesh.vertices - centre, axis=1) / width) ** 2))
    mesh.vertices += rise[:, None] * [np.cos(angle), np.sin(angle), 0]
    return mesh


@pytest.mark.parametrize("size", [1.3e-3, -1.3e-3])
def test_the_map_shows_a_bump_where_it_is(tmp_path, size):
    found = measure_mesh(save(tmp_path, bumped(0.04, np.deg2rad(45), size)))
    largest, height, angle = found.worst
    assert largest == pytest.approx(abs(size), abs=1e-4)
    assert height == pytest.approx(0.04, abs=1e-3)
    assert np.rad2deg(angle) == pytest.approx(45, abs=3)
    row = np.argmin(np.abs(found.heights - height))
    column = np.argmin(np.abs(found.angles - angle))
    assert np.sign(found.deviation[row, column]) == np.sign(size)
    # Far from it there are only the facets of a circle of 120 chords.
    assert found.largest[np.abs(found.heights - 0.04) > 0.02].max() < 0.03 * (1 - np.cos(np.pi / 120)) + 2e-5
    rms = np.sqrt(np.mean(found.deviation**2, axis=1))
    assert rms.shape == found.heights.shape
    assert rms[row] > 5 * np.median(rms)
    assert 0 < found.overall_rms < rms.max()


def test_a_spike_between_the_angles_of_the_map_is_not_missed(tmp_path):
    with pytest.raises(MeshError, match=r"\+1\.9 mm at height 0.060 m, angle 3°"):
        measure_mesh(save(tmp_path, bumped(0.06, np.deg2rad(3), 1.9e-3, width=1e-4)))


def test_results_are_read_only(tmp_path):
    found = measure_mesh(save(tmp_path, bumped(0.04, 0.0, 0.0)))
    for array in (found.points, found.T_mesh_object, found.heights, found.angles, found.deviation):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    assert isinstance(found, Measurement)


@given(st.integers(0, 10**6))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_cuts_are_those_of_a_plane(seed):
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.05)
    mesh.vertices += 0.003 * rng.standard_normal(mesh.vertices.shape) + 0.01
    cuts = cut(mesh.vertices, mesh.faces, 7)
    for j, angle in enumerate(column_angles(7)):
        normal = [-np.sin(angle), np.cos(angle), 0]
        lines = np.asarray(trimesh.intersections.mesh_plane(mesh, normal, [0, 0, 0]))
        out = lines @ [np.cos(angle), np.sin(angle), 0]
        # Both keep the same part of the plane: compare the lengths of what lies beyond the axis.
        share = np.clip(out.max(axis=1) / np.maximum(np.ptp(out, axis=1), 1e-300), 0, 1)
        share[out.min(axis=1) >= 0] = 1.0
        expected = (share * np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)).sum()
        mine = cuts.column == j
        lengths = np.hypot(np.diff(cuts.h[mine], axis=1), np.diff(cuts.r[mine], axis=1))
        assert lengths.sum() == pytest.approx(expected, abs=1e-9)
    assert cuts.r.min() >= 0


def test_the_envelope_is_the_largest(tmp_path):
    x = np.array([[0.0, 2.0], [1.0, 3.0], [2.0, 2.0]])
    y = np.array([[0.0, 2.0], [5.0, 5.0], [1.0, 7.0]])
    largest, other = envelope(np.zeros(3, dtype=int), x, y, np.array([0.5, 1.5, 2.0, 4.0]), 1, 10 * y)
    assert largest[:, 0].tolist() == [0.5, 5.0, 7.0, -np.inf]
    assert other[:3, 0].tolist() == [5.0, 50.0, 70.0]
    assert np.isnan(other[3, 0])


@given(st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=60), st.floats(1e-5, 5e-3))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_simplified_profiles_stay_within_the_tolerance(steps, tolerance):
    outline = np.column_stack([np.linspace(0.0, 0.05, len(steps)), np.abs(np.cumsum(steps))])
    few = simplify(outline, tolerance)
    assert np.abs(np.interp(outline[:, 0], *few.T) - outline[:, 1]).max() <= tolerance
    assert {tuple(p) for p in few} <= {tuple(p) for p in outline}
    assert len(simplify(np.column_stack([outline[:, 0], 2 * outline[:, 0]]), tolerance)) == 2


def test_knots_at_one_height_end_the_simplification():
    assert len(simplify(np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]), 0.1)) >= 2


def test_distances_outside_an_outline():
    outline = np.array([[0.0, 1.0], [2.0, 1.0], [2.00001, 3.0], [4.0, 3.0]])
    points = [[1, 1.5], [1, 0.8], [-0.25, 0.5], [0.125, 0.25], [1.9, 2.0], [5, 0.0], [3, 0.0]]
    expected = [0.5, -0.2, 0.25, -0.125, 0.1, 1.0, -1.0]
    assert distance_outside(np.array(points), outline) == pytest.approx(expected, abs=1e-4)
