"""The axis of a mesh against the true one."""

from __future__ import annotations

import numpy as np
import trimesh

from symgrasp.object.measure.axis import find_axis
from tests.object.known_shapes import STRAIGHT, random_pose


def test_a_ball_keeps_the_axis_of_its_file():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.033)
    axis = find_axis(mesh)[:3, 2]
    assert abs(axis[2]) > 0.999


def axis_errors(knots: list[tuple[float, float]], facets: int, noise: float, seeds: int) -> np.ndarray:
    """Errors (seeds,) in degrees of the axis of noisy meshes in random poses."""
    errors = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        mesh = trimesh.creation.revolve(np.array(knots, dtype=float), sections=facets)
        mesh.vertices += noise * rng.standard_normal(mesh.vertices.shape)
        pose = random_pose(rng)
        found = find_axis(mesh.apply_transform(pose))
        errors.append(np.rad2deg(np.arcsin(np.linalg.norm(np.cross(pose[:3, 2], found[:3, 2])))))
    return np.array(errors)


def test_many_facets_average_the_noise():
    # Two rings of 256 vertices, 0.2 mm off at random, 115 mm apart: 0.2 √2 √2 / √256 / 115 rad each way.
    expected = np.rad2deg(2e-4 * 2 / np.sqrt(256) / 0.115)
    assert np.sqrt(np.mean(axis_errors(STRAIGHT["cylinder"], 256, 2e-4, 5) ** 2)) < 2.5 * expected


def test_the_axis_runs_through_the_middle():
    mesh = trimesh.creation.revolve(np.array(STRAIGHT["cylinder"], dtype=float), sections=256)
    # A sixth of the wall is flattened, so that neither centroid nor normals point at the middle.
    x, y, _ = mesh.vertices.T
    dented = np.abs(np.arctan2(y, x)) < np.pi / 6
    mesh.vertices[dented, :2] *= 0.93
    mesh.vertices += 1e-4 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    assert np.hypot(*find_axis(mesh)[:2, 3]) < 1e-4


def test_a_lid_is_held_level_by_its_faces():
    radii = np.linspace(0, 0.04, 20)
    lid = [*((r, 0.0) for r in radii), *((r, 0.006) for r in radii[::-1])]
    assert axis_errors(lid, 64, 2e-4, 5).max() < 0.04


def test_a_frustum_without_principal_axes_is_found_by_its_normals():
    # The second moments of this surface are nearly the same in all directions.
    frustum = [(0, 0), (0.0416, 0), (0.0486, 0.0913), (0, 0.0913)]
    assert axis_errors(frustum, 48, 1e-4, 4).max() < 0.1
