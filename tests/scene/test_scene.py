from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
import yaml

from symgrasp.errors import MeshError, ProfileError, SceneError, SymgraspError, UrdfError
from symgrasp.files import SCENES_DIR
from symgrasp.object.library import load_object
from symgrasp.object.profile import MOST_KNOTS
from symgrasp.poses import from_position_rpy, translation
from symgrasp.robot.hand import HANDS
from symgrasp.scene.format import MOST_ARMS, MOST_OBSTACLES, MOST_ROBOTS, MOST_TASKS, scene_schema
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import list_scenes, shipped_scenes
from tests.conftest import SHIPPED, write_scene
from tests.hostile import chain_urdf


def test_the_shipped_scenes():
    assert {"soda_can", "bottle_on_table", "pick_pour_place", "log_two_robots"} <= set(SHIPPED)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_fit_the_schema(name):
    schema = scene_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    path = shipped_scenes()[name]
    jsonschema.validate(json.loads(json.dumps(yaml.safe_load(path.read_text()))), schema)
    assert Scene.load(path).sha256 == Scene.load(name).sha256
    assert Scene.load(name).name == name
    assert path.read_text().startswith("# ")  # what it shows, and where its numbers come from


def test_the_list_of_scenes_says_what_their_files_say():
    assert list_scenes() == {name: Scene.load(name).file.description for name in SHIPPED}
    assert all(list_scenes().values())


def test_defaults(content, tmp_path):
    del content["map"]
    scene = Scene.load(write_scene(tmp_path, content))
    assert scene.settings.model_dump() == {
        "heights": 48, "angles": 96, "redundancy": "auto", "approach": 0.0, "margin": 0.0,
        "resolution": None,
    }  # fmt: skip
    assert scene.task().arms == ("panda",)
    assert scene.manifold.angles == 96


def test_poses_in_degrees_and_quaternions(content, tmp_path):
    content["tasks"] = [
        {"name": "a", "pose": {"position": [1, 2, 3], "rpy_deg": [0, 90, 45]}},
        {"name": "b", "pose": {"position": [1, 2, 3], "quat_wxyz": [0.5, 0, 0.5, 0]}},
    ]
    scene = Scene.load(write_scene(tmp_path, content))
    expected = from_position_rpy([1, 2, 3], [0, np.pi / 2, np.pi / 4])
    np.testing.assert_allclose(scene.task("a").T_world_object, expected)
    np.testing.assert_allclose(scene.task("b").T_world_object[:3, 2], [1, 0, 0], atol=1e-12)


def test_content_builds_the_same_scene_elsewhere(content, tmp_path):
    """Relative files become absolute, so that the content works without the scene's folder."""
    (tmp_path / "cup.obj").write_bytes((SCENES_DIR / "bowl.obj").read_bytes())
    content["obstacles"].append({"name": "cup", "mesh": "cup.obj"})
    scene = Scene.load(write_scene(tmp_path, content))
    again = Scene.from_content(json.loads(json.dumps(scene.content)))
    assert again.sha256 == scene.sha256
    assert again.obstacles[-1].path == tmp_path / "cup.obj"


def test_objects_of_the_library_and_from_a_mesh(content, tmp_path):
    """Whatever the profile came from, the content holds it in numbers."""
    profile = Scene.load("soda_can").profile
    profile.mesh(facets=128).export(tmp_path / "can.stl")
    for source, error in (({"library": "can_330ml"}, 4e-3), ({"mesh": "can.stl"}, 3e-4)):
        content["object"] = {"name": "can", **source}
        scene = Scene.load(write_scene(tmp_path, content))
        heights = np.linspace(0.002, 0.113, 30)
        np.testing.assert_allclose(scene.profile.radius(heights), profile.radius(heights), atol=error)
        assert set(scene.content["object"]) == {"name", "profile", "scale"}
        assert Scene.from_content(scene.content).sha256 == scene.sha256


def test_a_hand_described_in_the_scene(content, tmp_path):
    content["robots"][0]["hand"] = {
        "name": "stubby",
        "links": ["panda_hand", "panda_leftfinger", "panda_rightfinger"],
        "touch_links": ["panda_leftfinger", "panda_rightfinger"],
        "joints": {"panda_finger_joint1": 0.5},
        "min_opening": 0.0,
        "max_opening": 0.05,
        "finger_depth": 0.03,
        "pad_width": 0.01,
    }
    scene = Scene.load(write_scene(tmp_path, content))
    assert scene.arm().hand.max_opening == 0.05
    assert not scene.arm().hand.spans(0.03)


