"""The colours of a map: what they count, that they can be told apart, and the pictures made of them."""

from __future__ import annotations

import base64
import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from symgrasp.feasibility import pictures
from symgrasp.feasibility.color_by import ColorBy, color_map
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.reason import Reason
from tests.conftest import load_small

# What the colour-blind see of linear RGB (Machado, Oliveira and Fernandes 2009, severity 1).
SEEN = {
    "all": np.eye(3),
    "protan": [[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]],
    "deutan": [[0.3673, 0.8607, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]],
    "tritan": [[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]],
}


@pytest.fixture(scope="module")
def bottle_map() -> FeasibilityMap:
    return create_map(load_small("bottle_on_table", 12, 24, 8))


def linear(colors: np.ndarray) -> np.ndarray:
    share = colors / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(colors: np.ndarray, eyes: str) -> np.ndarray:
    """CIELAB (n, 3) of sRGB colours (n, 3) as those eyes see them."""
    rgb = np.clip(linear(colors) @ np.transpose(SEEN[eyes]), 0, 1)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = rgb @ to_xyz.T / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=-1)


def test_what_is_not_proven_is_lighter():
    reason = np.array([[Reason.FEASIBLE, Reason.FEASIBLE], [Reason.UNREACHABLE, Reason.SCENE_COLLISION]])
    certified = np.array([[True, False], [False, True]])
    plain = color_map(ColorBy.REASON, reason, np.full((2, 2), np.nan))
    colored = color_map(ColorBy.REASON, reason, np.full((2, 2), np.nan), certified)
    before, after = plain.colors[plain.index].astype(int), colored.colors[colored.index].astype(int)
    assert (after[certified] == before[certified]).all()
    assert (after[~certified] > before[~certified]).all()
    assert colored.swatches[:-1] == plain.swatches
    assert colored.swatches[-1].cells == 2


@pytest.mark.parametrize("eyes", SEEN)
def test_the_colour_blind_can_tell_the_colours_apart(bottle_map, eyes):
    two = color_map(ColorBy.FEASIBLE, bottle_map.reason, bottle_map.values(ColorBy.FEASIBLE)).colors
    seen = lab(two, eyes)
    assert np.linalg.norm(seen[0] - seen[1]) > 30
    scale = color_map(ColorBy.CLEARANCE, bottle_map.reason, bottle_map.values(ColorBy.CLEARANCE)).colors
    seen = lab(scale, eyes)
    assert (np.diff(seen[1::32, 0]) > 0).all()  # it only grows lighter
    assert seen[-1, 0] - seen[1, 0] > 60
    assert np.linalg.norm(seen[1:] - seen[0], axis=1).min() > 15  # from "not feasible"


@pytest.mark.parametrize("eyes", SEEN)
def test_what_was_not_found_looks_like_no_other_reason(eyes):
    """It stands beside "out of reach" on maps, and means less."""
    channels = [[int(reason.color[k : k + 2], 16) for k in (1, 3, 5)] for reason in Reason]
    seen = lab(np.array(channels), eyes)
    apart = np.linalg.norm(seen - seen[Reason.NOT_FOUND], axis=1)
    assert np.delete(apart, Reason.NOT_FOUND).min() > 15


@pytest.mark.parametrize("eyes", SEEN)
def test_no_two_reasons_look_equal(eyes):
    seen = lab(np.array([[int(r.color[k : k + 2], 16) for k in (1, 3, 5)] for r in Reason]), eyes)
    apart = np.linalg.norm(seen[:, None] - seen[None], axis=-1) + np.diag(np.full(len(Reason), np.inf))
    assert apart.min() > 14
    assert apart[Reason.SELF_COLLISION, Reason.OBJECT_COLLISION] > 25
    assert apart[Reason.FEASIBLE, Reason.SCENE_COLLISION] > 20  # green and red differ in lightness as well


@pytest.mark.parametrize("color_by", ColorBy)
def test_every_cell_is_counted_and_coloured_as_the_legend_says(bottle_map, color_by):
    values = bottle_map.values(color_by)
    found = color_map(color_by, bottle_map.reason, values)
    assert found.index.shape == bottle_map.reason.shape
    assert found.index.max() < len(found.colors)
    seen = found.colors[found.index]
    for color, label, count in found.swatches:
        channels = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
        assert (seen == channels).all(axis=-1).sum() == count, label
    assert found.scale is not None or sum(s.cells for s in found.swatches) == bottle_map.reason.size
    assert (found.scale is None) == (color_by.unit == "")
    if found.scale:
        assert (found.index > 0).sum() == np.isfinite(values).sum()
        assert color_by.unit in found.scale.label


