"""A person brings another robot: from the list, by an upload, to another place, into a file and back."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import expect

from app.files.archives import pack
from tests.app.robot_archives import panda_archive
from tests.e2e.page import GraspPage


def open_robot_folder(page: GraspPage) -> None:
    page.page.get_by_text("Robot", exact=True).first.click()
    expect(page.button("Upload a robot (ZIP or URDF)")).to_be_visible()


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
    page.number("Base x (cm)", 12.5)
    expect(page.page.get_by_label("Base x (cm)")).to_have_value("12.5")
    page.expect_title("iiwa")
    page.button("Undo").click()
    page.button("Undo").click()
    page.expect_title("panda")
    assert not page.complaints


def test_an_uploaded_robot_goes_into_a_file_and_opens_again(open_page, tmp_path):
    page = open_page()
    page.expect_title("panda")
    open_robot_folder(page)
    bad = tmp_path / "bad.zip"
    bad.write_bytes(pack([("../evil.urdf", b"<robot/>")]))
    upload(page, "Upload a robot (ZIP or URDF)", bad)
    expect(page.alerts.first).to_contain_text("a relative path without '..'")
    page.expect_title("panda")  # nothing of the scene is lost
    good = tmp_path / "my panda.zip"
    good.write_bytes(panda_archive())
    upload(page, "Upload a robot (ZIP or URDF)", good)
    expect(page.page.get_by_label("Robot", exact=True)).to_have_value("my panda.zip (upload)")
    page.expect_title("panda")
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
    expect(another.page.get_by_label("Scene", exact=True)).to_have_value(f"{saved.name} (upload)")
    assert not page.complaints
