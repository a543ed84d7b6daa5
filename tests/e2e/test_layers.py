"""The stack of maps below the main one, by mouse and by touch, in a real browser."""

from __future__ import annotations

import json
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, expect

from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import ROLLS, turn_text
from symgrasp.plan.plan import Plan
from symgrasp.planners.gaps import print_gap
from symgrasp.scene.scene import Scene
from tests.e2e.page import GraspPage
from tests.e2e.test_layouts import CUT, WORDS

LEFT, TOP, RIGHT, BOTTOM, PROFILE = 46, 7, 12, 17, 64
"""What the axes and the profile take (px) around the cells."""

COLUMNS = 1440


def cells_box(layer: Locator, lying: bool = False) -> tuple[float, float, float, float]:
    """Left, top, width and height (px) of the cells in the window."""
    layer.scroll_into_view_if_needed()
    box = layer.bounding_box()
    assert box
    width = box["width"] - LEFT - RIGHT - (0 if lying else PROFILE)
    return box["x"] + LEFT, box["y"] + TOP, width, box["height"] - TOP - BOTTOM


def common(plan: Plan, turns: list[float]) -> int:
    """Count the cells that are feasible in the maps of all tasks, each turned."""
    scene, grasp = Scene.load("pick_pour_place"), plan.tasks[0].holds[0].grasp
    theta, shared = (np.arange(COLUMNS) + 0.5) * 2 * np.pi / COLUMNS - np.pi, []
    for task, turn in zip(plan.tasks, turns, strict=True):
        m = create_map(scene, task=task.name).shift(turn)
        columns = [m.manifold.cell(grasp.h, angle)[1] for angle in theta]
        shared.append(m.feasible[ROLLS.index(grasp.roll)][:, columns])
    return round(np.logical_and.reduce(shared).mean(axis=1).sum() * scene.manifold.angles)


def planned_sequence(page: GraspPage, to: Path) -> Plan:
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    path = to / "plan.json"
    path.write_text(json.dumps(page.download_plan(to)))
    return Plan.load(path)


def turned(page: GraspPage, k: int) -> float:
    """Return the angle (rad) that the page says the map of a task is turned by."""
    text = page.page.locator("#stack output").nth(k).inner_text()
    found = re.match(r"turned by (-?[\d.]+)°", text)
    assert found, text
    return float(np.deg2rad(float(found[1])))


def test_a_map_of_a_sequence_is_slid_by_hand_and_the_common_cells_count_live(open_page, tmp_path):
    page = open_page("pick_pour_place")
    plan = planned_sequence(page, tmp_path)
    layers, together = page.page.get_by_test_id("layer"), page.page.get_by_test_id("together")
    expect(layers).to_have_count(3)
    deltas = [task.delta for task in plan.tasks]
    expect(together).to_have_text(f"all 3 over each other: {common(plan, deltas)} common cells")
    for k, delta in enumerate(deltas):  # said alike above its map and in the table
        expect(page.page.locator("#stack output").nth(k)).to_contain_text(f"turned by {turn_text(delta)}")
        expect(page.frame.locator(".sg-stack .sg-head").nth(k + 1)).to_contain_text(turn_text(delta))
    x, y, width, height = cells_box(layers.nth(1))
    mouse = page.page.mouse
    mouse.move(x + width / 2, y + height / 2)
    mouse.down()
    mouse.move(x + width / 2 + width / 4, y + height / 2, steps=6)
    slid = turned(page, 1)
    assert abs(slid - deltas[1] + np.pi / 2) < np.deg2rad(2)
    count = common(plan, [deltas[0], slid, deltas[2]])
    assert count != common(plan, deltas)
    expect(together).to_have_text(f"all 3 over each other: {count} common cells")  # while it is held
    mouse.up()
    page.expect_title("· pour ·")  # the object of that task is turned by as much
    box = page.slider_box("Rotation (°)")
    expect(box).to_have_value(f"{round(float(np.rad2deg(slid)), 2):g}")
    expect(page.page.locator("#stack output").nth(1)).to_contain_text("(plan: ")
    page.page.get_by_role("button", name="As planned").click()
    expect(together).to_have_text(f"all 3 over each other: {common(plan, deltas)} common cells")
    assert page.complaints == []


def test_a_print_is_dragged_and_the_gap_counts_live(open_page):
    page = open_page("log_two_robots")
    page.tab("Hands")
    page.button("All arms together").click()
    layers, together = page.page.get_by_test_id("layer"), page.page.get_by_test_id("together")
    expect(together).to_have_text(re.compile(r"^gap \d+ mm$"))
    scene = Scene.load("log_two_robots")
    grid = scene.manifold
    hands = [
        (name, roll, *grid.cell(h, theta))
        for (h, theta, name), roll in zip(page.shown_map.look["marks"], shown_rolls(page), strict=True)
    ]
    x, y, width, height = cells_box(layers.first, lying=True)
    _, _, row, column = hands[0]

    def at(i: float, j: float) -> tuple[float, float]:
        return x + width * (i + 0.5) / grid.heights, y + height * (1 - (j + 0.5) / grid.angles)

    mouse = page.page.mouse
    mouse.move(*at(row, column))
    mouse.down()
    for k in range(1, 6):
        mouse.move(*at(row - 2 * k, column))
    moved = [(*hands[0][:2], row - 10, column), hands[1]]
    prints = [(scene.arm(name).handprint(grid, i, roll), j) for name, roll, i, j in moved]
    (gap,) = [print_gap(a, b, j - i, grid) for (a, i), (b, j) in combinations(prints, 2)]
    expect(together).to_have_text(f"gap {1e3 * gap:.0f} mm")  # while it is held
    mouse.up()
    page.button("Undo").click()
    expect(together).not_to_have_text(f"gap {1e3 * gap:.0f} mm")  # all of the drag was one step
    expect(page.page.get_by_role("button", name="As planned")).to_be_hidden()
    assert page.complaints == []