def test_values_are_those_of_the_cells(bottle_map):
    for cell in map(tuple, np.argwhere(bottle_map.feasible)):
        witness, margin = bottle_map.witness(cell), bottle_map.margin(cell)
        assert witness
        expected = {
            ColorBy.CLEARANCE: 1e3 * witness.clearance,
            ColorBy.ALONG: 1e3 * margin.along,
            ColorBy.AROUND: np.rad2deg(margin.around),
            ColorBy.OPENING: 1e3 * witness.opening,
        }
        for color_by, value in expected.items():
            assert bottle_map.values(color_by)[cell] == pytest.approx(value)
    assert np.isnan(bottle_map.values(ColorBy.CLEARANCE)[~bottle_map.feasible]).all()
    assert np.isnan(bottle_map.values(ColorBy.REASON)).all()


@given(st.lists(st.floats(0.0, 1e4), min_size=1, max_size=20))
def test_a_colour_can_be_read_back_off_its_scale(values):
    array = np.array([values])
    reason = np.full(array.shape, Reason.FEASIBLE)
    found = color_map(ColorBy.CLEARANCE, reason, array)
    assert found.scale
    assert array.max() <= found.scale.high * (1 + 1e-9)
    assert found.scale.high <= max(2 * array.max(), 0.001)
    read = (found.index.astype(float) - 1) / 254 * found.scale.high
    assert np.abs(read - array).max() <= found.scale.high / 254


def test_no_feasible_cell_is_no_error(bottle_map):
    none = bottle_map.masked(np.zeros(bottle_map.reason.shape, dtype=bool))
    for color_by in ColorBy:
        found = color_map(color_by, none.reason, none.values(color_by))
        assert (found.scale is None) == (color_by.unit == "")


@pytest.mark.parametrize("color_by", [ColorBy.REASON, ColorBy.CLEARANCE])
@pytest.mark.parametrize(("delta", "pieces"), [(0.0, 2), (0.05, 4)])  # a shifted grid comes round again
def test_an_svg_holds_the_cells_themselves(bottle_map, color_by, delta, pieces):
    m = bottle_map.shift(delta)
    svg = pictures.to_svg(m.plot(color_by))
    assert svg == pictures.to_svg(m.plot(color_by))
    images = ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}image")
    assert sum("pixelated" in (image.get("style") or "") for image in images) == pieces
    found = color_map(color_by, m.reason, m.values(color_by))
    hrefs = re.findall(rb"base64,([^\"]+)", svg)
    drawn = [np.asarray(Image.open(io.BytesIO(base64.b64decode(h))).convert("RGB")) for h in hrefs]
    for cells in found.colors[found.index]:
        assert any(np.array_equal(image, cells) for image in drawn)


def test_parts_of_split_cells_are_drawn_lighter_where_nothing_is_proven():
    """Of a scene that asks for a resolution, pictures show its parts, not the cells."""
    scene = load_small("soda_can", 6, 12, 4).with_settings(resolution={"mm": 15, "deg": 10})  # pyright: ignore[reportArgumentType]
    m = create_map(scene)
    assert m.refined is not None
    parts = m.refined
    assert parts.reason.shape[1:] > m.reason.shape[1:]
    assert 0 < parts.certified.mean() < 1
    hrefs = re.findall(rb"base64,([^\"]+)", pictures.to_svg(m.plot()))
    drawn = [np.asarray(Image.open(io.BytesIO(base64.b64decode(h))).convert("RGB")) for h in hrefs]
    whole = color_map(ColorBy.REASON, parts.reason, np.full(parts.reason.shape, np.nan))
    for proven, colors in zip(parts.certified, whole.colors[whole.index], strict=True):
        (image,) = (i for i in drawn if i.shape == colors.shape and (i[proven] == colors[proven]).all())
        assert (image[~proven].sum(axis=-1, dtype=int) > colors[~proven].sum(axis=-1, dtype=int)).all()
