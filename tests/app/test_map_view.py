"""Pictures of maps."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import base64
import io
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from app.map_view import COLUMNS, Mark, legend_html, map_html, plan_html, sample_columns
from app.palette import REASONS, faded, rgb, to_linear
from app.values import RollChoice
from symgrasp.manifold import Manifold
from symgrasp.reason import Reason
from tests.app.test_state import opened, with_plan

STEP = 2 * np.pi / COLUMNS


def pictures(html: str, alt: str) -> list[np.ndarray]:
    """Decode the pictures of that name as (H, W, 3)."""
    found = re.findall(rf'<img alt="{alt}" src="data:image/png;base64,([^"]+)"', html)
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")) for data in found]


def picture(state) -> np.ndarray:
    (found,) = pictures(map_html(state.map, state.roll), "map")
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
    turned = state.turn(steps * STEP)
    assert np.array_equal(picture(turned), np.roll(picture(state), -steps, axis=1))


def test_sampling_agrees_with_the_grid_on_any_shift():
    grid = Manifold(opened().scene.profile, 8, 16, theta_start=-np.pi - 0.11)
    theta = -np.pi + (np.arange(COLUMNS) + 0.5) * STEP
    assert [grid.cell(0.1, t)[1] for t in theta] == sample_columns(grid).tolist()


def test_an_old_map_looks_old():
    state = opened()
    html = map_html(state.map, state.roll, stale=True)
    (image,) = pictures(html, "map")
    reason = RollChoice.EITHER.reason(state.map)[::-1, sample_columns(state.map.manifold)]
    assert np.array_equal(image, faded(REASONS)[reason])
    assert not (faded(REASONS) == REASONS).all(axis=1).any()


@pytest.mark.parametrize("roll", RollChoice)
def test_the_legend_counts_every_cell_once(roll):
    state = opened()
    html = legend_html(state.map, roll)
    counts = [int(n) for n in re.findall(r"<small>(\d+) ·", html)]
    assert sum(counts) == roll.reason(state.map).size
    names = re.findall(r"<span>([^<]+)</span>", html)
    assert names[0] == "feasible"
    assert len(names) == len(np.unique(roll.reason(state.map)))


def test_marks_stand_where_their_grasp_is():
    state = opened()
    html = map_html(state.map, state.roll, [Mark(0.15, np.pi / 2, "<b>")])
    assert 'class="sg-mark" style="left:75.000%;bottom:50.000%"' in html
    assert "&lt;b&gt;" in html
    assert "<b>" not in html.replace("<b>h (cm)</b>", "").replace("<b>θ (°)</b>", "")


def test_handprints_are_shaded_and_the_rest_is_clear():
    state = with_plan("log_two_robots", "bimanual")
    cells = state.plan.prints["lift", "left"]
    html = map_html(state.map, state.roll, prints=[cells])
    (data,) = re.findall(r'alt="handprint" src="data:image/png;base64,([^"]+)"', html)
    alpha = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA"))[..., 3]
    still = Manifold(state.scene.profile, *cells.shape)
    assert np.array_equal(alpha > 0, cells[::-1, sample_columns(still)])


def test_a_plan_shows_a_map_for_every_task_turned_by_its_delta():
    state = with_plan("pick_pour_place", "sequential")
    html = plan_html(state.plan, state)
    for task in state.plan.plan.tasks:
        (shown,) = pictures(html, f"plan map {task.name} panda")
        m = state.plan.maps[task.name, "panda"].map.shift(task.delta)
        roll = 0 if task.holds[0].grasp.roll == 0 else 1
        assert np.array_equal(shown, REASONS[m.reason[roll][::-1, sample_columns(m.manifold)]])
    assert html.count("sg-mark") == 3


def test_colours_are_taken_to_linear_light_and_back():
    colors = np.array([[0, 0, 0], [255, 255, 255], [128, 188, 64]])
    linear = to_linear(colors)
    assert linear[0].tolist() == [0, 0, 0]
    assert linear[1].tolist() == [255, 255, 255]
    assert linear[2].tolist() == [55, 128, 13]  # 188 is half the light, by the sRGB standard
