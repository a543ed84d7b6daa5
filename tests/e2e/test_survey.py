"""A survey in the browser: it shows where the object can be held, and a click on a place takes it there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from symgrasp.scene.scene import Scene
from tests.e2e.page import GraspPage

SHOTS = Path(__file__).parent / "screenshots"
BOTTLE = Scene.load("bottle_on_table")
SPACING = 0.2


def test_a_click_on_a_place_takes_the_object_there(open_page):
    page: GraspPage = open_page()
    page.tab("Survey")
    page.slide("Spacing (cm)", 100 * SPACING)
    page.button("Try all places").click()
    expect(page.button("Stop")).to_be_visible()
    expect(page.button("Try all places")).to_be_visible()
    expect(page.frame.get_by_role("img", name="heat map of places of the object from above")).to_be_visible()
    page.settled_view()
    page.page.screenshot(path=SHOTS / "survey.png")
    page.click_3d(BOTTLE, np.array([0.6, 0.2, 0.0]))
    expect(page.slider_box("x (cm)")).to_have_value("60")
    expect(page.slider_box("y (cm)")).to_have_value("20")
    page.expect_title("pick")
    page.page.screenshot(path=SHOTS / "survey_clicked.png")
    # The picture takes clicks as well.
    place = page.frame.locator("[data-place='0']")
    x, y, width = (float(place.get_attribute(name) or "") for name in ("x", "y", "width"))
    place.click()
    expect(page.slider_box("x (cm)")).to_have_value(str(round(100 * (x + width / 2))))
    expect(page.slider_box("y (cm)")).to_have_value(str(round(-100 * (y + width / 2))))
    assert (x + width / 2, -y - width / 2) != pytest.approx((0.6, 0.2), abs=0.01)
    assert not page.complaints
