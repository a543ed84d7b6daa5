"""The time that the page takes to show a robot is measured where it is shown."""

from __future__ import annotations

from itertools import islice

from playwright.sync_api import expect

from app.server.session.tour import STORY
from docs.opening import VISITS, opened, visits
from docs.previews import previews


def test_a_robot_is_shown_when_it_is_measured(browser, tmp_path):
    with opened(browser, "ur5", tmp_path) as (page, seconds):
        page.expect_title("ur5")
        assert page.shown_map.picture() is not None
        assert seconds > 0
        assert not page.alerts.all()
        assert not page.complaints


def test_the_page_begins_with_the_arm_at_a_grasp(open_page):
    page = open_page("")
    page.expect_title(STORY)
    expect(page.text("panda holds it: feasible")).to_be_visible()
    assert page.shown_map.look["picked"]
    page.button("Let go").click()
    expect(page.text("No grasp picked")).to_be_visible()


def test_visits_are_measured_from_words_to_map(browser):
    times = list(visits(browser))
    assert len(times) == VISITS
    assert all(0 < visit.words < visit.map for visit in times)


def test_previews_are_measured_until_they_are_drawn(browser):
    times = list(islice(previews(browser), 3))
    assert len(times) == 3
    assert all(seconds > 0 for seconds in times)
