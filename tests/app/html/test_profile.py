"""What fits where, and the symmetry error."""

# An object may have no measurement in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
import trimesh

from app.choices.object_choice import ObjectChoice, from_mesh
from app.html.profile import holds_html, symmetry_html
from app.render.deviation import NO_SURFACE, deviation_cells, deviation_colors
from app.render.palette import DIVERGING
from app.state import changes
from app.state.state import State
from symgrasp.object.library import load_object
from symgrasp.object.manifold import Manifold
from symgrasp.robot.hand import HANDS
from symgrasp.scene.scene import Scene
from tests.conftest import load_small, write_scene

OVAL = 1e-3
MIDDLE = 0.1


def oval_stl() -> bytes:
    """A wine bottle that is oval, by 1 mm, around 10 cm; outside at θ = 0, inside at 90°."""
    coarse = load_object("wine_bottle")[1].mesh(96)
    vertices, faces, *_ = trimesh.remesh.subdivide_to_size(coarse.vertices, coarse.faces, 0.01)
    theta = np.arctan2(vertices[:, 1], vertices[:, 0])
    bump = OVAL * np.exp(-(((vertices[:, 2] - MIDDLE) / 0.02) ** 2)) * np.cos(2 * theta)
    vertices[:, 0] += bump * np.cos(theta)
    vertices[:, 1] += bump * np.sin(theta)
    content = trimesh.Trimesh(vertices, faces).export(file_type="stl")
    assert isinstance(content, bytes)
    return content


@pytest.fixture(scope="module")
def oval() -> ObjectChoice:
    return from_mesh("oval.stl", oval_stl(), 1.0)


def test_what_a_hand_is_called_is_escaped(tmp_path, content):
    fields = {k: v for k, v in asdict(HANDS["franka"]).items() if k not in ("urdf", "tool")}
    content["robots"][0]["hand"] = {**fields, "name": "<script>"}
    content["robots"][0]["hand"]["links"] = list(fields["links"])
    content["robots"][0]["hand"]["touch_links"] = list(fields["touch_links"])
    content["robots"][0]["tool"] = "panda_grasptarget"
    html = holds_html(State.of(Scene.load(write_scene(tmp_path, content)), ""))
    assert "<script" not in html
    assert "The hand &lt;script&gt; fits from 0.9 to 19.1 and 24.2 to 29.1 cm." in html


def test_the_deviation_is_where_the_mesh_has_it(oval):
    grid = Manifold(oval.profile, 40, 60)
    cells = deviation_cells(oval.measurement, grid)
    h, theta = np.meshgrid(grid.h, grid.theta, indexing="ij")
    points = np.stack([np.cos(theta), np.sin(theta), h, np.ones_like(h)], axis=-1)
    x, y, z, _ = np.moveaxis(points @ oval.measurement.T_mesh_object.T, -1, 0)
    expected = OVAL * np.exp(-(((z - MIDDLE) / 0.02) ** 2)) * np.cos(2 * np.arctan2(y, x))
    middle = np.abs(z - MIDDLE) < 0.05
    assert np.abs(cells - expected)[middle].max() < 2.5e-4
    assert np.abs(expected[middle]).max() > 9e-4


def test_a_spike_between_the_centres_of_cells_is_seen(oval):
    deviation = np.zeros_like(oval.measurement.deviation)
    deviation[37, 101] = -1e-3
    spiked = replace(oval.measurement, deviation=deviation)
    cells = deviation_cells(spiked, Manifold(oval.profile, 10, 12))
    assert (cells == -1e-3).sum() == 1
    row, column = np.argwhere(cells == -1e-3)[0]
    grid = Manifold(oval.profile, 10, 12)
    assert (row, column) == grid.cell(float(spiked.heights[37]), float(spiked.angles[101]))


def test_the_colours_go_from_inside_to_outside_and_a_gap_has_none(oval):
    deviation = np.zeros_like(oval.measurement.deviation)
    deviation[:, :60], deviation[:, 180:] = -1e-3, 1e-3
    deviation[:, 120:180] = np.nan
    colors = deviation_colors(replace(oval.measurement, deviation=deviation), Manifold(oval.profile, 4, 4))
    wanted = [DIVERGING[0], DIVERGING[2], NO_SURFACE, DIVERGING[4]]
    assert np.array_equal(colors, np.tile(np.array(wanted, dtype=np.uint8), (4, 1, 1)))


def test_the_symmetry_error_is_told_of_an_uploaded_mesh_only(oval):
    state = State.of(load_small("bottle_on_table"), "")
    assert symmetry_html(state) == ""
    state = changes.choose_object(state, state.scene.with_object(oval.name, oval.profile), oval)
    worst = oval.measurement.worst[0]
    assert f"Symmetry error: {1e3 * worst:.2f} mm at most" in symmetry_html(state)
    assert "linear-gradient" not in symmetry_html(state)
    assert "linear-gradient" in symmetry_html(changes.switched(state, symmetry_error=True))
    assert not changes.choose_object(
        changes.switched(state, symmetry_error=True), state.scene, None
    ).display.symmetry_error
