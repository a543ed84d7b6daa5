"""Scenes saved and opened again, links, the 3D view as a file; and what hostile files can do: nothing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pybullet_data
import yaml
from playwright.sync_api import Browser, expect

from app.render.palette import rgb
from symgrasp.feasibility.create import create_map
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from tests.e2e.page import GraspPage
from tests.e2e.test_keyboard import shoot
from tests.e2e.test_page import drawn

HOSTILE = '<img src=x onerror="window.hacked=1">'
SCRIPT = "<script>window.hacked=1</script>"


def files(page: GraspPage) -> None:
    page.frame.get_by_role("tab", name="Files").click()


def maps(page: GraspPage) -> None:
    page.frame.get_by_role("tab", name="Grasp map").click()


def download(page: GraspPage, button: str, to: Path) -> Path:
    with page.page.expect_download() as started:
        page.button(button).click()
    path = to / started.value.suggested_filename
    started.value.save_as(path)
    return path


def open_scene(page: GraspPage, path: Path) -> None:
    with page.page.expect_file_chooser() as chooser:
        page.button("Open a scene (YAML or ZIP)").click()
    chooser.value.set_files(path)


def test_a_scene_is_saved_as_it_was_changed_and_opened_again(open_page, tmp_path):
    page = open_page()
    page.choose("Object", "wine_bottle")
    expect(page.text("the wine_bottle turns")).to_be_visible()
    page.slide("x (cm)", 50)
    page.expect_title("bottle_on_table")
    seen = page.picture()
    files(page)
    path = download(page, "Save the scene (YAML)", tmp_path)
    saved = Scene.load(path)
    assert saved.file.object.name == "wine_bottle"
    assert np.array_equal(seen, drawn(create_map(saved)))
    page.choose("Scene", "soda_can")
    expect(page.text("the can turns")).to_be_visible()
    open_scene(page, path)
    expect(page.frame.get_by_label("Scene", exact=True)).to_have_value(f"{path.name} (upload)")
    maps(page)
    page.expect_title("bottle_on_table")
    page.wait_for_picture(lambda p: np.array_equal(p, seen))
    page.choose("Object", "tennis_ball")  # into the scene that was uploaded, and back
    expect(page.text("the tennis_ball turns")).to_be_visible()
    page.choose("Object", "the scene's own")
    page.wait_for_picture(lambda p: np.array_equal(p, seen))
    page.choose("Scene", "soda_can")
    page.expect_title("soda_can")
    page.choose("Scene", f"{path.name} (upload)")
    page.wait_for_picture(lambda p: np.array_equal(p, seen))
    assert page.complaints == []


def test_a_link_opens_the_page_as_it_was(open_page, browser: Browser):
    page = open_page(scene="pick_pour_place")
    page.choose("Task", "pour")
    page.slide("x (cm)", 52)
    page.slide("Rotation (°)", -40)
    page.number("h (cm)", 12)
    page.number("θ (°)", 60)
    page.expect_title("· pour ·")
    expect(page.text("h = 12 cm, θ = 60°")).to_be_visible()  # each number is answered in its turn
    seen, held = page.picture(), page.frame.locator(".sg", has_text="h = 12 cm").inner_text()
    files(page)
    page.button("Make a link").click()
    address = page.frame.locator(".sg-link").get_attribute("href") or ""
    assert re.match(r"http://127\.0\.0\.1:\d+/\?scene=pick_pour_place&task=pour&", address)
    shoot(page, "files")
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    try:
        other = GraspPage(context.new_page(), address)
        other.expect_title("pick_pour_place · pour · panda")
        other.wait_for_picture(lambda p: np.array_equal(p, seen))
        expect(other.text("h = 12 cm")).to_be_visible()
        assert other.frame.locator(".sg", has_text="h = 12 cm").inner_text() == held
        expect(other.slider_box("Rotation (°)")).to_have_value("-40")
        expect(other.frame.get_by_label("Scene", exact=True)).to_have_value("pick_pour_place")
        wrong = GraspPage(context.new_page(), address.split("?")[0] + f"?scene={SCRIPT}")
        expect(wrong.alerts).to_contain_text("expected one of")  # and the first scene is there all the same
        assert wrong.frame.evaluate("window.hacked") is None
        assert page.complaints == other.complaints == wrong.complaints == []
    finally:
        context.close()


def test_the_3d_view_is_one_file_that_needs_no_network(open_page, browser: Browser, tmp_path):
    page = open_page()
    files(page)
    path = download(page, "Save the 3D view (HTML)", tmp_path)
    expect(page.text("Ready.")).to_be_visible()
    context = browser.new_context(viewport={"width": 900, "height": 700}, offline=True)
    try:
        alone = context.new_page()
        asked: list[str] = []
        alone.on("request", lambda r: asked.append(r.url) if r.url.startswith(("http", "ws")) else None)
        alone.goto(path.as_uri())
        view = GraspPage.__new__(GraspPage)  # looks at a page that is none of the server's
        view.page = alone
        green = rgb(Reason.FEASIBLE.color)
        view.wait_for_view(lambda v: (np.abs(v.astype(int) - green).max(axis=-1) < 25).sum() > 300)
        shoot(view, "saved_view")
        assert asked == []
    finally:
        context.close()


def test_what_a_hostile_scene_says_is_shown_as_text(open_page, content, tmp_path):
    page = open_page()
    content["name"] = content["description"] = SCRIPT
    content["object"]["name"] = HOSTILE
    content["robots"][0]["name"] = HOSTILE + "robot"
    content["tasks"][0]["name"] = HOSTILE + "task"
    for obstacle in content["obstacles"]:
        obstacle["name"] = SCRIPT + obstacle["name"]
    content["obstacles"].append(
        {"name": "sunk", "box": [0.02, 0.02, 0.02], "pose": {"position": [0.7, 0.4, 0.2]}}
    )
    path = tmp_path / (HOSTILE.replace("/", "") + ".yaml")
    path.write_text(yaml.safe_dump(content))
    files(page)
    open_scene(page, path)
    expect(page.text(f"the {HOSTILE} turns")).to_be_visible()
    expect(page.frame.get_by_label("Scene", exact=True)).to_have_value(f"{path.name} (upload)")
    maps(page)
    page.expect_title(f"{SCRIPT} · {HOSTILE}task · {HOSTILE}robot")
    page.number("h (cm)", 4)
    page.number("θ (°)", 90)
    expect(page.text("cannot hold it here: hits an obstacle")).to_contain_text(f"{HOSTILE}robot")
    expect(page.text("mm too close").first).to_contain_text(f"and {SCRIPT}")
    page.slide("z (cm)", -3)
    expect(page.alerts).to_contain_text(f"30 mm inside {SCRIPT}table")
    page.button("Undo").click()
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text(f"{HOSTILE}robot: {HOSTILE}task")).to_be_visible()
    expect(page.text("One grasp for 1 task")).to_be_visible()
    page.page.keyboard.press("Control+k")
    expect(page.text(f"Task {HOSTILE}task")).to_be_visible()
    page.page.keyboard.press("Escape")
    files(page)
    assert Scene.load(download(page, "Save the scene (YAML)", tmp_path)).name == SCRIPT
    page.button("Make a link").click()
    expect(page.alerts).to_contain_text("link: scene: 'an upload'")
    content["robots"][0]["urdf"] = HOSTILE
    path.write_text(yaml.safe_dump(content))
    open_scene(page, path)
    expect(page.alerts).to_contain_text(
        f"robots[0].urdf: '{HOSTILE}': expected a file of an installed package"
    )
    assert page.frame.evaluate("window.hacked") is None
    assert page.complaints == []


def test_a_scene_that_asks_for_the_servers_files_is_refused(open_page, content, tmp_path):
    page = open_page()
    secret = Path(pybullet_data.getDataPath(), "objects", "mug.obj")
    content["obstacles"].append({"name": "rock", "mesh": str(secret)})
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    files(page)
    open_scene(page, path)
    expect(page.alerts).to_contain_text("mine.yaml: obstacles[3].mesh:")
    expect(page.alerts).to_contain_text("expected a file of an installed package")
    expect(page.frame.get_by_label("Scene", exact=True)).to_have_value("bottle_on_table")
    large = tmp_path / "large.yaml"
    large.write_bytes(bytes(1_000_001))
    open_scene(page, large)
    expect(page.alerts).to_contain_text(
        "large.yaml: size of the file: 1.0 MB: expected a scene of at most 1 MB"
    )
    maps(page)
    page.expect_title("bottle_on_table")
    assert page.complaints == []
