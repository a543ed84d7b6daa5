"""A survey in the browser: it shows where the object can be held, and a click on a place takes it there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from app.compute.cache import SharedCache
from app.server.door.lobby import Lobby, open_lobby
from app.server.door.viser_server import any_port
from app.state.state import State
from app.state.surveys.survey import Stand, SurveyRun
from app.state.surveys.survey_changes import places_arrived, survey_ended, survey_started
from symgrasp.scene.scene import Scene
from symgrasp.survey.placement import Base
from tests.app.surveyed import surveyed
from tests.e2e.page import WAIT, GraspPage

SHOTS = Path(__file__).parent / "screenshots"
BOTTLE = Scene.load("bottle_on_table")
SPACING = 0.2
LONGEST = 10 * WAIT
"""Longest wait (ms) for a survey."""


def test_a_click_on_a_place_takes_the_object_there(open_page):
    page: GraspPage = open_page()
    page.tab("Survey")
    page.slide("Spacing (cm)", 100 * SPACING)
    page.button("Try all places").click()
    # Computed in the background, while nobody else computes; the button is another one until it is done.
    heat_map = page.frame.get_by_role("img", name="heat map of places of the object from above")
    expect(heat_map).to_be_visible(timeout=LONGEST)
    expect(page.button("Try all places")).to_be_visible(timeout=LONGEST)
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


@pytest.fixture
def lobby() -> Iterator[tuple[Lobby, str]]:
    """A server in this process, whose sessions can be shown what a long survey finds, and its address."""
    port = any_port()
    with open_lobby(SharedCache("bottle_on_table"), "127.0.0.1", port) as lobby:
        yield lobby, f"http://127.0.0.1:{port}"


def test_the_best_bases_are_ghosts_and_a_click_puts_the_robot_there(browser: Browser, lobby):
    sessions, address = lobby
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    try:
        page = GraspPage(context.new_page(), f"{address}/?scene=bottle_on_table")
        page.tab("Survey")
        page.choose("Where to put", "the robot")
        (session,) = sessions._sessions.values()
        before = page.settled_view()
        stand = Stand(Base(0.15, 0.45, 0.0, 0.0), 0.02)
        places = surveyed("robot").survey.places
        assert places
        places = replace(places, xy=np.array([[0.9, 0.4], [0.9, 0.0]]))

        def found(state: State) -> State:
            state = survey_started(state, 7, state.survey_request)
            state = places_arrived(state, SurveyRun(7, "Bases", 2, 2, 1.0), places)
            return survey_ended(state, 7, (stand,))

        session.change(found)
        page.wait_for_change(before, share=0.002)
        expect(page.text("Planned and verified from each of them.")).to_be_visible()
        page.page.screenshot(path=SHOTS / "survey_ghosts.png")
        shown = page.settled_view()
        page.frame.get_by_label("Show in 3D").uncheck()
        page.wait_for_change(shown, share=0.002)
        hidden = page.settled_view()
        page.frame.get_by_label("Show in 3D").check()
        page.wait_for_change(hidden, share=0.002)
        page.click_3d(BOTTLE, np.array([0.15, 0.45, 0.1]))
        page.frame.get_by_text("Robot", exact=True).first.click()
        expect(page.frame.get_by_label("Base x (cm)")).to_have_value("15")
        expect(page.frame.get_by_label("Base y (cm)")).to_have_value("45")
        assert not page.complaints
    finally:
        context.close()
