"""The guided tour: every step does on the page what its words say."""

from __future__ import annotations

import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.server.session.tour import LOG, STORY
from tests.e2e.page import WAIT, GraspPage


def done(page: Page, step: int) -> str:
    """Wait until a step is done; gives what it says."""
    expect(page.locator("#tour-title")).to_contain_text(f"{step} of 6")
    expect(page.locator("#tour")).to_have_attribute("data-done", "true", timeout=4 * WAIT)
    return page.get_by_test_id("tour-said").inner_text()


INVITED = re.compile("New here")

NOTED = """(() => {
    window.letters = new Set();
    window.counts = [];
    const write = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
        if (this.canvas.id === "unroll") window.letters.add(text);
        return write.call(this, text, ...rest);
    };
    addEventListener("DOMContentLoaded", () => new MutationObserver(() => {
        const said = document.getElementById("tour-said")?.textContent ?? "";
        const visited = said.match(/^(\\d+) of \\d+ cells visited/);
        if (visited) window.counts.push(Number(visited[1]));
    }).observe(document.body, { childList: true, characterData: true, subtree: true }));
})();"""
"""Notes what is written on the object while it unrolls, and how many cells have been visited."""


def test_the_first_visit_is_invited_to_the_tour_and_later_ones_are_not(open_page):
    it: GraspPage = open_page("")
    page, invitation = it.page, it.page.locator("#invitation")
    expect(invitation).to_contain_text("New here?")
    it.expect_title(STORY)
    expect(invitation).to_be_visible()
    row, _ = it.shown_map.look["picked"]
    it.map.press("ArrowUp")  # the page can be used beside it
    it.wait_for_picture(lambda _: it.shown_map.look["picked"][0] == row + 1)
    page.reload()  # not answered yet
    it.expect_title(STORY)
    expect(invitation).to_be_visible()
    page.get_by_role("button", name="No, thanks").click()
    expect(invitation).to_be_hidden()
    expect(it.map).to_be_focused()
    for again in (page, page.context.new_page()):
        again.goto(page.url)
        expect(again.locator("#nothing")).to_be_hidden()
        expect(again.locator("#invitation")).to_be_hidden()
    assert it.complaints == []


def test_the_invitation_is_answered_by_any_way_into_the_tour(open_page):
    for way in ("Take the tour", "Tour"):
        it: GraspPage = open_page("")  # a browser of its own
        page, invitation = it.page, it.page.locator("#invitation")
        it.expect_title(STORY)
        page.get_by_role("button", name=way, exact=True).click()
        expect(page.locator("#tour-title")).to_contain_text("1 of 6")
        expect(invitation).to_be_hidden()
        page.get_by_role("button", name="Skip the tour").click()
        page.reload()
        expect(page.locator("#nothing")).to_be_hidden()
        expect(invitation).to_be_hidden()


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_the_tour_does_what_the_paper_says(open_page, motion):
    it: GraspPage = open_page("")
    page = it.page
    page.emulate_media(reduced_motion=motion)
    it.expect_title(STORY)
    next_step = page.get_by_role("button", name="Next", exact=True)
    page.get_by_role("button", name="Tour", exact=True).click()

    done(page, 1)
    expect(page.get_by_test_id("unroll")).to_be_hidden()
    words = page.locator("#tour-words")
    expect(words).to_contain_text("equations 1 and 2")

    next_step.press("Enter")
    picture = it.picture()
    said = done(page, 2)
    total, held = map(int, re.findall(r"of (\d+) cells visited, (\d+) feasible", said)[0])
    shown = dict(re.findall(r"(\w[\w ]*): (\d+)", "\n".join(it.shown_map.legend)))
    assert (total, held) == (sum(map(int, shown.values())), int(shown["feasible"]))
    expect(words).to_contain_text("Algorithm 1")

    next_step.click()
    assert "0 of 2304 cells differ" in done(page, 3)
    assert it.shown_map.look["delta"] == pytest.approx(np.pi / 3)
    turned = it.wait_for_picture(lambda seen: not np.array_equal(seen, picture))
    assert turned.shape == picture.shape
    expect(words).to_contain_text("equations 3 to 5")

    next_step.click()
    assert re.search(r"all 3 over each other: [1-9]\d* common cells?", done(page, 4))
    assert it.shown_map.look["plan"]["kind"] == "sequential"
    expect(words).to_contain_text("Algorithm 2")

    next_step.click()
    said = done(page, 5)
    assert re.match(
        r"prints are apart, after \d+ positions: [\d.]+ ms here, .*; 23 ms on average in the paper", said
    )
    it.expect_title(LOG)
    expect(words).to_contain_text("Algorithm 3")

    next_step.click()
    done(page, 6)
    it.expect_title(STORY)
    look = it.shown_map.look["plan"]
    assert look["position"] == look["duration"] > 1
    page.get_by_role("button", name="Finish").click()
    expect(page.locator("#tour")).to_be_hidden()
    assert it.complaints == []


def test_the_object_unrolls_with_its_letters_and_cells_fill_one_after_the_other(open_page):
    it: GraspPage = open_page("")
    page = it.page
    page.add_init_script(NOTED)
    page.reload()
    it.expect_title(STORY)
    page.get_by_role("button", name="Tour", exact=True).click()
    done(page, 1)
    assert set(page.evaluate("[...window.letters]")) == {"z", "a", "r", "h", "θ"}
    page.get_by_role("button", name="Next", exact=True).click()
    done(page, 2)
    counts = page.evaluate("window.counts")
    assert counts == sorted(counts)
    assert len(set(counts)) > 3


def test_every_step_is_one_sentence_that_names_its_equation_or_algorithm(open_page):
    it: GraspPage = open_page("")
    page = it.page
    page.get_by_role("button", name="Tour", exact=True).click()
    for step in range(1, 7):
        expect(page.locator("#tour-title")).to_contain_text(f"{step} of 6")
        words = page.locator("#tour-words").inner_text()
        assert re.fullmatch(r"[^.]+\.", words), words
        assert re.search(r"equations? \d|Algorithm \d", words), words
        if step < 6:
            page.get_by_role("button", name="Next", exact=True).click()  # without waiting for what it does
    page.get_by_role("button", name="Skip the tour").click()


def test_the_tour_can_be_left_gone_back_in_and_begun_from_the_palette(open_page):
    it: GraspPage = open_page("")
    page = it.page
    it.expect_title(STORY)
    page.get_by_role("button", name="Tour", exact=True).click()
    expect(page.get_by_test_id("unroll")).to_be_visible()
    page.get_by_role("button", name="Next", exact=True).click()  # while it unrolls
    expect(page.locator("#tour-title")).to_contain_text("2 of 6")
    expect(page.get_by_test_id("unroll")).to_be_hidden()
    page.get_by_role("button", name="Back", exact=True).click()
    expect(page.locator("#tour-title")).to_contain_text("1 of 6")
    page.keyboard.press("Escape")
    expect(page.locator("#tour")).to_be_hidden()
    expect(page.get_by_test_id("unroll")).to_be_hidden()
    page.keyboard.press("Control+k")
    it.frame.get_by_role("textbox").filter(visible=True).last.fill("Take the tour")
    it.frame.get_by_text("Take the tour").last.click()
    expect(page.locator("#tour-title")).to_contain_text("1 of 6")
    page.get_by_role("button", name="Skip the tour").click()
    expect(page.locator("#tour")).to_be_hidden()
    assert it.complaints == []
