"""The page in a browser, from the first look to a plan in a file."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pybullet_data
import pytest
from playwright.sync_api import expect

from app.choices.object_choice import from_mesh
from app.html.candidates import candidate_text
from app.html.map import sample_columns
from app.render.palette import REASONS
from app.scene3d.viewpoint import FLAT_SIZE, flat_map_position
from app.state import changes
from app.state.map_view_state import RollChoice
from app.state.state import State
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.library import load_object
from symgrasp.object.manifold import grasp_to_tool
from symgrasp.plan.plan import Plan, plan_schema
from symgrasp.poses import pose_error
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.app.html.test_profile import oval_stl
from tests.conftest import write_scene
from tests.e2e.page import WAIT, GraspPage

BOTTLE = Scene.load("bottle_on_table")
COLUMNS_PER_DEGREE = 4


@pytest.fixture(scope="module")
def bottle_map() -> FeasibilityMap:
    return create_map(BOTTLE)


def drawn(m: FeasibilityMap, roll: RollChoice = RollChoice.EITHER) -> np.ndarray:
    """What the page's picture of a map should be."""
    return REASONS[roll.reason(m)[::-1, sample_columns(m.manifold)]]


def cell_with(m: FeasibilityMap, reason: Reason) -> tuple[int, int]:
    return tuple(np.argwhere(RollChoice.EITHER.reason(m) == reason)[0])


def test_the_first_page(open_page, bottle_map):
    page = open_page()
    expect(page.text("Then click a green cell")).to_be_visible()
    page.expect_title("bottle_on_table · pick · panda")
    assert np.array_equal(page.picture(), drawn(bottle_map))
    for text in ("feasible", "hits an obstacle", "out of reach"):
        expect(page.around(text).first).to_be_visible()
    page.settled_view()
    assert page.complaints == []


@pytest.mark.parametrize("degrees", [30, -52.5, 10.25])
def test_turning_the_object_rolls_the_map(open_page, bottle_map, degrees):
    page = open_page()
    before = page.picture()
    counts = page.legend.inner_text()
    columns = -int(degrees * COLUMNS_PER_DEGREE)
    assert not np.array_equal(np.roll(before, columns, axis=1), before)
    page.slide("Rotation (°)", degrees)
    after = page.wait_for_picture(lambda p: np.array_equal(p, np.roll(before, columns, axis=1)))
    assert np.array_equal(after, drawn(bottle_map.shift(np.deg2rad(degrees))))
    assert page.legend.inner_text() == counts
    expect(page.text("Ready.")).to_be_visible()
    expect(page.button("Cancel")).to_be_disabled()


def test_dragging_the_slider_rolls_the_map_too(open_page):
    page = open_page()
    before = page.picture()
    slider = page.frame.get_by_role("slider").first
    slider.focus()
    for _ in range(3):
        slider.press("ArrowRight")
    page.wait_for_picture(lambda p: np.array_equal(p, np.roll(before, -3, axis=1)))


def test_moving_the_object_computes_the_map_anew(open_page):
    page = open_page()
    page.slide("x (cm)", 60)
    page.slide("Lean (°)", 20)
    request = changes.moved(changes.moved(State.of(BOTTLE, ""), x=0.6), lean=np.deg2rad(20.0)).request
    expected = drawn(create_map(request.moved_scene()))
    page.wait_for_picture(lambda p: np.array_equal(p, expected))
    page.expect_title("pick")
    page.button("Put it back").click()
    page.wait_for_picture(lambda p: np.array_equal(p, drawn(create_map(BOTTLE))))
    expect(page.slider_box("x (cm)")).to_have_value("55")
    expect(page.slider_box("Lean (°)")).to_have_value("0")


def test_a_feasible_cell_poses_the_arm(open_page, bottle_map):
    page = open_page()
    row, column = cell_with(bottle_map, Reason.FEASIBLE)
    parked = page.settled_view()
    page.number("h (cm)", 100 * bottle_map.manifold.h[row])
    page.number("θ (°)", np.rad2deg(bottle_map.manifold.theta[column]))
    roll = RollChoice.EITHER.roll(bottle_map, row, column)
    witness = bottle_map.witness((roll, row, column))
    assert witness
    joints = ", ".join(f"{angle + 0.0:.0f}°" for angle in np.round(np.rad2deg(witness.q)))
    expect(page.text("panda holds it: feasible")).to_be_visible()
    expect(page.text(f"Joints {joints}")).to_be_visible()
    page.wait_for_change(parked)
    assert len(page.shown_map.look["marks"]) == 1
    page.button("Let go").click()
    expect(page.text("No grasp picked")).to_be_visible()


