"""Convex faces of a mesh: the same surface as its triangles."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from symgrasp.meshes.flat_faces import FLATNESS, convex_faces, few_triangles


def area(face: np.ndarray) -> float:
    """Return the area of a convex polygon (n, 3) with its corners in order."""
    return float(0.5 * np.linalg.norm(np.cross(face[1:-1] - face[0], face[2:] - face[0]).sum(axis=0)))


def subdivided(mesh: trimesh.Trimesh, times: int) -> trimesh.Trimesh:
    for _ in range(times):
        mesh = mesh.subdivide()
    return mesh


def test_a_fine_box_has_six_faces():
    box = subdivided(trimesh.creation.box((1.0, 0.6, 0.02)), 4)
    faces = convex_faces(box)
    assert len(box.faces) == 3072
    assert len(faces) == 6
    assert sorted(map(area, faces)) == pytest.approx(sorted([0.6, 0.6, 0.02, 0.02, 0.012, 0.012]))


def test_a_face_with_a_hole_is_not_filled():
    ring = trimesh.creation.annulus(0.05, 0.1, 0.2, sections=16)
    faces = convex_faces(ring)
    assert sum(map(area, faces)) == pytest.approx(ring.area)
    assert len(faces) < len(ring.faces)  # the sides are quadrilaterals


def test_few_triangles_are_the_same_surface():
    fine = subdivided(trimesh.creation.box((1.0, 0.6, 0.02)), 4)
    few = trimesh.Trimesh(*few_triangles(fine), process=False)
    assert len(few.faces) == 12
    assert few.is_watertight
    assert few.area == pytest.approx(fine.area)
    assert abs(trimesh.proximity.signed_distance(few, fine.vertices)).max() < 1e-9
    ring = trimesh.creation.annulus(0.05, 0.1, 0.2, sections=16)
    few = trimesh.Trimesh(*few_triangles(ring), process=False)
    assert few.area == pytest.approx(ring.area)


def test_what_is_not_flat_stays_as_it_is():
    plate = subdivided(trimesh.creation.box((0.4, 0.4, 0.4)), 3)
    on_top = np.flatnonzero(plate.vertices[:, 2] > 0.19)
    inner = on_top[(abs(plate.vertices[on_top, :2]) < 0.19).all(axis=1)]
    for bump, more in ((0.5 * FLATNESS, 0), (1e-4, 1)):
        mesh = plate.copy()
        mesh.vertices[inner[0], 2] += bump
        assert (len(convex_faces(mesh)) > 6) == bool(more)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_surface_is_that_of_the_triangles(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 0.1, (rng.integers(4, 20), 3))
    hull = ConvexHull(points)
    mesh = subdivided(trimesh.Trimesh(points, hull.simplices), int(rng.integers(0, 3)))
    mesh = trimesh.Trimesh(
        mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False
    )
    faces = convex_faces(mesh)
    assert len(faces) <= len(mesh.faces)
    assert sum(map(area, faces)) == pytest.approx(hull.area)
    for face in faces:  # every corner is on the surface
        assert abs((face @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)).max() < 1e-9
