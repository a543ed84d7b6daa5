"""What is written on the page can be read, light and dark, and is not cut."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from app.render.palette import rgb
from symgrasp.reason import Reason

TABS = ("Grasp map", "Sequence", "Hands", "Survey", "Files")

CONTRAST = 4.5
"""Of small text with what is behind it, at least (WCAG 2.2, success criterion 1.4.3)."""

FAINT = """least => {
    const channels = (color) => {
        const [r, g, b, a = 1] = color.match(/[\\d.]+/g).map(Number);
        return [r, g, b, a];
    };
    const light = ([r, g, b]) => [r, g, b].map((value) => value / 255)
        .map((value) => value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4)
        .reduce((sum, value, k) => sum + value * [0.2126, 0.7152, 0.0722][k], 0);
    const over = (top, back) => back.map((value, k) => top[3] * top[k] + (1 - top[3]) * value);
    const behind = (element) => {
        if (!element) return [255, 255, 255];
        const own = channels(getComputedStyle(element).backgroundColor);
        return own[3] === 1 ? own.slice(0, 3) : over(own, behind(element.parentElement));
    };
    const opacity = (element) =>
        element ? Number(getComputedStyle(element).opacity) * opacity(element.parentElement) : 1;
    const found = [];
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (texts.nextNode()) {
        const element = texts.currentNode.parentElement, text = texts.currentNode.textContent.trim();
        if (!text || !element.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
        if (element.closest("style, script, :disabled, [data-disabled], [aria-disabled=true]")) continue;
        if (element.closest(".mantine-Notification-root, .mantine-Slider-root, svg, canvas")) continue;
        const range = document.createRange();
        range.selectNodeContents(texts.currentNode);
        const box = range.getBoundingClientRect();
        if (!box.width || !box.height) continue;
        const back = behind(element), [r, g, b, a] = channels(getComputedStyle(element).color);
        const ink = over([r, g, b, a * opacity(element)], back);
        const [dim, bright] = [light(ink), light(back)].sort((x, y) => x - y);
        const contrast = (bright + 0.05) / (dim + 0.05);
        if (contrast < least) found.push(`${text.slice(0, 40)}: ${contrast.toFixed(2)}`);
    }
    return [...new Set(found)];
}"""
"""Lists the texts whose contrast is less than that."""


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_every_text_has_contrast(open_page, dark):
    page = open_page("pick_pour_place")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.button("Download plan")).to_be_visible()
    expect(page.text("Ready.")).to_be_visible()
    if dark:
        page.page.locator("#title").click()
        page.page.keyboard.press("t")
        page.page.locator("html[data-theme=dark]").wait_for()
        page.frame.locator("html[data-mantine-color-scheme=dark]").wait_for()
    faint: dict[str, list[str]] = {"map": page.page.evaluate(FAINT, CONTRAST)}
    for tab in TABS:
        page.tab(tab)
        expect(page.frame.get_by_role("tab", name=tab, exact=True)).to_have_attribute("aria-selected", "true")
        faint[tab] = page.frame.evaluate(FAINT, CONTRAST)
    assert not any(faint.values()), faint
    assert page.complaints == []


EDGE = """canvas => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, 1);
    return data.filter((value, k) => k % 4 === 3 && value).length;
}"""
"""Counts the pixels of the uppermost row that something is drawn on."""

CELLS = """(canvas, colors) => {
    const { data } = canvas.getContext("2d").getImageData(canvas.width / 2, 0, 1, canvas.height);
    let rows = 0;
    for (let k = 0; k < data.length; k += 4) rows += colors.includes(data.slice(k, k + 3).join());
    return rows / devicePixelRatio;
}"""
"""Counts the pixels of the middle column that have a colour of a cell."""


@pytest.mark.parametrize("size", [(390, 844), (820, 1180), (1280, 800)], ids=["390", "820", "1280"])
def test_maps_of_a_long_object_have_room_and_no_tick_is_cut(open_page, size):
    page = open_page("log_two_robots", size=size)
    page.tab("Hands")
    page.button("All arms together").click()
    expect(page.page.get_by_test_id("together")).to_have_text(re.compile("gap"))
    layers = page.page.locator("#stack canvas")
    expect(layers).to_have_count(2)
    colors = [",".join(str(value) for value in rgb(reason.color)) for reason in Reason]
    for canvas in (page.map, *layers.all()):
        page.wait_for_view(lambda _, canvas=canvas: canvas.evaluate(CELLS, colors) > 65)
        assert canvas.evaluate(EDGE) == 0
    assert page.complaints == []