def test_an_infeasible_cell_says_why(open_page, bottle_map):
    page = open_page()
    row, column = cell_with(bottle_map, Reason.SCENE_COLLISION)
    page.number("h (cm)", 100 * bottle_map.manifold.h[row])
    page.number("θ (°)", np.rad2deg(bottle_map.manifold.theta[column]))
    roll = RollChoice.EITHER.roll(bottle_map, row, column)
    with BulletWorld(BOTTLE) as world:
        best = MapMaker(world).explain("panda", "pick", (roll, row, column)).best
    assert best
    assert best.collisions[0].b.body in ("table", "parcel", "lamp")
    expect(page.text("panda cannot hold it here: hits an obstacle. The best of")).to_be_visible()
    expect(page.text(candidate_text(best))).to_be_visible()


def test_the_roll_can_be_chosen(open_page, bottle_map):
    page = open_page()
    page.choose("Roll", "180°")
    page.wait_for_picture(lambda p: np.array_equal(p, drawn(bottle_map, RollChoice.HALF_TURN)))


def expect_picked(page: GraspPage, h: float, theta: float) -> None:
    """The page reads out the middle of the cell that was clicked."""
    set_pose = f"h = {round(100 * h, 2):g} cm, θ = {round(np.rad2deg(theta), 2):g}°"
    expect(page.text(set_pose)).to_be_visible()


@pytest.mark.parametrize("turn", [0.0, 37.5])
def test_clicking_the_object_picks_the_cell_under_the_pointer(open_page, bottle_map, turn):
    page = open_page()
    page.slide("Rotation (°)", turn)
    shifted = bottle_map.shift(np.deg2rad(turn))
    page.wait_for_picture(lambda p: np.array_equal(p, drawn(shifted)))
    grid = bottle_map.manifold
    towards = page.viewpoint(BOTTLE).direction  # the camera; the bottle stands with its θ = 0 along x
    row, column = grid.cell(0.1, np.arctan2(towards[1], towards[0]))
    point = BOTTLE.task().T_world_object @ [*grid.contact(grid.h[row], grid.theta[column]), 1.0]
    page.click_3d(BOTTLE, point[:3])
    expect_picked(page, grid.h[row], grid.theta[column] - np.deg2rad(turn))


def test_clicking_the_flat_map_picks_a_cell(open_page, bottle_map):
    page = open_page()
    view = page.viewpoint(BOTTLE)
    grid = bottle_map.manifold
    row, column = grid.cell(0.08, np.deg2rad(150.0))
    x = (np.rad2deg(grid.theta[column]) / 360) * FLAT_SIZE[0]
    y = (grid.h[row] / 0.3 - 0.5) * FLAT_SIZE[1]
    point = flat_map_position(BOTTLE, BOTTLE.task().T_world_object, view) + x * view.right + [0.0, 0.0, y]
    page.click_3d(BOTTLE, point)
    expect_picked(page, grid.h[row], grid.theta[column])


def test_dragging_the_handles_moves_the_object(open_page):
    page = open_page()
    page.settled_view()
    page.frame.get_by_label("Drag handles").check()
    bottle = BOTTLE.task().T_world_object[:3, 3]
    page.drag_3d(BOTTLE, bottle + np.array([0.0, 0.13, 0.0]), bottle + np.array([0.0, 0.23, 0.0]))
    box = page.slider_box("y (cm)")
    expect(box).to_have_value(re.compile(r"^(9|10|11)(\.5)?$"))
    expect(page.slider_box("x (cm)")).to_have_value("55")
    page.expect_title("pick")
    moved = changes.moved(State.of(BOTTLE, ""), y=float(box.input_value()) / 100)
    assert np.mean(page.picture() == drawn(create_map(moved.moved_scene()))) > 0.9  # the box rounds


