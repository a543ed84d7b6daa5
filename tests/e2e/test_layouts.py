"""The page on a phone, a tablet and screens: the map and the view share the window, and nothing is cut."""

from __future__ import annotations

import itertools
from contextlib import closing

import pytest
from playwright.sync_api import expect

from tests.e2e.page import GraspPage

WORDS = ("#title", "#turn", "#map", "#legend li", "#legend li span", "#legend li small", "#counted")
"""What stands in the pane of the map."""

CUT = """words => {
    const pane = document.querySelector("#pane").getBoundingClientRect();
    return words.flatMap(word => [...document.querySelectorAll(word)].filter(element => {
        const box = element.getBoundingClientRect();
        const inside = box.left >= pane.left && box.right <= pane.right
            && box.top >= pane.top && box.bottom <= pane.bottom;
        return !inside || element.scrollWidth > element.clientWidth + 1 && element.clientWidth > 0;
    }).map(element => `${word}: ${element.textContent}`));
}"""
"""Lists which of them are not wholly in it."""

TABS = ("Grasp map", "Sequence", "Hands", "Survey", "Files")

SIZES = ((390, 844), (820, 1180), (1280, 800), (1920, 1080))

PANELS = "[data-dock-leaf], .mantine-Paper-root:has(> * .mantine-ScrollArea-content .mantine-Tabs-root)"
"""viser's panels, and the one in which it has all of them on a phone."""


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_map_and_the_view_share_every_window(open_page, dark):
    page = open_page()
    page.expect_title("bottle_on_table")
    if dark:
        page.page.keyboard.press("t")
        page.page.locator("html[data-theme=dark]").wait_for()
    for width, height in SIZES:
        page.page.set_viewport_size({"width": width, "height": height})
        page.next_frame()
        pane, view = page.page.locator("#pane").bounding_box(), page.page.locator("#view").bounding_box()
        shown = page.map.bounding_box()
        assert pane
        assert view
        assert shown
        if width < 1000:  # one above the other, each as wide as the window
            assert pane["width"] == view["width"] == width
            assert pane["y"] + pane["height"] <= view["y"]
        else:  # side by side, each as high as the window
            assert pane["height"] == view["height"] == height
            assert pane["x"] + pane["width"] <= view["x"]
        bar = width * height - pane["width"] * pane["height"] - view["width"] * view["height"]
        assert 0 <= bar < 12 * max(width, height)  # the splitter takes the rest
        assert shown["width"] > 0.8 * pane["width"]
        assert shown["height"] > 0.4 * pane["height"]
        assert page.page.evaluate(CUT, WORDS) == []
    assert page.complaints == []


@pytest.mark.parametrize("size", SIZES, ids=[str(width) for width, _ in SIZES])
def test_map_view_and_panels_do_not_cover_each_other(open_page, size):
    page = open_page(size=size)
    page.expect_title("bottle_on_table")
    width, height = size
    boxes = [page.page.locator("#pane").bounding_box(), page.frame.locator("canvas").first.bounding_box()]
    boxes += [panel.bounding_box() for panel in page.frame.locator(PANELS).filter(visible=True).all()]
    assert len(boxes) > 2  # whose edges may be between pixels
    for box in boxes:
        assert box["width"] > 250
        assert box["height"] > 150
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= width + 1
        assert box["y"] + box["height"] <= height + 1
    for a, b in itertools.combinations(boxes, 2):
        across = min(a["x"] + a["width"], b["x"] + b["width"]) - max(a["x"], b["x"])
        along = min(a["y"] + a["height"], b["y"] + b["height"]) - max(a["y"], b["y"])
        assert min(across, along) < 1, (a, b)
    for frame in (page.page, page.frame):
        assert frame.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    tabs = [page.frame.get_by_role("tab", name=name, exact=True) for name in TABS]
    assert len({round(tab.bounding_box()["y"]) for tab in tabs}) == 1  # in one row
    for tab in tabs:
        tab.click()
        expect(tab).to_have_attribute("aria-selected", "true")
        box = tab.bounding_box()
        assert box["x"] + box["width"] <= width
    assert page.complaints == []


DRAWN_BY_THE_PROCESSOR = """for (const context of [WebGLRenderingContext, WebGL2RenderingContext]) {
    const ask = context.prototype.getParameter;
    context.prototype.getParameter = function (name) {
        return name === 0x9246 ? "llvmpipe" : ask.call(this, name); // UNMASKED_RENDERER_WEBGL
    };
}"""
"""Lets WebGL say that it has no graphics card, whatever it has."""


@pytest.mark.parametrize("size", SIZES, ids=[str(width) for width, _ in SIZES])
def test_the_notice_of_slow_drawing_does_not_stay_before_the_view(browser, start_server, size):
    width, height = size
    with closing(browser.new_context(viewport={"width": width, "height": height})) as context:
        context.add_init_script(DRAWN_BY_THE_PROCESSOR)
        page = GraspPage(context.new_page(), start_server("bottle_on_table"))
        notice = page.frame.locator(".mantine-Notification-root", has_text="Software WebGL")
        expect(notice).to_have_count(1)
        expect(notice).to_be_hidden(timeout=30_000)
