"""The map as the instrument of the page: by mouse, by touch and by keys, in a real browser."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, expect

from app.render.palette import PICK, rgb
from app.state.map_view_state import RollChoice
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from tests.e2e.page import GraspPage
from tests.e2e.test_page import drawn

BOTTLE = Scene.load("bottle_on_table")

LEFT, TOP, RIGHT, BOTTOM, PROFILE = 46, 10, 12, 38, 64
"""What the axes and the profile take (px) around the cells."""


@pytest.fixture(scope="module")
def bottle_map() -> FeasibilityMap:
    return create_map(BOTTLE)


def cells_box(page: GraspPage, lying: bool = False) -> tuple[float, float, float, float]:
    """Left, top, width and height (px) of the cells in the window."""
    box = page.map.bounding_box()
    assert box
    beside, above = (0, PROFILE) if lying else (PROFILE, 0)
    width, height = box["width"] - LEFT - RIGHT - beside, box["height"] - TOP - BOTTOM - above
    return box["x"] + LEFT, box["y"] + TOP + above, width, height


def at(page: GraspPage, m: FeasibilityMap, row: int, column: int, lying: bool = False) -> tuple[float, float]:
    """The pixel of the middle of a cell; where a long object lies, heights are to the right and θ upwards."""
    x, y, width, height = cells_box(page, lying)
    grid = m.manifold
    turn, up = (grid.theta[column] + np.pi) / (2 * np.pi), (row + 0.5) / grid.heights
    right, up = (up, turn) if lying else (turn, up)
    return x + width * right, y + height * (1 - up)


def cell_with(m: FeasibilityMap, reason: Reason) -> tuple[int, int]:
    """A cell in the midst of cells of that reason."""
    found = RollChoice.EITHER.reason(m) == reason
    inside = found & np.roll(found, 1, 1) & np.roll(found, -1, 1)
    return tuple(np.argwhere(inside)[0])


def readout(page: GraspPage, text: str) -> None:
    expect(page.page.get_by_test_id("readout")).to_contain_text(text)


@pytest.mark.parametrize("size", [(1280, 800), (1111, 733)])
def test_the_cells_are_drawn_sharply_in_their_colours(open_page, bottle_map, size):
    page = open_page(size=size)
    x, y, width, height = cells_box(page)
    page.next_frame()
    shot = np.asarray(Image.open(io.BytesIO(page.page.screenshot())).convert("RGB"))
    picture = page.picture()
    rows, columns = int(height), int(width)
    i = ((np.arange(rows) + 0.5) * picture.shape[0] / height).astype(int)
    j = ((np.arange(columns) + 0.5) * picture.shape[1] / width).astype(int)
    drawn = shot[round(y) : round(y) + rows, round(x) : round(x) + columns]
    same = (drawn == picture[i][:, j]).all(axis=-1)
    assert same.mean() > 0.97  # what differs are pixels on the lines between cells
    palette = {tuple(color) for color in picture.reshape(-1, 3)}
    assert {tuple(color) for color in drawn[2:-2, 2:-2].reshape(-1, 3)} <= palette  # none is blurred


def test_pointing_reads_a_cell_out_and_previews_its_grasp(open_page, bottle_map):
    page = open_page()
    parked = page.settled_view()
    row, column = cell_with(bottle_map, Reason.FEASIBLE)
    page.page.mouse.move(*at(page, bottle_map, row, column))
    grid = bottle_map.manifold
    readout(page, f"h {100 * grid.h[row]:.1f} cm · θ {np.rad2deg(grid.theta[column]):.1f}° · feasible")
    roll = RollChoice.EITHER.roll(bottle_map, row, column)
    readout(page, f"clearance {1e3 * bottle_map.clearance[roll, row, column]:.1f} mm")
    page.wait_for_change(parked, 0.003)
    page.page.mouse.move(*at(page, bottle_map, *cell_with(bottle_map, Reason.UNREACHABLE)))
    readout(page, "out of reach")
    page.page.mouse.move(5, 5)
    page.wait_for_view(lambda v: (np.abs(v.astype(int) - parked).max(axis=-1) > 40).mean() < 0.001)
    expect(page.text("No grasp picked")).to_be_visible()
    assert page.complaints == []


def test_a_click_picks_the_cell_and_the_arm_takes_it(open_page, bottle_map):
    page = open_page()
    parked = page.settled_view()
    row, column = cell_with(bottle_map, Reason.FEASIBLE)
    page.page.mouse.click(*at(page, bottle_map, row, column))
    expect(page.text("panda holds it: feasible")).to_be_visible()
    grid = bottle_map.manifold
    picked = f"h = {round(100 * grid.h[row], 2):g} cm, θ = {round(np.rad2deg(grid.theta[column]), 2):g}°"
    expect(page.text(picked)).to_be_visible()
    page.wait_for_change(parked)
    page.button("Undo").click()
    expect(page.text("No grasp picked")).to_be_visible()


def test_the_picked_cell_is_seen_inside_its_mark(open_page, bottle_map):
    page = open_page()
    row, column = cell_with(bottle_map, Reason.FEASIBLE)
    x, y = at(page, bottle_map, row, column)
    page.page.mouse.click(x, y)
    expect(page.text("panda holds it: feasible")).to_be_visible()
    page.page.mouse.move(5, 5)
    mark, cell = rgb(PICK), rgb(Reason.FEASIBLE.color)

    def shown() -> np.ndarray:
        page.next_frame()
        area = {"x": round(x) - 12, "y": round(y) - 12, "width": 24, "height": 24}
        return np.asarray(Image.open(io.BytesIO(page.page.screenshot(clip=area))).convert("RGB"), dtype=int)

    expect(page.page.get_by_test_id("readout")).not_to_contain_text("feasible")  # nothing is pointed at
    picture = shown()
    while not (np.abs(picture - mark).max(axis=-1) < 40).any():
        picture = shown()
    assert (np.abs(picture[11:13, 11:13] - cell).max(axis=-1) < 8).all()


@pytest.mark.parametrize("degrees", [60.0, -135.0])
def test_dragging_the_map_turns_the_object(open_page, bottle_map, degrees):
    page = open_page()
    x, y, width, height = cells_box(page)
    mouse, middle = page.page.mouse, x + width / 2
    mouse.move(middle, y + height / 2)
    mouse.down()
    mouse.move(middle - width * degrees / 360, y + height / 2 + 5, steps=8)
    mouse.up()
    box = page.slider_box("Rotation (°)")
    near = "|".join(f"{degrees + k / 4:g}" for k in range(-4, 5))  # a pixel is a degree
    expect(box).to_have_value(re.compile(f"^({near})$"))
    turned = float(box.input_value())
    shifted = bottle_map.shift(np.deg2rad(turned))
    page.wait_for_picture(lambda p: np.array_equal(p, drawn(shifted)))
    row, column = cell_with(shifted, Reason.FEASIBLE)
    mouse.click(*at(page, shifted, row, column))  # the map on the canvas is that one
    expect(page.text("panda holds it: feasible")).to_be_visible()
    assert page.complaints == []


def test_the_wheel_zooms_and_a_double_click_shows_all(open_page, bottle_map):
    page = open_page()
    row, column = cell_with(bottle_map, Reason.FEASIBLE)
    where = at(page, bottle_map, row, column)
    grid = bottle_map.manifold
    read = f"h {100 * grid.h[row]:.1f} cm · θ {np.rad2deg(grid.theta[column]):.1f}°"
    page.page.mouse.move(*where)
    page.page.mouse.wheel(0, -2000)
    page.next_frame()
    page.page.mouse.move(where[0] + 20, where[1])  # far from it before, still in the same cell now
    readout(page, read)
    page.page.mouse.dblclick(*where)
    page.next_frame()
    page.page.mouse.move(where[0] + 20, where[1])
    expect(page.page.get_by_test_id("readout")).not_to_contain_text(read)


def test_arrow_keys_move_the_picked_cell(open_page, bottle_map):
    page = open_page()
    row, column = cell_with(bottle_map, Reason.FEASIBLE)
    page.page.mouse.click(*at(page, bottle_map, row, column))
    expect(page.text("panda holds it")).to_be_visible()
    page.map.focus()
    expect(page.map).to_have_accessible_name("Unwrapped map: bottle_on_table · pick · panda")
    for key in ("ArrowUp", "ArrowRight", "ArrowRight", "ArrowDown", "ArrowLeft"):
        page.page.keyboard.press(key)
    grid = bottle_map.manifold
    theta = np.rad2deg(grid.theta[(column + 1) % grid.angles])
    expect(page.text(f"h = {round(100 * grid.h[row], 2):g} cm, θ = {round(theta, 2):g}°")).to_be_visible()
    near = "|".join(f"{theta + off:.1f}" for off in (-0.04, 0.04))  # half a digit is rounded either way
    expect(page.page.locator("#spoken")).to_contain_text(re.compile(f"θ ({near})°"))
    page.page.keyboard.press("Shift+ArrowRight")
    expect(page.slider_box("Rotation (°)")).to_have_value("-1")
    page.page.keyboard.press("l")  # a key of the view
    expect(page.text("No grasp picked")).to_be_visible()
    assert page.complaints == []


def test_a_long_object_lies_in_a_wide_pane_and_all_works_by_touch(browser: Browser, start_server, bottle_map):
    context = browser.new_context(viewport={"width": 820, "height": 1180}, has_touch=True)
    try:
        page = GraspPage(context.new_page(), start_server("bottle_on_table"))
        row, column = cell_with(bottle_map, Reason.FEASIBLE)
        page.page.touchscreen.tap(*at(page, bottle_map, row, column, lying=True))
        expect(page.text("panda holds it: feasible")).to_be_visible()
        x, y, width, height = cells_box(page, lying=True)
        touch = context.new_cdp_session(page.page)
        for kind, share in (("touchStart", 0.5), ("touchMove", 0.55), ("touchMove", 0.75), ("touchEnd", 0)):
            points = [] if kind == "touchEnd" else [{"x": x + width / 2, "y": y + share * height}]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        box = page.slider_box("Rotation (°)")
        expect(box).to_have_value(re.compile(r"^(89|90|91)(\.\d+)?$"))
        assert page.complaints == []
    finally:
        context.close()


def test_two_fingers_zoom(browser: Browser, start_server, bottle_map):
    context = browser.new_context(viewport={"width": 1280, "height": 800}, has_touch=True)
    try:
        page = GraspPage(context.new_page(), start_server("bottle_on_table"))
        page.expect_title("bottle_on_table")
        feasible = np.argwhere(RollChoice.EITHER.reason(bottle_map) == Reason.FEASIBLE)
        row, column = min(feasible.tolist(), key=lambda cell: abs(cell[1] - bottle_map.manifold.angles / 2))
        x, y = at(page, bottle_map, row, column)
        touch = context.new_cdp_session(page.page)
        for kind, apart in (("touchStart", 8), ("touchMove", 30), ("touchMove", 90), ("touchEnd", 0)):
            fingers = [{"x": x + side * apart, "y": y, "id": k} for k, side in enumerate((-1, 1))]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers if apart else []})
        page.next_frame()
        expect(page.text("No grasp picked")).to_be_visible()  # fingers that zoom do nothing else
        expect(page.slider_box("Rotation (°)")).to_have_value("0")
        page.page.touchscreen.tap(x + 14, y)  # in another column before
        grid = bottle_map.manifold
        picked = f"h = {round(100 * grid.h[row], 2):g} cm, θ = {round(np.rad2deg(grid.theta[column]), 2):g}°"
        expect(page.text(picked)).to_be_visible()
        assert page.complaints == []
    finally:
        context.close()


def test_the_splitter_is_remembered(open_page):
    page = open_page()
    bar, before = page.page.get_by_role("separator").bounding_box(), page.map.bounding_box()
    assert bar
    assert before
    mouse = page.page.mouse
    mouse.move(bar["x"] + 3, 400)
    mouse.down()
    mouse.move(bar["x"] + 163, 400, steps=4)
    mouse.up()
    page.page.reload()
    page.expect_title("bottle_on_table")
    after = page.map.bounding_box()
    assert after
    assert abs(after["width"] - before["width"] - 160) < 8


def test_patterns_tell_reasons_apart_without_colour(open_page, bottle_map):
    page = open_page()
    page.expect_title("bottle_on_table")
    shown = [Reason.FEASIBLE, Reason.SCENE_COLLISION, Reason.UNREACHABLE]
    reasons = RollChoice.EITHER.reason(bottle_map)

    def amid(reason: Reason) -> tuple[float, float]:
        """The pixel of a cell with that reason all around it."""
        alike = np.lib.stride_tricks.sliding_window_view(reasons == reason, (3, 5)).all(axis=(2, 3))
        row, column = np.argwhere(alike)[0]
        return at(page, bottle_map, row + 1, column + 2)

    cells = {reason: amid(reason) for reason in shown}

    def strokes(reason: Reason) -> bool:
        """Whether the grey values around a cell of that reason differ."""
        picture = Image.open(io.BytesIO(page.page.screenshot())).convert("L")
        x, y = cells[reason]
        around = np.asarray(picture.crop((int(x) - 5, int(y) - 5, int(x) + 6, int(y) + 6)), dtype=int)
        return int(around.max() - around.min()) > 25

    drawn_over = page.legend.locator("i[style*=background-image]")
    expect(drawn_over).to_have_count(0)
    page.frame.get_by_role("tab", name="View").click()
    page.frame.get_by_label("Patterns").check()
    expect(drawn_over).not_to_have_count(0)
    for _ in range(3):
        page.next_frame()
    assert [strokes(reason) for reason in shown] == [False, True, True]
    rows = page.legend.locator("li").filter(has=page.page.locator("i[style*=background-image]"))
    assert rows.count() == page.legend.locator("li").count() - 1  # all but "feasible"
    page.frame.get_by_label("Patterns").uncheck()
    expect(drawn_over).to_have_count(0)
    assert page.complaints == []