def check_plan(content: dict[str, Any], kind: str) -> Plan:
    """The file follows the schema and holds in a fresh world."""
    jsonschema.validate(content, plan_schema())
    plan = Plan.model_validate(content)
    assert plan.kind == kind
    scene = Scene.from_content(plan.scene.content)
    assert scene.sha256 == plan.scene.sha256
    with BulletWorld(scene) as world:
        for task in plan.tasks:
            arms = [scene.arm(hold.arm) for hold in task.holds]
            pose = task.object_pose_turned.array()
            world.set_object(pose)
            joint_values = []
            for arm, hold in zip(arms, task.holds, strict=True):
                q = np.array([hold.joints[name] for name in arm.joint_names])
                joint_values.append((arm, q, hold.opening))
                standoff = arm.hand.standoff(float(scene.profile.radius(hold.grasp.h)))
                grasp = grasp_to_tool(pose, hold.grasp.h, hold.grasp.theta, hold.grasp.roll, standoff)
                distance, angle = pose_error(arm.world_tool_pose(q), grasp)
                assert distance < 1e-5
                assert angle < 1e-5
            world.set_arms(joint_values)
            assert world.collisions(arms) == []
    return plan


def test_one_grasp_for_a_sequence(open_page, tmp_path):
    page = open_page(scene="pick_pour_place")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 3 tasks: h = ")).to_be_visible()
    plan = check_plan(page.download_plan(tmp_path), "sequential")
    assert [task.name for task in plan.tasks] == ["pick", "pour", "place"]
    for k, task in enumerate(plan.tasks):
        page.slide("Plan step", k + 1)
        expect(page.frame.get_by_label("Task", exact=True)).to_have_value(task.name)
        turn = round(4 * np.rad2deg(task.delta)) / 4
        expect(page.slider_box("Rotation (°)")).to_have_value(f"{turn:g}")
        layer = page.page.get_by_role("img", name=f"{k + 1} · {task.name}")
        expect(layer).to_be_visible()
        expect(page.page.locator("figure.shown b")).to_have_text(f"{k + 1} · {task.name}")
    page.tab("Grasp map")
    page.expect_title("· place ·")
    expect(page.text("panda holds it: feasible")).to_be_visible()


def test_two_arms_together(open_page, tmp_path):
    page = open_page(scene="log_two_robots")
    page.tab("Sequence")
    expect(page.button("One grasp for all tasks")).to_be_disabled()
    page.tab("Hands")
    parked = page.settled_view()
    page.button("All arms together").click()
    expect(page.text("2 arms hold the object together in lift.")).to_be_visible()
    plan = check_plan(page.download_plan(tmp_path), "bimanual")
    assert [hold.arm for hold in plan.tasks[0].holds] == ["left", "right"]
    expect(page.page.get_by_test_id("layer")).to_have_count(2)
    page.tab("Grasp map")
    for arm in ("left", "right"):
        expect(page.around(f"hand of {arm}")).to_be_visible()
    page.wait_for_change(parked)
    page.choose("Arm", "right")
    page.expect_title("· right")
    expect(page.text("right holds it: feasible")).to_be_visible()


def test_no_plan_is_said_in_a_line_and_the_page_lives_on(open_page):
    page = open_page(scene="pick_pour_place")
    page.slide("x (cm)", 110)
    page.expect_title("pick_pour_place")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.alerts).to_contain_text("pick")  # the task that cannot be done is named
    expect(page.button("Download plan")).to_be_hidden()
    page.button("Put it back").click()
    expect(page.alerts).to_have_count(0)
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 3 tasks")).to_be_visible()


def test_an_object_inside_an_obstacle_is_named_with_its_depth(open_page):
    page = open_page()
    page.slide("z (cm)", -3)
    expect(page.alerts.filter(has_text="bottle is 30 mm inside table")).to_be_visible()


def test_an_object_of_the_library_takes_the_place_of_the_scenes_own(open_page, bottle_map, tmp_path):
    page = open_page()
    before = page.settled_view()
    page.choose("Object", "wine_bottle")
    _, profile = load_object("wine_bottle")
    scene = BOTTLE.with_object("wine_bottle", profile)
    expected = drawn(create_map(scene))
    page.wait_for_picture(lambda p: np.array_equal(p, expected))
    expect(page.text("the wine_bottle turns")).to_be_visible()
    page.wait_for_change(before, share=0.001)
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text("One grasp for 1 task: h = ")).to_be_visible()
    plan = check_plan(page.download_plan(tmp_path), "sequential")
    assert plan.scene.content["object"] == {
        "name": "wine_bottle", "profile": profile.points.tolist(), "scale": 1.0,
    }  # fmt: skip
    page.choose("Object", "the scene's own")
    expect(page.button("Download plan")).to_be_hidden()
    page.tab("Grasp map")
    page.wait_for_picture(lambda p: np.array_equal(p, drawn(bottle_map)))
    assert page.complaints == []


