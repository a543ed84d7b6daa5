"""The page without a mouse, undo and redo, light and dark, on a monitor and on a tablet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from playwright.sync_api import expect

from tests.e2e.page import GraspPage

SCREENSHOTS = Path(__file__).parent / "screenshots"


def shoot(page: GraspPage, name: str) -> None:
    SCREENSHOTS.mkdir(exist_ok=True)
    page.page.screenshot(path=SCREENSHOTS / f"{name}.png")


def brightness(page: GraspPage) -> float:
    """How bright the background is, in the middle of the upper edge of the 3D view."""
    view = page.view()
    return float(view[10:20, view.shape[1] // 2 - 10 : view.shape[1] // 2 + 10].mean())


def test_everything_has_a_key(open_page):
    page = open_page(scene="pick_pour_place")
    press, label = page.page.keyboard.press, lambda name: page.frame.get_by_label(name, exact=True)
    page.page.locator("#title").click()  # out of the dropdown, where keys mean something else
    press("2")
    page.expect_title("· pour ·")
    press("g")
    expect(label("Drag handles")).to_be_checked()
    press("f")
    expect(label("Flat map")).not_to_be_checked()
    press("r")
    expect(label("Roll")).to_have_value("0°")
    press("p")
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    press("PageDown")
    page.expect_title("· pour ·")
    press("PageUp")
    page.expect_title("· pick ·")
    press("Control+k")
    search = page.frame.get_by_placeholder("Search commands")
    search.fill("soda")
    press("Enter")
    expect(search).to_be_hidden()  # until then, keys are its own
    page.expect_title("soda_can")
    press("Control+z")  # the scene as well, with its plan
    page.expect_title("pick_pour_place")
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    assert page.complaints == []


def test_what_was_done_is_undone_and_done_again(open_page):
    page = open_page()
    first = page.picture()
    page.slide("Rotation (°)", 30)
    turned = page.wait_for_picture(lambda p: np.array_equal(p, np.roll(first, -120, axis=1)))
    page.slide("x (cm)", 60)
    page.wait_for_picture(lambda p: not np.array_equal(p, turned))
    page.expect_title("pick")
    moved = page.picture()  # before that it may be the earlier one, washed out
    page.button("Undo").click()
    page.wait_for_picture(lambda p: np.array_equal(p, turned))
    expect(page.slider_box("x (cm)")).to_have_value("55")
    page.button("Undo").click()
    page.wait_for_picture(lambda p: np.array_equal(p, first))
    expect(page.slider_box("Rotation (°)")).to_have_value("0")
    page.button("Redo").click()
    page.button("Redo").click()
    page.wait_for_picture(lambda p: np.array_equal(p, moved))
    expect(page.slider_box("x (cm)")).to_have_value("60")
    assert page.complaints == []


def test_the_page_is_dark_or_light_and_fits_a_tablet(open_page):
    page = open_page()
    page.settled_view()
    assert brightness(page) > 180
    page.page.keyboard.press("t")
    expect(page.frame.locator("html[data-mantine-color-scheme=dark]")).to_have_count(1)
    page.wait_for_view(lambda _: brightness(page) < 90)
    shoot(page, "dark")
    page.page.keyboard.press("t")
    page.wait_for_view(lambda _: brightness(page) > 180)
    shoot(page, "light")
    page.page.set_viewport_size({"width": 834, "height": 1112})
    page.page.reload()
    page.map.wait_for()
    page.settled_view()
    shoot(page, "tablet")
    shown, view = page.map.bounding_box(), page.frame.locator("canvas").first.bounding_box()
    assert shown
    assert view
    assert shown["y"] + shown["height"] < view["y"]  # one above the other
    assert min(shown["width"], shown["height"], view["width"], view["height"]) > 170
    assert page.complaints == []
