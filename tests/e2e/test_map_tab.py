"""The map in a browser: shifted against recomputed, its views as pictures, and the candidates of a cell."""

from __future__ import annotations

import io
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from app.html.candidates import candidate_text
from app.html.map import sample_columns
from app.render.cell_colors import colored_map
from app.scene3d.ghost_view import HIT
from app.state.map_view_state import RollChoice
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.explain import Explanation
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.e2e.page import GraspPage

BOTTLE = Scene.load("bottle_on_table")
SHOTS = Path(__file__).parent / "screenshots"


@pytest.fixture(scope="module")
def bottle_map() -> FeasibilityMap:
    return create_map(BOTTLE)


def drawn(m: FeasibilityMap, view: ColorBy) -> np.ndarray:
    found = colored_map(m, RollChoice.EITHER, view)
    return found.colors[found.index[::-1, sample_columns(m.manifold)]]


def shoot(page: GraspPage, name: str) -> None:
    SHOTS.mkdir(exist_ok=True)
    page.page.screenshot(path=SHOTS / f"{name}.png")


def pick(page: GraspPage, m: FeasibilityMap, reason: Reason) -> Explanation:
    """Pick the first cell of that reason by numbers; return what the library says of it."""
    row, column = np.argwhere(RollChoice.EITHER.reason(m) == reason)[0]
    page.number("h (cm)", float(100 * m.manifold.h[row]))
    page.number("θ (°)", float(np.rad2deg(m.manifold.theta[column])))
    with BulletWorld(BOTTLE) as world:
        cell = (RollChoice.EITHER.roll(m, row, column), row, column)
        return MapMaker(world).explain("panda", "pick", cell)


def reds(view: np.ndarray) -> int:
    """Pixels of the red that only colliding bodies have."""
    r, g, b = np.moveaxis(view.astype(int), -1, 0)
    return int(np.count_nonzero((r > 190) & (np.abs(g - HIT[1]) < 40) & (np.abs(b - HIT[2]) < 40) & (b > g)))


def test_shifted_against_recomputed(open_page, bottle_map):
    page = open_page()
    page.frame.get_by_role("tab", name="View").click()
    page.frame.get_by_label("Compare").check()
    cells = bottle_map.reason.size
    for degrees in (0.0, 37.25, -120.0):
        page.slide("Rotation (°)", degrees)
        expect(page.text(f"from scratch for {degrees:.2f}°: 0 of {cells} cells differ")).to_be_visible()
        shifted = bottle_map.shift(np.deg2rad(degrees))
        page.wait_for_picture(lambda p, m=shifted: np.array_equal(p, drawn(m, ColorBy.REASON)))
        assert np.array_equal(page.picture("recomputed map"), page.picture())
    slider = page.frame.get_by_role("slider").first
    slider.focus()
    for _ in range(4):
        slider.press("ArrowRight")
    expect(page.text(f"for -119.00°: 0 of {cells} cells differ")).to_be_visible()
    shoot(page, "compare")
    page.frame.get_by_label("Compare").uncheck()
    expect(page.frame.locator("img[alt='recomputed map']")).to_have_count(0)
    assert page.complaints == []


def test_views_of_the_map_and_their_pictures(open_page, bottle_map, tmp_path):
    page = open_page()
    before = page.settled_view()
    page.frame.get_by_role("tab", name="View").click()
    for view in (ColorBy.FEASIBLE, ColorBy.ALONG, ColorBy.AROUND, ColorBy.OPENING, ColorBy.CLEARANCE):
        page.choose("Colours show", view)
        page.wait_for_picture(lambda p, v=view: np.array_equal(p, drawn(bottle_map, v)))
        expect(page.around(f"{view} ({view.unit})" if view.unit else "not feasible").first).to_be_visible()
        places = bottle_map.reason[0].size
        rest = places - int(bottle_map.feasible.any(axis=0).sum())
        share = f"{rest} · {100 * rest / places:.0f} %"
        expect(page.legend.locator("li").filter(has_text="not feasible")).to_contain_text(share)
    page.wait_for_change(before, share=0.001)  # the bottle and the board have the same colours
    shoot(page, "clearance")
    for kind, check in (("PNG", _is_png), ("SVG", _is_svg)):
        with page.page.expect_download() as download:
            page.button(kind).click()
        assert download.value.suggested_filename == f"bottle_on_table_pick_panda_clearance.{kind.lower()}"
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        assert check(path.read_bytes())
    assert page.complaints == []