def test_a_mesh_is_uploaded_and_held(open_page, bottle_map, tmp_path):
    mesh = load_object("wine_bottle")[1].mesh(64)
    mesh.apply_scale(1000.0)
    hostile = "<img src=x onerror=window.hacked=1>.stl"
    mesh.export(tmp_path / "a.stl", file_type="stl")
    path = (tmp_path / "a.stl").rename(tmp_path / hostile)
    page = open_page()
    page.upload(path)  # as if it were in metres
    expect(page.alerts).to_contain_text("expected 0.005 to 10 m; choose the unit of the mesh")
    expect(page.frame.get_by_text("successfully").filter(visible=True)).to_have_count(0)  # viser's notice
    assert np.array_equal(page.picture(), drawn(bottle_map))
    page.choose("Mesh unit", "mm")  # tries again, without another upload
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value(f"{hostile} (upload)")
    expect(page.alerts).to_have_count(0)
    page.expect_title("bottle_on_table")
    object_choice = from_mesh(hostile, path.read_bytes(), 1e-3)
    expected = drawn(create_map(BOTTLE.with_object(object_choice.name, object_choice.profile)))
    assert np.array_equal(page.picture(), expected)
    page.choose("Scene", "soda_can")
    page.expect_title("soda_can")
    page.choose("Object", f"{hostile} (upload)")  # it may go into any scene
    expect(page.text(f"the {object_choice.name} turns")).to_be_visible()
    page.expect_title("soda_can")
    assert page.frame.evaluate("window.hacked") is None
    assert page.complaints == []


WATCH = """() => {
  window.notices = [];
  new MutationObserver(() => {
    const found = [...document.querySelectorAll("div")].filter(e => e.textContent.endsWith("successfully."));
    window.notices.push(...found.filter(e => !e.childElementCount).map(e => e.checkVisibility()));
  }).observe(document.body, {subtree: true, childList: true, characterData: true});
}"""
"""Notes whether viser's notice that a file was uploaded is seen, whenever it is in the document."""


def test_no_layout_calls_a_refused_file_uploaded(open_page, tmp_path):
    page = open_page()
    page.frame.evaluate(WATCH)
    path = tmp_path / "bad.stl"
    path.write_bytes(b"no mesh")

    def expect_hidden_notice() -> None:
        """Wait until viser has shown its notice, unseen, and taken it away again."""
        deadline = time.monotonic() + WAIT / 1000
        while not page.frame.evaluate("window.notices.length"):
            assert time.monotonic() < deadline, "viser gave no notice"
            page.next_frame()
        expect(page.frame.get_by_text("File uploaded successfully.")).to_have_count(0)
        assert not any(page.frame.evaluate("window.notices.splice(0)"))

    page.upload(path)
    expect(page.alerts).to_contain_text("bad.stl")
    expect_hidden_notice()
    for size in (390, 844), (1280, 800):
        page.page.set_viewport_size({"width": size[0], "height": size[1]})
        expect_hidden_notice()
    assert page.complaints == []


def test_the_symmetry_error_is_told_and_painted(open_page, tmp_path):
    page = open_page()
    expect(page.text("The hand franka fits from 0.9 to 19.1 and 24.2 to 29.1 cm.")).to_be_visible()
    expect(page.frame.get_by_label("Colours", exact=True)).to_have_count(0)
    path = tmp_path / "oval.stl"
    path.write_bytes(oval_stl())
    page.upload(path)
    expect(page.text("Symmetry error: 0.99 mm at most")).to_be_visible()
    page.expect_title("bottle_on_table")
    page.frame.get_by_label("Flat map").uncheck()

    def reds(view: np.ndarray) -> int:  # of the cells whose grasps hit an obstacle
        red = REASONS[Reason.SCENE_COLLISION].astype(int)
        return int(np.count_nonzero(np.abs(view - red).max(axis=-1) < 60))

    red = reds(page.wait_for_view(lambda v: reds(v) > 300))
    page.choose("Colours", "symmetry error")
    expect(page.text("0.99 mm inside")).to_be_visible()
    page.wait_for_view(lambda v: reds(v) < red / 3)
    page.choose("Colours", "map")
    page.wait_for_view(lambda v: reds(v) > 300)
    assert page.complaints == []


