"""The time that the page takes to show a robot is measured where it is shown."""

from __future__ import annotations

from docs.opening import opened


def test_a_robot_is_shown_when_it_is_measured(browser, tmp_path):
    with opened(browser, "ur5", tmp_path) as (page, seconds):
        page.expect_title("ur5")
        assert page.shown_map.picture() is not None
        assert seconds > 0
        assert not page.alerts.all()
        assert not page.complaints
