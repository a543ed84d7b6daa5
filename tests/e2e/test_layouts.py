"""The page on a phone, a tablet and screens: the map and the view share the window, and nothing is cut."""

from __future__ import annotations

import pytest

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


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_map_and_the_view_share_every_window(open_page, dark):
    page = open_page()
    page.expect_title("bottle_on_table")
    if dark:
        page.page.keyboard.press("t")
        page.page.locator("html[data-theme=dark]").wait_for()
    for width, height in ((390, 844), (820, 1180), (1280, 800), (1920, 1080)):
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
