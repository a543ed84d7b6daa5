"""The page in the hands of somebody who tries everything."""

from __future__ import annotations

from playwright.sync_api import expect


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