def test_a_hand_mounted_on_a_flange():
    scene = Scene.load("log_iiwa_and_panda")
    panda, iiwa = scene.arms.values()
    assert (panda.hand.name, iiwa.hand.name) == ("franka", "wsg50")
    assert (panda.tool, iiwa.tool) == ("panda_grasptarget", "wsg50_tool")
    assert iiwa.dof == 7
    links = iiwa.robot.model.forward(iiwa.robot_values(iiwa.home))
    flange, base = (links[iiwa.robot.model.link_index(n)] for n in ("lbr_iiwa_link_7", "wsg50_base"))
    np.testing.assert_allclose(base, flange @ translation([0, 0, 0.045]), atol=1e-12)
    np.testing.assert_allclose(iiwa.tool_pose(iiwa.home)[:3, 2], flange[:3, 2], atol=1e-9)


MOUNT = {"link": "panda_link8", "pose": {"rpy_deg": [0, 0, 45]}, "prefix": "second_"}


def test_a_mounted_hand_with_a_prefix(content, tmp_path):
    del content["robots"][0]["tool"]
    content["robots"][0].update(hand="pr2", mount=MOUNT)
    scene = Scene.load(write_scene(tmp_path, content))
    arm = scene.arm()
    assert arm.tool == "second_gripper_pole_tool"
    assert arm.hand.links[0] == "second_gripper_pole"
    assert "second_left_gripper_joint" in scene.robots["panda"].model.joint_names
    assert Scene.from_content(json.loads(json.dumps(scene.content))).sha256 == scene.sha256


def test_an_inline_hand_brings_its_urdf_table_and_tool(content, tmp_path):
    """Its relative URDF becomes absolute, so that the content works without the scene's folder."""
    urdf = (SCENES_DIR / "hands" / "wsg50.urdf").read_text()
    (tmp_path / "hand.urdf").write_text(urdf)
    del content["robots"][0]["tool"]
    hand = {
        "name": "mine", "urdf": "hand.urdf", "links": ["wsg50_base"], "touch_links": [],
        "tool": {"link": "wsg50_base", "pose": {"position": [0, 0, 0.15]}},
        "joints": {"wsg50_joint": [[0, 0], [0.05, 0.03], [0.1, 0.05]]},
        "min_opening": 0, "max_opening": 0.1, "finger_depth": 0.05, "pad_width": 0.02,
    }  # fmt: skip
    content["robots"][0].update(hand=hand, mount=MOUNT)
    scene = Scene.load(write_scene(tmp_path, content))
    again = Scene.from_content(json.loads(json.dumps(scene.content)))
    assert again.sha256 == scene.sha256
    assert again.arm().hand.joint_values(0.025) == pytest.approx({"second_wsg50_joint": 0.015})
    assert again.arm().tool == "second_wsg50_base_tool"


def test_home_by_name(content, tmp_path):
    content["robots"][0]["home"] = {"panda_joint4": -2.0, "panda_finger_joint1": 0.01}
    scene = Scene.load(write_scene(tmp_path, content))
    model = scene.robots["panda"].model
    home = dict(zip(model.joint_names, scene.robots["panda"].home, strict=True))
    assert home["panda_joint4"] == -2.0
    assert home["panda_finger_joint1"] == 0.01
    assert home["panda_joint1"] == 0.0


HAND = {
    "name": "mine", "links": ["panda_hand"], "touch_links": [], "joints": {"panda_finger_joint1": 0.5},
    "min_opening": 0, "max_opening": 0.08, "finger_depth": 0.03, "pad_width": 0.02,
}  # fmt: skip


def robot(change):
    return lambda c: c["robots"][0].update(change)


BOMB = "a0: &a0 [x, x]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 40))

