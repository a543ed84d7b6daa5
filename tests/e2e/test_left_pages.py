"""Nothing is lost: a page that is loaded again goes on where it was."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from playwright.sync_api import Browser, expect

from tests.app.robot_archives import panda_archive
from tests.e2e.conftest import free_port, start_app
from tests.e2e.page import WAIT, GraspPage


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


class Server:
    """A server that can be killed and started again at the same port."""

    def __init__(self, scene: str, caches: Path) -> None:
        self.scene, self.caches, self.port = scene, caches, free_port()
        self.process = start_app(scene, self.port, caches)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def restart(self, page: GraspPage, stored: str) -> None:
        """Kill it once a text has been stored of a page, which then notices, and start it again."""
        deadline = time.monotonic() + WAIT / 1000
        folder = self.caches / "symgrasp" / "pages"
        while not any(stored in path.read_text() for path in folder.glob("*.json")):
            assert time.monotonic() < deadline, "it was never stored"
            page.next_frame()
        self.kill()
        expect(page.page.locator("#title")).to_have_attribute("aria-busy", "true")
        self.process = start_app(self.scene, self.port, self.caches)
        # It starts processes that read the scene and verify the plan.
        ready = page.page.locator("#title[aria-busy=false]")
        expect(ready).to_be_visible(timeout=5 * WAIT)


@pytest.fixture
def server(tmp_path) -> Iterator[Server]:
    server = Server("pick_pour_place", tmp_path / "caches")
    yield server
    server.kill()


def test_a_page_goes_on_with_a_server_that_was_killed_and_started_again(browser: Browser, server, tmp_path):
    page = GraspPage(browser.new_page(), server.address)
    page.upload(save_can(tmp_path))
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value("tin.stl (upload)")
    page.expect_title("pick_pour_place")
    found = plan(page)
    page.expect_title("pick_pour_place")
    before = page.picture()
    server.restart(page, '"plan":"')
    page.expect_title("pick_pour_place")
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value("tin.stl (upload)")
    page.wait_for_picture(lambda picture: np.array_equal(picture, before))
    page.tab("Sequence")
    expect(page.text(found)).to_be_visible()
    page.page.reload()
    page.expect_title("pick_pour_place")
    page.tab("Sequence")
    expect(page.text(found)).to_be_visible()
    page.page.close()


def test_an_uploaded_robot_outlives_the_server(browser: Browser, server, tmp_path):
    page = GraspPage(browser.new_page(), server.address)
    page.expect_title("pick_pour_place")
    page.frame.get_by_text("Robot", exact=True).first.click()
    archive = tmp_path / "my panda.zip"
    archive.write_bytes(panda_archive())
    with page.page.expect_file_chooser() as chooser:
        page.button("Upload a robot").click()
    chooser.value.set_files(archive)
    expect(page.frame.get_by_label("Robot", exact=True)).to_have_value("my panda.zip (upload)")
    found = plan(page)
    page.expect_title("pick_pour_place")
    server.restart(page, '"plan":"')
    page.expect_title("pick_pour_place")
    expect(page.frame.get_by_label("Robot", exact=True)).to_have_value("my panda.zip (upload)")
    page.tab("Sequence")
    expect(page.text(found)).to_be_visible()  # verified with the robot where it lies now
    expect(page.alerts).to_have_count(0)
    page.page.close()
