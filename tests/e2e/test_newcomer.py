"""The page in the hands of somebody who tries everything."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Browser, Error, Locator, expect

from tests.e2e.page import GraspPage

ACTIONS = 300
BRIEFLY = 1500
"""How long (ms) somebody waits for a widget that may just have gone."""

TABS = ("Grasp map", "Sequence", "Hands", "Files", "Grasp", "View")
SLIDERS = {
    "Rotation (°)": (-180, 180),
    "x (cm)": (30, 60),
    "y (cm)": (-40, 20),
    "z (cm)": (-5, 40),
    "Lean (°)": (0, 120),
    "Lean to (°)": (-180, 180),
    "Candidate": (1, 9),
    "Slide by δ (%)": (0, 100),
    "Solution": (1, 10),
    "Plan step": (1, 3),
    "Time (s)": (0, 10),
}
NUMBERS = {"h (cm)": (-2, 23), "θ (°)": (-180, 180)}
CHOICES = ("Scene", "Task", "Arm", "Roll", "Colours show", "Object", "Method", "Speed")
SWITCHES = ("Flat map", "Drag handles", "Handprint", "Compare", "Dark")
BUTTONS = (
    "Undo", "Redo", "Cancel", "Compute the map", "Put it back", "Let go", "One grasp for all tasks",
    "List more solutions", "With motion", "Play", "Pause", "Plan with 1 regrasp", "Make a link", "PNG",
    "Save the scene (YAML)", "Add a task after this one", "Earlier", "Later", "Remove",
)  # fmt: skip
KEYS = ("m", "r", "b", "l", "f", "g", "t", "p", "j", "k", "1", "2", "3", "PageDown", "PageUp", "Escape",
        "Control+z", "Control+Shift+z")  # fmt: skip
SEEN = ".sg:has(b:text('h = 10 cm'))"
"""What a fresh page says as well, beside what is around the map."""


class Newcomer:
    """Somebody who tries everything, in an order that a seed gives.

    Attributes:
        done: how often which kind of action was done.
    """

    def __init__(self, page: GraspPage, seed: int) -> None:
        self.page, self.chance = page, random.Random(seed)
        self.done: dict[str, int] = {}
        box = page.frame.locator("canvas").first.bounding_box()
        assert box
        self.box = box

    def act(self) -> None:
        """Do something, if it can be done right now."""
        kinds: list[Callable[[], bool]] = [
            self._tab, self._slide, self._number, self._choose, self._switch, self._button,
            self._button, self._key, self._key, self._click, self._drag,
        ]  # fmt: skip
        kind = self.chance.choice(kinds)
        try:
            if kind():
                self.done[kind.__name__] = self.done.get(kind.__name__, 0) + 1
        except Error as error:  # it went, or something came before it, while the hand was on its way
            assert "Timeout" in error.message, error

    def _tab(self) -> bool:
        return self._press(self.page.frame.get_by_role("tab", name=self.chance.choice(TABS), exact=True))

    def _slide(self) -> bool:
        label = self.chance.choice(list(SLIDERS))
        return self._enter(self.page.slider_box(label), SLIDERS[label])

    def _number(self) -> bool:
        label = self.chance.choice(list(NUMBERS))
        return self._enter(self.page.frame.get_by_label(label, exact=True), NUMBERS[label])

    def _enter(self, box: Locator, span: tuple[int, int]) -> bool:
        value = str(self.chance.randint(*span))
        if not box.count() or not box.is_visible():
            return False
        box.press("ControlOrMeta+a", timeout=BRIEFLY)
        box.press_sequentially(value, timeout=BRIEFLY)
        box.press("Enter", timeout=BRIEFLY)
        return True

    def _choose(self) -> bool:
        label, share = self.chance.choice(CHOICES), self.chance.random()
        widget = self.page.frame.get_by_label(label, exact=True).filter(visible=True)
        if not self._press(widget):
            return False
        options = self.page.frame.get_by_role("option").filter(visible=True)
        options.first.wait_for(timeout=BRIEFLY)
        return self._press(options.nth(int(share * options.count())))

    def _switch(self) -> bool:
        return self._press(self.page.frame.get_by_label(self.chance.choice(SWITCHES), exact=True))

    def _button(self) -> bool:
        return self._press(self.page.button(self.chance.choice(BUTTONS)).filter(visible=True))

    def _press(self, widget: Locator) -> bool:
        if widget.count() != 1 or not widget.is_visible() or not widget.is_enabled():
            return False
        widget.click(timeout=BRIEFLY)
        return True

    def _key(self) -> bool:
        self.page.frame.evaluate("document.activeElement?.blur()")
        self.page.page.keyboard.press(self.chance.choice(KEYS))
        return True

    def _click(self) -> bool:
        self.page.page.mouse.click(*self._point())
        return True

    def _drag(self) -> bool:
        mouse = self.page.page.mouse
        mouse.move(*self._point())
        mouse.down()
        mouse.move(*self._point(), steps=3)
        mouse.up()
        return True

    def _point(self) -> tuple[float, float]:
        """A pixel of the 3D view."""
        x, y = self.chance.uniform(0.05, 0.95), self.chance.uniform(0.2, 0.95)
        return self.box["x"] + x * self.box["width"], self.box["y"] + y * self.box["height"]


@pytest.mark.random_walk
def test_random_actions_end_in_the_picture_of_a_fresh_page(open_page, browser: Browser):
    page = open_page(scene="pick_pour_place")
    newcomer = Newcomer(page, seed=1)
    for k in range(2 * ACTIONS):
        newcomer.act()
        if sum(newcomer.done.values()) == ACTIONS:
            break
        if k % 20 == 0:
            assert not [text for text in page.alerts.all_inner_texts() if "unexpected" in text]
            assert page.complaints == []
    assert len(newcomer.done) == 9  # of every kind
    assert sum(newcomer.done.values()) == ACTIONS

    page.slide("Lean (°)", 12)  # whatever was planned, or is being planned, is for another pose
    page.tab("Grasp map")
    page.tab("View")
    for label in ("Handprint", "Compare"):
        page.frame.get_by_label(label, exact=True).uncheck()
    page.tab("Grasp")
    page.choose("Roll", "either")
    page.number("h (cm)", 10)
    expect(page.text("Ready.")).to_be_visible()
    expect(page.text("h = 10 cm")).to_be_visible()
    scene = page.frame.get_by_label("Scene", exact=True).input_value()
    page.expect_title(scene)
    page.tab("Files")
    page.button("Make a link").click()
    link = page.frame.locator(".sg-link")
    expect(link).to_have_attribute("href", re.compile("&h=10&"))  # there may be one from before
    address = link.get_attribute("href") or ""
    page.tab("Grasp map")
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    try:
        fresh = GraspPage(context.new_page(), address)
        fresh.expect_title(scene)
        expect(fresh.text("h = 10 cm")).to_be_visible()
        page.wait_for_picture(lambda p: np.array_equal(p, fresh.picture()))
        text = fresh.frame.locator(SEEN).filter(visible=True).first.text_content() or ""
        expect(page.frame.locator(SEEN).filter(visible=True).first).to_have_text(text)
        expect(page.page.locator("#title")).to_have_text(fresh.page.locator("#title").inner_text())
        expect(page.legend).to_have_text(fresh.legend.inner_text(), use_inner_text=True)
        assert page.complaints == fresh.complaints == []
    finally:
        context.close()


def test_poses_typed_for_one_task_after_another_are_all_kept(open_page):
    page = open_page(scene="pick_pour_place")
    page.slide("z (cm)", -11)
    page.choose("Task", "place")
    expect(page.slider_box("z (cm)")).to_have_value("0")
    page.slide("z (cm)", 16)
    page.expect_title("place")
    page.choose("Task", "pick")
    expect(page.slider_box("z (cm)")).to_have_value("-11")
    page.choose("Task", "place")
    expect(page.slider_box("z (cm)")).to_have_value("16")
    assert page.complaints == []