BAD = [
    ("a: [1,\n b: }", SceneError, "file", "YAML document"),
    ("\x00", SceneError, "file", "YAML document"),
    ("- 1", SceneError, "file", "mapping"),
    ("", SceneError, "file", "mapping"),
    ("a: !!bool foo", SceneError, "file", "YAML document"),
    ("a: 1\na: 2", SceneError, "file", "YAML document"),
    ("[" * 3000, SceneError, "file", "YAML document"),
    (BOMB, SceneError, "file", "YAML document"),
    (lambda c: c["map"].update(approach=1e300), SceneError, "map.approach", "less than or equal"),
    (lambda c: c["tasks"][0]["pose"].update(quat_wxyz=[1e308, 1e308, 0, 0]), SceneError,
     "tasks[0].pose.quat_wxyz[0]", "less than or equal"),
    (lambda c: c.update(extra=1), SceneError, "extra", "spelling"),
    (robot({"tol": "x"}), SceneError, "robots[0].tol", "spelling"),
    (lambda c: c.pop("object"), SceneError, "object", "required"),
    (lambda c: c["tasks"][0].pop("pose"), SceneError, "tasks[0].pose", "required"),
    (lambda c: c.update(schema_version=2), SceneError, "schema_version", "1"),
    (lambda c: c.update(tasks=[]), SceneError, "tasks", "at least 1"),
    (robot({"urdf": "no.urdf"}), SceneError, "robots[0].urdf", "existing URDF file"),
    (robot({"urdf": "package://no_such_package/a.urdf"}), SceneError, "robots[0].urdf", "existing URDF"),
    (robot({"tool": "panda_grasp"}), SceneError, "robots[0].tool", "did you mean 'panda_grasptarget'"),
    (robot({"hand": "frank"}), SceneError, "robots[0].hand", "did you mean 'franka'"),
    (robot({"hand": None}), SceneError, "robots[0]", "either tool, joints and hand, or arms"),
    (robot({"hand": {"name": "mine"}}), SceneError, "robots[0].hand.links", "required"),
    (robot({"hand": {**HAND, "max_opening": 0.0001, "min_opening": 0.05}}), SceneError,
     "robots[0].hand.max_opening", "more than 0.05"),
    (robot({"hand": {**HAND, "joints": {"panda_finger_joint1": [[0, 0]]}}}), SceneError,
     "robots[0].hand.joints.panda_finger_joint1", "two or more"),
    (robot({"hand": {**HAND, "urdf": "no.urdf"}}), SceneError, "robots[0].hand.urdf", "existing URDF file"),
    (robot({"hand": HAND, "tool": None}), SceneError, "robots[0].tool", "hand mine names none"),
    (robot({"mount": {"link": "panda_link8"}}), SceneError, "robots[0].mount", "a urdf of its own"),
    (robot({"hand": "wsg50", "mount": {"link": "panda_link9"}}), SceneError,
     "robots[0].mount.link", "did you mean 'panda_link8'"),
    (robot({"home": [1, 2]}), SceneError, "robots[0].home", "7 values, for panda_joint1"),
    (robot({"home": [9, 0, 0, 0, 0, 0, 0]}), SceneError, "robots[0].home", "panda_joint1 within"),
    (robot({"home": {"joint1": 0}}), SceneError, "robots[0].home", "'panda_joint1'"),
    (robot({"torso": {"panda_joint0": 3}}), SceneError, "robots[0].torso", "between base and arms: one of"),
    (robot({"torso": {"panda_joint1": 0}}), SceneError, "robots[0].torso.panda_joint1", "greater than"),
    (robot({"torso": {"panda_joint1": 1000}}), SceneError, "file", "redundancy × torso samples"),
    (lambda c: c["object"].update(profile=[[0, -0.1], [1, 0.1]]), ProfileError, "profile[0]", "not negative"),
    (lambda c: c["object"].update(profile=[[0, 0.1], [1, 0.1], [0.5, 0.1]]), ProfileError,
     "profile[2]", "above"),
    (lambda c: c["object"].update(mesh="can.stl"), SceneError,
     "object", "exactly one of profile, library"),
    (lambda c: c.update(object={"name": "o", "library": "can_330ml", "flip": True}), SceneError,
     "object", "only for a mesh"),
    (lambda c: c["object"].update(tolerance=0.01), SceneError, "object", "only for a mesh"),
    (lambda c: c.update(object={"name": "o", "mesh": "can.stl", "tolerance": 0}), SceneError,
     "object.tolerance", "greater than 0"),
    (lambda c: c.update(object={"name": "o", "mesh": "can.stl", "flip": 1}), SceneError,
     "object.flip", "true or false"),
    (lambda c: c.update(object={"name": "o", "mesh": "no.stl"}), SceneError,
     "object.mesh", "existing mesh file"),
    (lambda c: c.update(object={"name": "o", "library": "beer"}), SceneError,
     "object.library", "'jam_jar'"),
    (lambda c: c["object"].update(profile="round"), SceneError, "object.profile", "list"),
    (lambda c: c["obstacles"].append({"name": "m", "mesh": "no.stl"}), SceneError,
     "obstacles[3].mesh", "mesh file"),
    (lambda c: c["obstacles"][0].update(sphere={"radius": 1}), SceneError, "obstacles[0]", "exactly one of"),
    (lambda c: c["obstacles"][0].update(box=[1, -1, 1]), SceneError, "obstacles[0].box[1]", "greater than 0"),
    (lambda c: c["obstacles"][0].update(name="panda"), SceneError,
     "robots, obstacles and object: name", "twice"),
    (lambda c: c["tasks"][0]["pose"].update(position=[float("nan"), 0, 0]), SceneError,
     "tasks[0].pose.position[0]", "finite"),
    (lambda c: c["tasks"][0]["pose"].update(rpy_deg=[0, float("inf"), 0]), SceneError,
     "tasks[0].pose.rpy_deg[1]", "finite"),
    (lambda c: c["tasks"][0]["pose"].update(rpy_deg=[0, 0, 0], quat_wxyz=[1, 0, 0, 0]), SceneError,
     "tasks[0].pose", "not both"),
    (lambda c: c["tasks"][0]["pose"].update(quat_wxyz=[0, 0, 0, 0]), SceneError,
     "tasks[0].pose", "length above"),
    (lambda c: c["tasks"][0].update(arms=["hand"]), SceneError, "tasks[0].arms", "'panda'"),
    (lambda c: c["map"].update(heights=0), SceneError, "map.heights", "greater than or equal to 1"),
    (lambda c: c["map"].update(margin=-1), SceneError, "map.margin", "greater than or equal to 0"),
    (lambda c: c["map"].update(heights=1024, angles=1024, redundancy=1024), SceneError,
     "map", "heights × angles × 2 rolls × redundancy of at most 10,000,000, not 2,147,483,648"),
    (lambda c: c["object"].update(profile=[[k, 1] for k in range(MOST_KNOTS + 1)]), SceneError,
     "object.profile", "at most 10,000 of them"),
    (lambda c: c.update(robots=(MOST_ROBOTS + 1) * c["robots"]), SceneError,
     "robots", "at most 32 of them"),
    (lambda c: c["robots"][0].update(arms=[{"name": "a", "hand": "franka"}] * (MOST_ARMS + 1)), SceneError,
     "robots[0].arms", "at most 16 of them"),
    (lambda c: c.update(obstacles=(MOST_OBSTACLES + 1) * c["obstacles"][:1]), SceneError,
     "obstacles", "at most 1,000 of them"),
    (lambda c: c.update(obstacles=20_000 * [{}]), SceneError, "obstacles[0].name", "required"),
    (lambda c: c.update(tasks=(MOST_TASKS + 1) * c["tasks"][:1]), SceneError,
     "tasks", "at most 500 of them"),
    (lambda c: c["robots"][0].update(urdf="chain.urdf"), UrdfError, "links", "at most 5,000 of them"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "kind", "field", "expected"), BAD)