def _is_png(content: bytes) -> bool:
    return Image.open(io.BytesIO(content)).width > 400


def _is_svg(content: bytes) -> bool:
    return ElementTree.fromstring(content).tag.endswith("svg")


def test_how_probable_grasps_are_is_computed_cancelled_and_read_out(open_page, bottle_map):
    page = open_page()
    pick(page, bottle_map, Reason.FEASIBLE)
    expect(page.text("panda holds it")).to_be_visible()
    expect(page.text("Ready.")).to_be_visible()
    page.tab("View")
    page.choose("Colours show", "probability")
    expect(page.legend).to_contain_text("not computed yet")
    expect(page.around("probability (%)")).to_be_visible()
    page.button("Cancel").click()
    expect(page.text("Stopped.")).to_be_visible()
    page.number("Off by (mm)", 1)  # another question is asked at once
    expect(page.text("Computing how probable grasps are")).to_be_visible()
    expect(page.legend).not_to_contain_text("not computed yet", timeout=600_000)
    expect(page.text("Ready.")).to_be_visible()
    page.tab("Grasp")
    expect(page.text("of 100 poses (")).to_be_visible()
    shoot(page, "probability")
    before = page.picture()
    page.slide("Rotation (°)", 30)
    page.wait_for_picture(lambda picture: np.array_equal(picture, np.roll(before, -4 * 30, axis=1)))
    assert page.complaints == []


def test_the_candidates_of_a_cell(open_page, bottle_map):
    page = open_page()
    parked = page.settled_view()
    hit = pick(page, bottle_map, Reason.SCENE_COLLISION)
    best = hit.best
    assert best
    expect(page.text(candidate_text(best))).to_be_visible()
    expect(page.frame.locator("img[alt='candidates']")).to_be_visible()
    page.wait_for_view(lambda v: reds(v) > reds(parked) + 300)
    shoot(page, "ghost")
    last = len(hit.candidates)
    page.slide("Candidate", last)
    expect(page.text(f"Candidate {last} of {last}")).to_be_visible()
    expect(page.text(candidate_text(hit.candidates[-1]))).to_be_visible()
    expect(page.text("One of")).to_be_visible()

    held = pick(page, bottle_map, Reason.FEASIBLE)
    assert held.best
    expect(page.text("panda holds it: feasible")).to_be_visible()
    expect(page.text(f" of {len(held.candidates)}: φ")).to_be_visible()
    page.wait_for_view(lambda v: reds(v) < reds(parked) + 50)
    page.slide("Candidate", 1)
    expect(page.text(candidate_text(held.best))).to_be_visible()

    pick(page, bottle_map, Reason.UNREACHABLE)
    expect(page.text("Out of reach: no configuration of the arm gets there")).to_be_visible()
    expect(page.frame.locator("img[alt='candidates']")).to_have_count(0)
    page.frame.get_by_role("tab", name="View").click()
    page.frame.get_by_label("Handprint").check()
    expect(page.around("hand of panda")).to_be_visible()
    assert page.shown_map.has_prints
    shoot(page, "handprint")
    assert page.complaints == []


def test_the_elbow_is_moved_by_a_slider(open_page, bottle_map):
    page = open_page()
    cells = np.argwhere(RollChoice.EITHER.reason(bottle_map) == Reason.FEASIBLE)
    row, column = cells[len(cells) // 2]
    page.number("h (cm)", 100 * bottle_map.manifold.h[row])
    page.number("θ (°)", np.rad2deg(bottle_map.manifold.theta[column]))
    expect(page.text("panda holds it: feasible")).to_be_visible()
    page.frame.get_by_label("Move the elbow").check()
    box = page.slider_box("Elbow φ (°)")
    expect(box).to_be_visible()
    expect(page.text("Ready.")).to_be_visible()
    before = page.settled_view()
    page.slide("Elbow φ (°)", float(box.input_value()) - 10.0)
    expect(page.text("Elbow at φ = ")).to_be_visible()
    page.wait_for_change(before, 0.003)
    shoot(page, "elbow")
    page.button("Undo").click()
    expect(page.text("Elbow at φ = ")).to_have_count(0)
    assert page.complaints == []
