"""Nothing is lost: a page that is loaded again goes on where it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from playwright.sync_api import expect

from tests.e2e.page import GraspPage


def plan(page: GraspPage) -> str:
    """Plan one grasp for all tasks; return what is said of it."""
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    return page.text("One grasp for 3 tasks: h = ").inner_text()


def save_can(to: Path) -> Path:
    """Save the mesh of a can of a radius of 32 mm."""
    mesh = trimesh.creation.cylinder(radius=0.032, height=0.12, sections=64)
    mesh.apply_translation([0.0, 0.0, 0.06])
    mesh.export(to / "tin.stl")
    return to / "tin.stl"


def test_a_reload_loses_nothing(open_page, tmp_path):
    page = open_page(scene="pick_pour_place")
    page.upload(save_can(tmp_path))
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value("tin.stl (upload)")
    page.expect_title("pick_pour_place")
    found = plan(page)
    page.slide("Rotation (°)", 35)
    page.expect_title("pick_pour_place")
    before = page.picture()
    page.page.reload()
    page.expect_title("pick_pour_place")
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value("tin.stl (upload)")
    expect(page.slider_box("Rotation (°)")).to_have_value("35")
    page.wait_for_picture(lambda picture: np.array_equal(picture, before))
    page.tab("Sequence")
    expect(page.text(found)).to_be_visible()
    page.page.keyboard.press("ControlOrMeta+z")  # the turn
    expect(page.slider_box("Rotation (°)")).not_to_have_value("35")
    for _ in range(2):  # the plan, and the mesh
        page.page.keyboard.press("ControlOrMeta+z")
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value("the scene's own")
    expect(page.text(found)).to_have_count(0)
    assert page.complaints == []


def test_a_duplicated_tab_does_not_change_the_first(open_page):
    page = open_page()
    page.slide("Rotation (°)", 35)
    page.expect_title("bottle_on_table")
    with page.page.expect_popup() as opened:  # as duplicated tabs do, it begins with the storage of the first
        page.page.evaluate("() => { window.open(location.href); }")
    copy = GraspPage(opened.value, opened.value.url)
    expect(copy.slider_box("Rotation (°)")).to_have_value("35")
    copy.slide("Rotation (°)", -50)
    copy.expect_title("bottle_on_table")
    page.page.reload()
    expect(page.slider_box("Rotation (°)")).to_have_value("35")
    copy.page.reload()
    expect(copy.slider_box("Rotation (°)")).to_have_value("-50")


def test_a_link_that_is_opened_again_shows_what_it_says(open_page):
    page = open_page()
    address = f"{page.page.url}?turn=20"
    page.page.goto(address)
    expect(page.slider_box("Rotation (°)")).to_have_value("20")
    page.slide("Rotation (°)", 35)
    page.expect_title("bottle_on_table")
    page.page.reload()
    expect(page.slider_box("Rotation (°)")).to_have_value("35")
    page.page.goto(address)
    expect(page.slider_box("Rotation (°)")).to_have_value("20")