def test_bad_scenes_get_one_line(change, kind, field, expected, content, tmp_path):
    (tmp_path / "chain.urdf").write_text(chain_urdf(5002))
    if callable(change):
        change(content)
    path = write_scene(tmp_path, content if callable(change) else change)
    with pytest.raises(kind) as caught:
        Scene.load(path)
    error = caught.value
    assert error.field == field
    assert expected in error.expected
    assert error.source.startswith(str(tmp_path))
    assert "\n" not in str(error)


def test_a_map_at_the_limit_is_allowed_and_one_cell_more_is_not():
    scene = Scene.load("soda_can")
    assert scene.with_settings(heights=1000, angles=1000, redundancy=5).manifold.angles == 1000
    with pytest.raises(SceneError, match="at most 10,000,000"):
        scene.with_settings(heights=1000, angles=1001, redundancy=5)


def test_no_task_can_be_added_beyond_what_a_file_may_hold():
    scene = Scene.load("soda_can")
    tasks = [replace(scene.task(), name=str(k)) for k in range(MOST_TASKS + 1)]
    full = scene.with_tasks(tasks[:-1])
    assert len(Scene.from_content(full.content).tasks) == MOST_TASKS
    with pytest.raises(SceneError, match="tasks: 501: expected at most 500 of them"):
        full.with_tasks(tasks)


def test_a_missing_scene(tmp_path):
    with pytest.raises(SceneError, match="did you mean 'soda_can'"):
        Scene.load("soda_cans")
    with pytest.raises(SceneError, match="readable text file"):
        Scene.load(tmp_path / "none.yaml")


