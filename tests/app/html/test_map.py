"""Pictures of maps."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from app.html.map import COLUMNS, h_axis, map_html, sample_columns
from app.render.marks import Mark
from app.render.palette import OVERLAP, PRINTS, REASONS, faded, rgb, to_linear
from app.render.prints import on_surface, shown_prints
from app.state import changes
from app.state.map_view_state import RollChoice
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.reason import Reason
from tests.app.state.states import opened, with_plan

STEP = 2 * np.pi / COLUMNS


def pictures(html: str, alt: str) -> list[np.ndarray]:
    """Decode the pictures of that name as (H, W, 3)."""
    found = re.findall(rf'<img alt="{alt}" src="data:image/png;base64,([^"]+)"', html)
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")) for data in found]


def picture(state) -> np.ndarray:
    (found,) = pictures(map_html(state.map, state.map_view.roll), "map")
    return found


def test_the_picture_shows_every_cell_in_its_colour():
    state = opened()
    grid = state.map.manifold
    image = picture(state)
    assert image.shape == (grid.heights, COLUMNS, 3)
    reason = RollChoice.EITHER.reason(state.map)
    for row, column in np.ndindex(*reason.shape):
        x = int((grid.theta[column] + np.pi) / STEP)
        assert tuple(image[grid.heights - 1 - row, x]) == rgb(Reason(reason[row, column]).color)


@settings(deadline=None)
@given(st.integers(-720, 720))
def test_any_step_of_the_slider_rolls_the_picture_by_as_many_columns(steps):
    state = opened()
    turned = changes.turn(state, steps * STEP)
    assert np.array_equal(picture(turned), np.roll(picture(state), -steps, axis=1))


def test_sampling_agrees_with_the_grid_on_any_shift():
    grid = Manifold(opened().scene.profile, 8, 16, theta_start=-np.pi - 0.11)
    theta = -np.pi + (np.arange(COLUMNS) + 0.5) * STEP
    assert [grid.cell(0.1, t)[1] for t in theta] == sample_columns(grid).tolist()


def test_an_old_map_looks_old():
    state = opened()
    html = map_html(state.map, state.map_view.roll, stale=True)
    (image,) = pictures(html, "map")
    reason = RollChoice.EITHER.reason(state.map)[::-1, sample_columns(state.map.manifold)]
    assert np.array_equal(image, faded(REASONS)[reason])
    assert not (faded(REASONS) == REASONS).all(axis=1).any()


def test_marks_stand_where_their_grasp_is():
    state = opened()
    html = map_html(state.map, state.map_view.roll, [Mark(0.15, np.pi / 2, "<b>")])
    assert 'class="sg-mark" style="left:75.000%;bottom:50.000%"' in html
    assert "&lt;b&gt;" in html
    assert "<b>" not in html.replace("<b>h (cm)</b>", "").replace("<b>θ (°)</b>", "")


@given(
    base=st.floats(-1, 1),
    tall=st.floats(-3, 3).map(lambda power: 10**power),
    height=st.integers(50, 400),
)
def test_the_axis_has_round_heights_inside_whatever_the_object_measures(base, tall, height):
    grid = Manifold(Profile([[base, 0.01], [base + tall, 0.01]]), 4, 8)
    ticks = re.findall(r'bottom:([^%]+)%">([^<]+)<', h_axis(grid, height))
    shares, heights = np.array([[float(share), float(h)] for share, h in ticks]).T
    assert 1 <= len(ticks) <= max(4, height / 28 + 1)
    assert (shares > -0.01).all() and (shares < 100.01).all()
    rise = 100 * (base + tall * shares / 100) - heights  # cm
    assert np.abs(rise).max() < 1e-3 * 100 * (tall + abs(base))


def test_each_hand_has_its_colour_their_overlap_a_third_and_the_rest_is_clear():
    state = with_plan("log_two_robots", "bimanual")
    left, right = shown_prints(state)
    assert left.any()
    assert right.any()
    moved = np.roll(left, 1, axis=1)  # a plan's own prints share no cell
    assert (left & moved).any()
    for other in (right, moved):
        html = map_html(state.map, state.map_view.roll, prints=[left, other])
        (data,) = re.findall(r'alt="handprints" src="data:image/png;base64,([^"]+)"', html)
        image = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA"))
        columns = sample_columns(Manifold(state.scene.profile, *left.shape))
        a, b = left[::-1, columns], other[::-1, columns]
        assert np.array_equal(image[..., 3] > 0, a | b)
        for cells, color in ((a & ~b, PRINTS[1]), (b & ~a, PRINTS[2]), (a & b, PRINTS[OVERLAP])):
            assert (image[cells][:, :3] == color).all()


def test_prints_on_the_surface_stay_under_the_hand_when_the_object_turns():
    state = with_plan("log_two_robots", "bimanual")
    grid, (left, _) = state.scene.manifold, shown_prints(state)
    i, j = np.argwhere(left)[0]
    turned = replace(state, delta=state.delta + 3 * grid.dtheta)
    seen = on_surface(turned, left)
    point = turned.T_world_object @ [*grid.contact(grid.h[i], grid.theta[j]), 1.0]
    base = np.linalg.inv(turned.request.T_world_object) @ point
    assert seen[grid.cell(base[2], np.arctan2(base[1], base[0]))]
    assert seen.sum() == left.sum()


@pytest.mark.parametrize(
    "sight",
    [
        np.eye(3),
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ],
    ids=["all colours", "no red", "no green", "no blue"],
)
def test_hands_are_told_apart_by_the_colour_blind(sight):
    """Seen as Machado, Oliveira and Fernandes (2009) compute it, the colours differ in lightness."""
    linear = to_linear(PRINTS[1:]) / 255
    seen = np.clip(linear @ np.transpose(sight), 0, 1)
    luminance = seen @ [0.2126, 0.7152, 0.0722]
    lightness = 116 * np.cbrt(np.maximum(luminance, 0.0089)) - 16
    for a, b in combinations(range(len(seen)), 2):
        assert abs(lightness[a] - lightness[b]) > 10


def test_colours_are_taken_to_linear_light_and_back():
    colors = np.array([[0, 0, 0], [255, 255, 255], [128, 188, 64]])
    linear = to_linear(colors)
    assert linear[0].tolist() == [0, 0, 0]
    assert linear[1].tolist() == [255, 255, 255]
    assert linear[2].tolist() == [55, 128, 13]  # 188 is half the light, by the sRGB standard
