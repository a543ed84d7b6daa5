"""A person brings another robot: from the list, by an upload, to another place, into a file and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from app.files.archives import pack, unpack
from app.files.plan_formats import FORMATS
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.scene.scene import Scene
from tests.app.robot_archives import panda_archive
from tests.e2e.page import GraspPage

BOTTLE = Scene.load("bottle_on_table")

HANDLE = np.array([0.073, 0.073, 0.0])
"""Where (m) the handle that slides the robot over the ground is, from its base."""


def open_robot_folder(page: GraspPage) -> None:
    page.frame.get_by_text("Robot", exact=True).first.click()
    expect(page.button("Upload a robot")).to_be_visible()


def upload(page: GraspPage, button: str, path: Path) -> None:
    with page.page.expect_file_chooser() as chooser:
        page.button(button).click()
    chooser.value.set_files(path)


def test_a_robot_from_the_list_and_back(open_page):
    page = open_page()
    page.expect_title("panda")
    open_robot_folder(page)
    page.choose("Robot", "KUKA LBR iiwa 7")
    page.expect_title("iiwa")
    assert not page.alerts.all()
    open_page().expect_title("panda")  # another browser sees nothing of it
    page.number("Base x (cm)", 12.5)
    expect(page.frame.get_by_label("Base x (cm)")).to_have_value("12.5")
    page.expect_title("iiwa")
    page.button("Undo").click()
    page.button("Undo").click()
    page.expect_title("panda")
    assert not page.complaints


@pytest.mark.parametrize("size", [(820, 1000), (390, 844)])
def test_nothing_of_the_panel_is_cut_off(open_page, size):
    page = open_page(size=size, wait_for_map=False)
    expect(page.text("Ready.")).to_be_visible()
    open_robot_folder(page)
    for label in ("Robot", "Tool link", "Hand", "Base x (cm)", "Base turn (°)", "Base handles"):
        box = page.frame.get_by_label(label, exact=True).filter(visible=True).bounding_box()
        assert box
        assert 0 < box["x"] < box["x"] + box["width"] < size[0]
    text = page.button("Upload a robot").locator("span", has_text="Upload a robot").last
    assert text.evaluate("span => span.scrollWidth <= span.clientWidth")


def test_the_base_is_dragged_saved_and_put_back(open_page, tmp_path):
    page = open_page(size=(1280, 720))
    page.expect_title("panda")
    before = page.picture()
    open_robot_folder(page)
    page.frame.get_by_label("Base handles").check()
    page.drag_3d(BOTTLE, HANDLE, HANDLE + np.array([0.1, 0.0, 0.0]))
    page.settled_view()
    page.expect_title("panda")
    shown = page.frame.get_by_label("Base x (cm)").input_value()
    x = float(shown)
    assert x == pytest.approx(10.0, abs=1.5)
    assert float(page.frame.get_by_label("Base z (cm)").input_value()) == pytest.approx(0.0, abs=1e-3)
    assert not np.array_equal(page.picture(), before)
    page.tab("Files")
    with page.page.expect_download() as download:
        page.button("Save the scene (YAML)").click()
    saved = tmp_path / "moved.yaml"
    download.value.save_as(saved)
    saved_x = 100 * Scene.load(saved).robots["panda"].T_world_base[0, 3]
    assert saved_x == pytest.approx(x, abs=0.05)  # a digit behind the point is shown
    page.tab("Grasp map")
    page.button("Undo").click()  # on a slow machine a drag may be several steps
    expect(page.frame.get_by_label("Base x (cm)")).not_to_have_value(shown)
    assert not page.complaints


def upload_panda(page, folder):
    """Upload a robot, and wait until the map is of it."""
    robot = folder / "my panda.zip"
    robot.write_bytes(panda_archive())
    upload(page, "Upload a robot", robot)
    expect(page.frame.get_by_label("Robot", exact=True)).to_have_value("my panda.zip (upload)")
    page.expect_title("panda")


def test_an_uploaded_robot_goes_into_a_file_and_opens_again(open_page, tmp_path):
    page = open_page()
    page.expect_title("panda")
    open_robot_folder(page)
    bad = tmp_path / "bad.zip"
    bad.write_bytes(pack([("../evil.urdf", b"<robot/>")]))
    upload(page, "Upload a robot", bad)
    expect(page.alerts.first).to_contain_text("a relative path without '..'")
    page.expect_title("panda")  # nothing of the scene is lost
    upload_panda(page, tmp_path)
    page.tab("Files")
    with page.page.expect_download() as download:
        page.button("Save the scene (YAML)").click()
    saved = tmp_path / download.value.suggested_filename
    assert saved.suffix == ".zip"
    download.value.save_as(saved)
    page.button("Make a link").click()
    expect(page.alerts.first).to_contain_text("save the scene instead")
    another = open_page()
    another.tab("Files")
    upload(another, "Open a scene (YAML or ZIP)", saved)
    expect(another.frame.get_by_label("Scene", exact=True)).to_have_value(f"{saved.name} (upload)")
    assert not page.complaints


def test_a_plan_of_an_uploaded_robot_goes_out_in_every_format_and_opens_again(open_page, tmp_path):
    page = open_page()
    page.expect_title("panda")
    open_robot_folder(page)
    upload_panda(page, tmp_path)
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 1 task: h = ")).to_be_visible()
    saved = {}
    for name in ("JSON", "CSV", "Trajectory", "TSR"):
        page.choose("Format", name)
        with page.page.expect_download() as download:
            page.button("Download plan").click()
        saved[name] = tmp_path / download.value.suggested_filename
        download.value.save_as(saved[name])
    assert saved["JSON"].suffix == ".zip"
    (tmp_path / "unpacked").mkdir()
    unpack(saved["JSON"].name, saved["JSON"].read_bytes(), tmp_path / "unpacked")
    plan = Plan.load(tmp_path / "unpacked" / f"{saved['JSON'].stem}.json")
    assert verify(plan).holds
    for name in ("CSV", "Trajectory", "TSR"):
        assert saved[name].read_text(encoding="utf-8") == FORMATS[name][1](plan)

    another = open_page("soda_can")
    another.tab("Sequence")
    upload(another, "Open a plan", saved["JSON"])
    expect(another.text(f"{saved['JSON'].name} holds: ")).to_be_visible()
    expect(another.frame.get_by_label("Scene", exact=True)).to_have_value(f"{saved['JSON'].name} (upload)")
    another.expect_title("panda")
    another.tab("Files")
    upload(another, "Open a scene (YAML or ZIP)", saved["JSON"])  # the other button takes it as well
    another.tab("Sequence")
    expect(another.text("One grasp for 1 task: h = ")).to_be_visible()
    assert not another.alerts.all()
    alone = tmp_path / "unpacked" / f"{saved['JSON'].stem}.json"
    upload(another, "Open a plan", alone)
    expect(another.alerts).to_contain_text("a file in the same ZIP file as the plan")
    assert page.complaints == another.complaints == []