def test_another_hand_is_mounted_where_the_scene_mounts_one(open_page):
    page = open_page(scene="log_iiwa_and_panda")
    page.frame.get_by_text("Robot", exact=True).first.click()
    expect(page.frame.get_by_label("Hand", exact=True)).to_have_value("as in the URDF")  # the Panda's own
    page.choose("Arm", "iiwa")
    page.expect_title("· iiwa")
    expect(page.frame.get_by_label("Hand", exact=True)).to_have_value("wsg50")
    page.choose("Hand", "pr2")
    expect(page.text("The hand pr2 fits from ")).to_be_visible()
    page.expect_title("· iiwa")
    changed = Scene.load("log_iiwa_and_panda").with_hand("iiwa", "pr2")
    assert np.array_equal(page.picture(), drawn(create_map(changed, task="lift", arm="iiwa")))
    page.choose("Object", "log_70mm")  # into the scene with the other hand
    expect(page.text("the log_70mm turns")).to_be_visible()
    expect(page.frame.get_by_label("Hand", exact=True)).to_have_value("pr2")
    assert page.complaints == []


def test_meshes_that_are_unusable_are_refused_in_a_line(open_page, bottle_map, tmp_path):
    page = open_page()
    page.upload(Path(pybullet_data.getDataPath(), "objects", "mug.obj"))
    expect(page.alerts).to_contain_text("mug.obj: symmetry: ")
    expect(page.alerts).to_contain_text("expected a surface of revolution to within 1.5 mm")
    large = tmp_path / "large.stl"
    large.write_bytes(bytes(20_000_001))
    page.upload(large)
    expect(page.alerts).to_contain_text("large.stl: size of the file: 20.0 MB")
    expect(page.alerts).to_contain_text("at most 20 MB")
    expect(page.frame.get_by_label("Object", exact=True)).to_have_value("the scene's own")
    page.expect_title("bottle_on_table")
    assert np.array_equal(page.picture(), drawn(bottle_map))
    assert page.complaints == []


def test_two_browsers_do_not_see_each_other(open_page, bottle_map):
    one, other = open_page(), open_page()
    one.slide("Rotation (°)", 45)
    one.wait_for_picture(lambda p: np.array_equal(p, drawn(bottle_map.shift(np.deg2rad(45)))))
    one.choose("Scene", "soda_can")
    one.expect_title("soda_can")
    assert np.array_equal(other.picture(), drawn(bottle_map))
    expect(other.slider_box("Rotation (°)")).to_have_value("0")
    other.slide("Rotation (°)", -15)
    other.wait_for_picture(lambda p: np.array_equal(p, drawn(bottle_map.shift(np.deg2rad(-15)))))
    other.expect_title("bottle_on_table")
    one.expect_title("soda_can")


def test_a_long_computation_can_be_cancelled_and_begun_again(open_page, tmp_path, content):
    content["map"] = {"heights": 300, "angles": 400, "redundancy": "auto", "approach": 0.1}
    long = open_page(str(write_scene(tmp_path, content)), wait_for_map=False)
    expect(long.text("Computing the map of pick")).to_be_visible()
    long.button("Cancel").click()
    expect(long.text("Stopped")).to_be_visible()
    long.slide("Rotation (°)", 30)  # the page answers, and nothing begins by itself
    expect(long.text("Stopped")).to_be_visible()
    long.button("Compute the map").click()
    expect(long.text("Computing the map of pick")).to_be_visible()
    long.choose("Scene", "soda_can")
    long.expect_title("soda_can")


def test_names_from_a_file_are_shown_as_text(open_page, tmp_path, content):
    hostile = '<img src=x onerror="window.hacked=1">'
    script = "<script>window.hacked=1</script>"
    content["name"] = script
    content["object"]["name"] = hostile
    content["robots"][0]["name"] = hostile + "robot"
    content["tasks"][0]["name"] = script + "task"
    for obstacle in content["obstacles"]:
        obstacle["name"] = hostile + obstacle["name"]
    page = open_page(str(write_scene(tmp_path, content)))
    page.expect_title(f"{script} · {script}task · {hostile}robot")
    expect(page.text(f"the {hostile} turns")).to_be_visible()
    page.number("h (cm)", 4)
    page.number("θ (°)", 90)
    why = page.frame.locator(".sg-candidate")
    expect(why).to_contain_text(f"{hostile}robot/")
    expect(why).to_contain_text(f"and {hostile}")
    page.tab("Sequence")
    page.button("One grasp for all tasks").click()
    expect(page.text(f"{hostile}robot: {script}task")).to_be_visible()
    expect(page.frame.locator(".sg-now", has_text=f"1 · {script}task").first).to_be_visible()
    assert page.frame.evaluate("window.hacked") is None
    assert page.complaints == []
