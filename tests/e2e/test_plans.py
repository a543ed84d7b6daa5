"""Sequences, several hands and plan files on the page, as somebody walks through them."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from playwright.sync_api import Locator, expect

from app.files.scene_files import scene_yaml
from app.state.plans.plan_results import FIRST_SEED
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from symgrasp.scene.scene import Scene
from tests.app.caught import caught_content
from tests.conftest import write_scene
from tests.e2e.page import GraspPage

SCREENSHOTS = Path(__file__).parent / "screenshots"


def shoot(page: GraspPage, name: str) -> None:
    SCREENSHOTS.mkdir(exist_ok=True)
    page.page.screenshot(path=SCREENSHOTS / f"{name}.png")


def shown(page: GraspPage, selector: str) -> Locator:
    return page.frame.locator(selector).filter(visible=True)


def chosen(page: GraspPage, label: str) -> Locator:
    return page.frame.get_by_label(label, exact=True).filter(visible=True)


def download(page: GraspPage, form: str, to: Path) -> Path:
    page.choose("Format", form)
    with page.page.expect_download() as found:
        page.button("Download plan").click()
    path = to / found.value.suggested_filename
    found.value.save_as(path)
    return path


def open_plan(page: GraspPage, path: Path) -> None:
    with page.page.expect_file_chooser() as chooser:
        page.button("Open a plan").click()
    chooser.value.set_files(path)


def test_a_sequence_is_planned_played_changed_and_explained(open_page):
    page = open_page(scene="pick_pour_place")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    first = page.text("One grasp for 3 tasks: h = ").inner_text()
    slid = page.page.locator("#stack output").nth(1)
    expect(slid).to_contain_text("turned by 1")
    turned = slid.inner_text()
    page.slide("Slide by δ (%)", 0)
    expect(slid).to_have_text("turned by 0.00°")
    page.slide("Slide by δ (%)", 100)
    expect(slid).to_have_text(turned)
    page.slide("Solution", 2)
    expect(page.text(first)).to_have_count(0)
    page.slide("Solution", 1)
    expect(page.text(first)).to_be_visible()
    page.button("List more solutions").click()
    rows, chosen_row = shown(page, ".sg-solutions > label"), shown(page, ".sg-solutions > .sg-now > span")
    expect(rows.nth(10)).to_be_visible()
    expect(chosen_row.first).to_have_text("1")  # it stays
    expect(page.text(first)).to_be_visible()
    rows.nth(10).click()
    expect(chosen_row.first).to_have_text("11")
    expect(page.slider_box("Solution")).to_have_value("11")
    shown(page, ".sg-solutions > div").get_by_text("#").click()
    expect(rows.first.locator("span").first).not_to_have_text("1")
    shoot(page, "solutions")

    before = page.settled_view()
    page.button("Play").click()
    page.wait_for_change(before)
    expect(page.button("Play")).to_be_visible()  # again, at the end
    expect(page.slider_box("Plan step")).to_have_value("3")
    expect(chosen(page, "Task")).to_have_value("place")
    shoot(page, "sequence")

    page.choose("Task", "pick")
    page.button("Add a task after this one").click()
    expect(page.text("panda: pick → task 4 → pour → place")).to_be_visible()
    expect(page.button("Download plan")).to_be_hidden()
    page.slider_box("Task name").fill("table")
    page.button("Rename").click()
    expect(page.text("panda: pick → table → pour → place")).to_be_visible()
    page.button("Later").click()
    expect(page.text("panda: pick → pour → table → place")).to_be_visible()
    page.button("Earlier").click()
    page.choose("Task", "pick")
    page.slide("z (cm)", -11)
    expect(page.text("Ready.")).to_be_visible()
    page.button("One grasp for all tasks").click()
    expect(page.alerts.filter(has_text="'pick': expected a pose outside of every other body")).to_be_visible()
    page.slide("z (cm)", 0)
    page.slide("x (cm)", 86.5)  # so far away that only the cap is reached
    expect(page.slider_box("x (cm)")).to_have_value("86.5")
    page.expect_title("pick")
    page.choose("Task", "pour")
    expect(page.slider_box("z (cm)")).to_have_value("33")
    page.slide("y (cm)", 48)  # upside down on the crate: the hand does not fit to the cap
    expect(page.slider_box("y (cm)")).to_have_value("48")
    page.expect_title("pour")
    page.slide("Lean (°)", 180)
    expect(page.slider_box("Lean (°)")).to_have_value("180")
    page.expect_title("pour")
    page.button("One grasp for all tasks").click()
    expect(page.alerts).to_contain_text("pick and pour exclude each other: they are")
    expect(shown(page, ".sg-guilty")).to_have_text(["pick", "pour"])
    shoot(page, "conflict")
    page.button("Plan with 1 regrasp").click()
    expect(page.text("2 grasps, the object set down in between.")).to_be_visible()
    expect(page.alerts.filter(has_text="exclude")).to_have_count(0)
    expect(shown(page, ".sg-part")).to_have_count(2)
    shoot(page, "regrasp")
    assert page.complaints == []


CUT = """list => [...list.querySelectorAll("[role=cell], [role=columnheader]")].filter(cell => {
  const [inner, outer] = [cell, list].map(element => element.getBoundingClientRect());
  return inner.left < outer.left - 1 || inner.right > outer.left + list.clientWidth + 1
    || cell.scrollWidth > cell.clientWidth + 1;
}).map(cell => cell.textContent)"""
"""Texts of the list of solutions that are cut at its sides."""


@pytest.mark.parametrize("size", [(1280, 800), (820, 1180), (390, 844)], ids=str)
def test_no_column_of_the_solutions_is_cut(open_page, size):
    page = open_page("log_four_robots", size=size)
    page.tab("Hands")
    page.button("All arms together").click()
    solutions = shown(page, ".sg-solutions")
    expect(solutions.locator("label[role=row]")).to_have_count(10)
    assert solutions.evaluate(CUT) == []
    shoot(page, f"solutions_{size[0]}")
    assert page.complaints == []


def test_hands_climb_are_compared_and_hand_over(open_page):
    page = open_page(scene="log_two_robots")
    page.tab("Hands")
    page.button("All arms together").click()
    expect(shown(page, ".sg-task")).to_contain_text("gap")
    gap = int(shown(page, ".sg-task").inner_text().split("gap ")[1].split(" mm")[0])
    page.choose("Method", "hill climbing (Algorithm 3)")
    page.button("All arms together").click()
    rows = shown(page, ".sg-table tr")
    expect(rows).to_have_count(3)
    expect(rows.nth(1)).to_contain_text(f"Hill climbing, seed {FIRST_SEED}")
    expect(rows.nth(2)).to_contain_text(f"{gap} mm")
    page.slide("Climb", 1)
    steps: list[ClimbStep] = []
    plan_bimanual(Scene.load("log_two_robots"), method="hill_climb", seed=FIRST_SEED, trace=steps)
    assert len(steps) > 1
    share = f"prints share {steps[0].collisions} cells"
    expect(page.text(f"start 1, position 1 of {len(steps)}: {share}")).to_be_visible()
    expect(page.page.get_by_test_id("layer")).to_have_count(2)
    expect(page.page.get_by_test_id("together")).to_have_text(share)
    shoot(page, "climb")
    page.button("Replay the climb").click()
    expect(page.text(f"position {len(steps)} of {len(steps)}: prints are apart")).to_be_visible()
    expect(page.button("Replay the climb")).to_be_visible()

    page.choose("Scene", "handover_between_robots")
    expect(page.text("hand over: left and right")).to_be_visible()
    page.button("Hand over: all tasks in order").click()
    expect(page.text("Handed over in 3 tasks with 2 grasps.")).to_be_visible()
    expect(page.page.get_by_test_id("layer")).to_have_count(4)
    page.slide("Plan step", 2)
    expect(chosen(page, "Task")).to_have_value("hand over")
    shoot(page, "handover")
    assert page.complaints == []


def test_a_plan_goes_out_in_every_format_and_comes_back_verified(open_page, tmp_path):
    page = open_page(scene="pick_pour_place")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    path = download(page, "JSON", tmp_path)
    plan = Plan.load(path)
    assert verify(plan).holds
    rows = list(csv.DictReader(download(page, "CSV", tmp_path).open()))
    assert {row["task"] for row in rows} == {"pick", "pour", "place"}
    trajectory = json.loads(download(page, "Trajectory", tmp_path).read_text())
    goals = [list(task.holds[0].joints.values()) for task in plan.tasks]
    assert np.allclose([point["positions"] for point in trajectory["panda"]["points"]], goals)
    (region,) = yaml.safe_load_all(download(page, "TSR", tmp_path).read_text())
    assert len(region["Bw"]) == 6

    other = open_page(scene="soda_can")
    other.tab("Sequence")
    wrong = tmp_path / "<img src=x onerror=window.hacked=1>.json"
    content = json.loads(path.read_text())
    content["tasks"][1]["holds"][0]["clearance"] += 0.01
    wrong.write_text(json.dumps(content))
    open_plan(other, wrong)
    expect(other.alerts).to_contain_text("does not hold, so it is not shown: 1 of")
    expect(other.alerts).to_contain_text("tasks[1] (pour)")
    expect(chosen(other, "Scene")).to_have_value("soda_can")
    shoot(other, "refused_plan")
    open_plan(other, path)
    expect(other.text(f"{path.name} holds: ")).to_be_visible()
    expect(other.text("One grasp for 3 tasks: h = ")).to_be_visible()
    expect(chosen(other, "Scene")).to_have_value(f"{path.name} (upload)")
    other.slide("Plan step", 3)
    expect(chosen(other, "Task")).to_have_value("place")
    assert Plan.load(download(other, "JSON", tmp_path)) == plan
    assert other.frame.evaluate("window.hacked") is None
    assert page.complaints == other.complaints == []


def test_plans_and_scenes_are_opened_as_what_they_are_through_either_button(open_page, tmp_path):
    page = open_page(scene="soda_can")
    plan = plan_sequential(Scene.load("pick_pour_place"))
    plan.save(tmp_path / "plan.json")
    page.tab("Files")
    with page.page.expect_file_chooser() as chooser:
        page.button("Open a scene (YAML or ZIP)").click()
    chooser.value.set_files(tmp_path / "plan.json")
    expect(chosen(page, "Scene")).to_have_value("plan.json (upload)")
    page.tab("Sequence")
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    expect(page.text("plan.json holds: ")).to_be_visible()
    (tmp_path / "scene.yaml").write_text(scene_yaml(Scene.load("soda_can")))
    open_plan(page, tmp_path / "scene.yaml")
    expect(chosen(page, "Scene")).to_have_value("scene.yaml (upload)")
    page.expect_title("soda_can")
    expect(page.alerts).to_have_count(0)
    assert page.complaints == []


def test_a_motion_is_found_scrubbed_played_and_downloaded(open_page, tmp_path):
    page = open_page(scene="pick_pour_place")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    page.button("With motion").click()
    expect(page.text("way of the tool: ")).to_be_visible(timeout=120_000)
    expect(page.button("With motion")).to_be_hidden()
    page.slide("Time (s)", 5)
    expect(page.text("carry, pick → pour, panda")).to_be_visible()
    shoot(page, "motion")
    page.choose("Speed", "4 ×")
    before = page.settled_view()
    page.button("Play").click()
    page.wait_for_change(before)
    expect(page.button("Play")).to_be_visible(timeout=60_000)  # again, at the end
    path = download(page, "JSON", tmp_path)
    plan = Plan.load(path)
    assert plan.motion
    assert verify(plan).holds


def test_a_motion_that_does_not_exist_is_sought_cancelled_and_said_to_be_missing(open_page, tmp_path):
    content = caught_content()
    content["map"] |= {"heights": 6, "angles": 12}
    page = open_page()
    page.tab("Files")
    with page.page.expect_file_chooser() as chooser:
        page.button("Open a scene (YAML or ZIP)").click()
    chooser.value.set_files(write_scene(tmp_path, content))
    page.expect_title("caught")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 1 task: h = ")).to_be_visible()
    page.button("With motion").click()
    for share in r"\d+", r"[5-9]\d":  # it moves, on to the plans behind the first
        expect(page.text(re.compile(rf"Planning the motion … {share} %"))).to_be_visible()
    page.button("Cancel").click()
    expect(page.text("Planning the motion")).to_have_count(0)
    expect(page.text("One grasp for 1 task: h = ")).to_be_visible()
    page.button("With motion").click()
    expect(page.alerts).to_contain_text(
        re.compile("no motion: plans? 1.*: the reach of panda to pick: no way was found in"), timeout=120_000
    )
    expect(page.text("Planning the motion")).to_have_count(0)
    expect(page.button("With motion")).to_be_visible()
    expect(page.text("One grasp for 1 task: h = ")).to_be_visible()
    shoot(page, "no_motion")
    assert page.complaints == []


@pytest.mark.parametrize("size", [(390, 844), (1280, 800)], ids=["390", "1280"])
def test_a_refusal_is_seen_from_the_end_of_a_tab(open_page, tmp_path, size):
    page = open_page(size=size)
    page.tab("Sequence")
    button = page.button("Open a plan")
    button.scroll_into_view_if_needed()
    bad = tmp_path / "bad.json"
    bad.write_text("no plan")
    with page.page.expect_file_chooser() as chooser:
        button.click()
    chooser.value.set_files(bad)
    expect(page.alerts).to_contain_text("bad.json")
    expect(button).to_be_in_viewport()  # it was not scrolled away
    expect(page.alerts).to_be_in_viewport(ratio=0.9)