def shown_rolls(page: GraspPage) -> list[int]:
    """Return the rolls of the hands, as the stack names them."""
    titles = page.page.locator("#stack b").all_inner_texts()
    return [int("180" in title) for title in titles]


def test_a_map_is_slid_by_touch_and_by_keys(browser: Browser, start_server, tmp_path):
    context = browser.new_context(viewport={"width": 1280, "height": 800}, has_touch=True)
    try:
        page = GraspPage(context.new_page(), start_server("pick_pour_place"))
        plan = planned_sequence(page, tmp_path)
        layer = page.page.get_by_test_id("layer").first
        x, y, width, height = cells_box(layer)
        touch = context.new_cdp_session(page.page)
        for kind, share in (("touchStart", 0.5), ("touchMove", 0.55), ("touchMove", 0.75), ("touchEnd", 0)):
            points = [] if kind == "touchEnd" else [{"x": x + share * width, "y": y + height / 2}]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        near = plan.tasks[0].delta - np.pi / 2
        assert abs(np.exp(1j * turned(page, 0)) - np.exp(1j * near)) < np.deg2rad(3)
        page.page.get_by_role("button", name="As planned").click()
        expect(page.page.get_by_role("button", name="As planned")).to_be_hidden()
        layer.focus()
        page.page.keyboard.press("ArrowLeft")
        by = round(float(np.rad2deg(plan.tasks[0].delta)) * 4) / 4 + 1
        expect(page.page.locator("#stack output").first).to_contain_text(f"turned by {by:.2f}°")
        assert page.complaints == []
    finally:
        context.close()


def test_both_rolls_are_shown_side_by_side_on_demand(open_page):
    page = open_page()
    expect(page.page.locator("#layers")).to_be_hidden()
    page.frame.get_by_role("tab", name="View").click()
    page.frame.get_by_text("Rolls side by side").filter(visible=True).first.click()
    layers = page.page.get_by_test_id("layer")
    expect(layers).to_have_count(2)
    x, y, width, height = cells_box(layers.nth(1))
    page.page.mouse.click(x + width / 2, y + height / 3)
    page.expect_title("bottle_on_table")
    page.tab("Grasp")
    expect(page.text(re.compile("roll 180°"))).not_to_have_count(0)
    assert page.complaints == []


@pytest.mark.parametrize("size", [(1280, 800), (820, 1180), (390, 844)], ids=str)
def test_four_maps_have_room_or_scroll(open_page, size):
    page = open_page("log_four_robots", size=size)
    page.tab("Hands")
    page.button("All arms together").click()
    layers = page.page.get_by_test_id("layer")
    expect(layers).to_have_count(4)
    expect(page.page.get_by_test_id("together")).to_have_text(re.compile("^smallest gap|^gap"))
    pane = page.page.locator("#pane").bounding_box()
    assert pane
    if size[0] > 600:  # on a phone the whole pane scrolls
        assert page.page.evaluate(CUT, WORDS) == []
    for layer in layers.all():
        layer.scroll_into_view_if_needed()
        box = layer.bounding_box()
        assert box
        assert box["height"] >= 80
        assert box["width"] > 0.7 * pane["width"]
        assert box["y"] >= pane["y"] - 1
        assert box["y"] + box["height"] <= pane["y"] + pane["height"] + 1
    assert page.complaints == []


def test_labels_of_hands_cover_no_other_label_and_no_mark(open_page):
    page = open_page()
    width, height, long = 360.0, 90.0, 62.0
    rng = np.random.default_rng(0)
    rooms = rng.uniform([0, 0], [width, height], (40, 4, 2))
    rooms[:10] = rooms[:10, :1] + rng.normal(0, 4, (10, 4, 2))  # hands near each other
    rooms = np.clip(rooms, 0, [width, height])
    cases = [[{"x": x, "y": y, "wide": long} for x, y in marks] for marks in rooms.tolist()]
    placed = page.page.evaluate(
        """async ([cases, room]) => {
          const { placeLabels } = await import("/shell/drawing.js");
          return cases.map((marks) => placeLabels(marks, room).map(({ x, y }) => [x, y]));
        }""",
        [cases, {"x": 0, "y": 0, "width": width, "height": height}],
    )
    for marks, labels in zip(rooms, np.array(placed), strict=True):
        low, high = labels - np.array([3, 8]), labels + np.array([long + 3, 8])
        assert (low >= 0).all()
        assert (high <= [width, height]).all()
        for k in range(4):
            others = [j for j in range(4) if j != k]
            for a, b in [(low[others], high[others]), (marks[others] - 6, marks[others] + 6)]:
                assert not ((low[k] < b) & (a < high[k])).all(axis=1).any()
        beside = np.abs(labels[:, 1] - marks[:, 1]) < 1
        assert beside.any()