def test_a_mesh_takes_a_tolerance_and_its_other_end(content, tmp_path):
    oval = load_object("wine_bottle")[1].mesh()
    oval.vertices[:, 0] *= 1.2
    oval.export(tmp_path / "oval.stl")
    content["object"] = {"name": "bottle", "mesh": "oval.stl"}
    with pytest.raises(
        MeshError, match=r"scene\.yaml: object\.mesh: oval\.stl: symmetry: .* tolerance: 0\.00\d+ in a scene"
    ):
        Scene.load(write_scene(tmp_path, content))
    content["object"]["tolerance"] = 0.01
    upright = Scene.load(write_scene(tmp_path, content)).profile
    content["object"]["flip"] = True
    scene = Scene.load(write_scene(tmp_path, content))
    heights = np.linspace(upright.h_min, upright.h_max, 99)
    assert scene.profile.radius(upright.h_max - heights) == pytest.approx(upright.radius(heights))
    assert scene.profile.radius(0.001) < 0.5 * upright.radius(0.001)
    # A saved scene holds the flipped knots, and needs neither mesh nor tolerance.
    again = Scene.from_content(scene.content)
    assert np.array_equal(again.profile.points, scene.profile.points)
    assert again.sha256 == scene.sha256


def test_a_missing_mesh_of_a_robot_is_an_error(content, tmp_path):
    (tmp_path / "r.urdf").write_text(
        "<robot name='r'><link name='a'><visual><geometry><mesh filename='package://meshes/a.obj'/>"
        "</geometry></visual></link></robot>"
    )
    content["robots"][0]["urdf"] = "r.urdf"
    with pytest.raises(UrdfError, match=r"link a: 'package://meshes/a.obj': expected an existing mesh file"):
        Scene.load(write_scene(tmp_path, content))


def test_unknown_names_list_the_valid_ones():
    scene = Scene.load("log_two_robots")
    with pytest.raises(SceneError, match="'left', 'right'"):
        scene.arm("middle")
    with pytest.raises(SceneError, match="'lift'"):
        scene.task("drop")


def test_another_object_takes_the_place_of_the_scenes_own():
    scene = Scene.load("bottle_on_table")
    ball = load_object("tennis_ball")[1]
    own = scene.manifold
    changed = scene.with_object("ball", ball)
    assert changed.profile is ball
    assert changed.manifold.profile is ball
    assert (scene.manifold, scene.file.object.name) == (own, "bottle")
    assert changed.robots is scene.robots
    again = Scene.from_content(changed.content)
    assert again.sha256 == changed.sha256 != scene.sha256
    assert np.array_equal(again.profile.points, ball.points)
    assert again.file.object.name == "ball"


@pytest.mark.parametrize("name", ["", "x" * 101, "table", "panda"])
def test_an_object_needs_a_name_of_its_own(name):
    scene = Scene.load("bottle_on_table")
    with pytest.raises(SymgraspError, match=r"^object: name: ") as caught:
        scene.with_object(name, scene.profile)
    assert len(str(caught.value).splitlines()) == 1


def test_a_mounted_hand_can_be_replaced():
    scene = Scene.load("log_iiwa_and_panda")
    assert scene.replaceable_hands == {"iiwa": "wsg50"}
    changed = scene.with_hand("iiwa", "pr2")
    assert changed.replaceable_hands == {"iiwa": "pr2"}
    assert changed.arm("iiwa").hand == HANDS["pr2"]
    assert set(HANDS["pr2"].links) <= set(changed.arm("iiwa").robot.model.link_names)
    assert changed.arm("panda").hand == scene.arm("panda").hand
    assert scene.arm("iiwa").hand == HANDS["wsg50"]
    assert changed.with_hand("iiwa", "wsg50").sha256 == scene.sha256
    for arm, hand in [("panda", "wsg50"), ("iiwa", "franka"), ("iiwa", "no_such")]:
        with pytest.raises(SceneError) as caught:
            scene.with_hand(arm, hand)
        assert len(str(caught.value).splitlines()) == 1


def test_settings_can_be_changed_and_are_checked():
    scene = Scene.load("soda_can")
    assert scene.with_settings(heights=3).manifold.heights == 3
    assert scene.manifold.heights == 24
    with pytest.raises(SymgraspError, match="heights"):
        scene.with_settings(heights=-3)
    with pytest.raises(SymgraspError, match="spelling"):
        scene.with_settings(height=3)
