"""The coloured quads lie on the object, facing outwards."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.scene3d.cell_mesh import LIFT, flat_quads, surface_quads
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from tests.strategies import profiles


@settings(deadline=None)
@given(profiles(), st.integers(2, 30), st.integers(3, 60))
def test_quads_wrap_the_object(profile, heights, angles):
    grid = Manifold(profile, heights, angles)
    poses, sizes = surface_quads(grid)
    assert len(poses) == len(sizes) == heights * angles
    rotation = poses[:, :3, :3]
    assert np.allclose(np.swapaxes(rotation, 1, 2) @ rotation, np.eye(3), atol=1e-9)
    assert np.allclose(np.linalg.det(rotation), 1.0)
    i, j = np.indices((heights, angles)).reshape(2, -1)
    outwards = rotation[:, :, 2]
    radial = np.stack([np.cos(grid.theta[j]), np.sin(grid.theta[j])], axis=-1)
    assert (np.einsum("ij,ij->i", outwards[:, :2], radial) > 0).all()
    # The middles of the quads' edges are on the surface at the edges of their rows.
    for side, edge in ((-0.5, i), (0.5, i + 1)):
        middle = poses[:, :3, 3] - LIFT * outwards + side * sizes[:, 1:2] * rotation[:, :, 1]
        h = profile.h_min + edge * grid.dh
        r = profile.radius(np.clip(h, profile.h_min, profile.h_max))
        assert np.allclose(middle[:, 2], h, atol=1e-9)
        assert np.allclose(np.hypot(middle[:, 0], middle[:, 1]), r, atol=1e-9)


@given(st.integers(1, 30), st.integers(1, 60))
def test_the_flat_map_is_filled_without_overlap(heights, angles):
    grid = Manifold(Profile([[0, 0.1], [0.2, 0.1]]), heights, angles)
    poses, sizes = flat_quads(grid, 0.4, 0.2)
    low, high = poses[:, :2, 3] - sizes[:, :2] / 2, poses[:, :2, 3] + sizes[:, :2] / 2
    assert np.allclose(low.min(axis=0), [-0.2, -0.1])
    assert np.allclose(high.max(axis=0), [0.2, 0.1])
    assert np.isclose(np.prod(sizes[:, :2], axis=1).sum(), 0.08)
    cells = poses.reshape(heights, angles, 4, 4)
    assert (np.diff(cells[:, :, 0, 3], axis=1) > 0).all()  # θ to the right
    assert (np.diff(cells[:, :, 1, 3], axis=0) > 0).all()  # h upwards
