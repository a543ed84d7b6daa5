"""The coloured quads lie on the object, facing outwards."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.render.cell_colors import cell_colors
from app.render.palette import to_linear
from app.scene3d.cell_mesh import LIFT, CellMesh, flat_quads, surface_quads
from app.server.door.viser_server import quiet_server
from app.state import changes, job_changes
from app.state.requests import MapResult
from symgrasp.feasibility.refined import Refined
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.reason import Reason
from tests.app.shown_map import shown
from tests.app.state.states import opened
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


def test_split_cells_are_drawn_part_by_part():
    """On the object and on the flat map, in the colours of the page's map, the hands' prints over them."""
    plain = opened()
    assert plain.map
    grid = plain.map.manifold
    fine = Manifold(grid.profile, 3 * grid.heights, 2 * grid.angles)
    rng, shape = np.random.default_rng(0), (2, fine.heights, fine.angles)
    reason = rng.choice([Reason.JOINT_LIMITS, Reason.FEASIBLE], shape).astype(np.uint8)
    certified = rng.random(plain.map.reason.shape) < 0.5
    known = replace(plain.map, certified=certified, refined=Refined(fine, reason, rng.random(shape) < 0.7))
    state = changes.choose_cell(job_changes.map_arrived(plain, 0, MapResult(plain.request, known, ())), 2, 5)
    assert state.map
    colors = cell_colors(state, state.map)
    assert colors.shape[:2] == shape[1:]
    picture = shown(state).picture()
    assert picture is not None
    rows, columns = picture.shape[0] // fine.heights, picture.shape[1] // fine.angles
    assert np.array_equal(picture[::-rows, ::columns], colors)
    printed = replace(state, map_view=replace(state.map_view, handprint=True))
    under = (cell_colors(printed, state.map) != colors).any(axis=-1)
    assert under.any()
    assert np.array_equal(under, under[::3, ::2].repeat(3, axis=0).repeat(2, axis=1))

    server = quiet_server()
    try:
        client: Any = SimpleNamespace(scene=server.scene)
        mesh = CellMesh(client, "/cells", surface_quads, grid, lambda *_: None)
        mesh.node.position = (1.0, 2.0, 3.0)
        whole = mesh.node
        mesh.set_colors(cell_colors(plain, plain.map))
        assert mesh.node is whole
        mesh.set_colors(colors)
        assert len(mesh.node.batched_positions) == fine.heights * fine.angles
        assert np.array_equal(mesh.node.batched_colors, to_linear(colors.reshape(-1, 3)))
        assert np.array_equal(mesh.node.position, [1.0, 2.0, 3.0])
        assert mesh.node.name != whole.name
    finally:
        server.stop()
