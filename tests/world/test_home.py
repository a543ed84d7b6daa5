"""Robots are free where they are parked: a home that is given is checked, and one that is not is found."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from symgrasp.cli.main import main
from symgrasp.errors import SceneError
from symgrasp.feasibility.create import create_map
from symgrasp.robot.robot import Robot
from symgrasp.scene.scene import Scene
from symgrasp.world import check_homes, checked_self_pairs, home, open_world, prepared, with_free_homes
from tests.conftest import SHIPPED, write_scene

UNUSED = {
    "name": "closed", "links": ["panda_hand"], "touch_links": [], "joints": {}, "min_opening": 0,
    "max_opening": 0.08, "finger_depth": 0.03, "pad_width": 0.02,
}  # fmt: skip
"""A hand that uses none of its joints: the fingers belong to no arm."""


def overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether the convex hulls of two sets of points have a point in common, by linear programming."""
    n, m = len(a), len(b)
    equal = np.vstack([np.hstack([a.T, -b.T]), np.repeat(np.eye(2), [n, m], axis=1)])
    return linprog(np.zeros(n + m), A_eq=equal, b_eq=[0, 0, 0, 1, 1]).status == 0


def overlapping(robot: Robot) -> set[frozenset[str]]:
    """Return the pairs of links, of those that are checked, whose hulls overlap at home."""
    model = robot.model
    poses = dict(zip(model.link_names, model.forward(robot.home), strict=True))
    hulls = {
        link: [points @ poses[link][:3, :3].T + poses[link][:3, 3] for points in model.hulls(link)]
        for link in model.colliding_links()
    }
    return {
        frozenset(pair)
        for pair in checked_self_pairs(model)
        if any(overlap(a, b) for a in hulls[pair[0]] for b in hulls[pair[1]])
    }


def no_home(content: dict[str, Any], **changes: Any) -> Scene:
    robot = content["robots"][0]
    robot.pop("home", None)
    robot.update(changes)
    return Scene.from_content(content)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_stay_as_they_are(name):
    scene = Scene.load(name)
    settled = prepared(scene)
    assert settled.sha256 == scene.sha256
    assert settled.map_sha256 == scene.map_sha256
    told = [note for note in settled.notes if "overlap at every opening" not in note]
    assert told == list(scene.notes)  # such as which SRDF was read


def test_a_free_home_is_found_and_the_scene_states_it(content):
    scene = no_home(content)
    assert overlapping(scene.robots["panda"])
    found = with_free_homes(scene)
    robot = found.robots["panda"]
    assert not overlapping(robot)
    assert np.all((robot.home >= robot.model.lower) & (robot.home <= robot.model.upper))
    (note,) = found.notes
    stated = found.content["robots"][0]["home"]
    assert note.startswith("panda: home: {")
    assert all(f"{joint}: {value:g}" in note for joint, value in stated.items())
    assert with_free_homes(scene).sha256 == found.sha256  # the same every time
    again = Scene.from_content(found.content)
    assert with_free_homes(again) is again
    assert again.map_sha256 == found.map_sha256


def test_values_that_are_given_stay_and_unused_hands_are_opened(content):
    home = list(content["robots"][0]["home"])
    scene = no_home(content, hand=UNUSED, home=home)
    fingers = frozenset(("panda_leftfinger", "panda_rightfinger"))
    assert overlapping(scene.robots["panda"]) == {fingers}
    with pytest.raises(SceneError, match=r"robots\[0\]\.home: .*finger.* are too close by 2\.2 mm"):
        check_homes(scene)
    counts = create_map(scene.with_settings(heights=4, angles=8, redundancy=4)).counts()
    assert all("feasible" not in reason.label or not count for reason, count in counts.items())
    found = prepared(scene)
    robot = found.robots["panda"]
    values = dict(zip(robot.model.joint_names, robot.home, strict=True))
    assert values == {**{f"panda_joint{k + 1}": v for k, v in enumerate(home)}, "panda_finger_joint1": 0.04}
    assert not overlapping(robot)
    assert "with hands opened" in found.notes[0]
    counts = create_map(found.with_settings(heights=4, angles=8, redundancy=4)).counts()
    assert any(count for reason, count in counts.items() if reason.name == "FEASIBLE")


def test_a_collision_that_the_arm_leaves_behind_is_said(content):
    scene = no_home(content, home=[0, 0, 0, -0.1, 0, 0, 0])
    found = prepared(scene)
    assert found.sha256 == scene.sha256
    told = {note.removeprefix("panda: at home, ").split(" are too close")[0] for note in found.notes}
    expected = overlapping(scene.robots["panda"])
    assert {frozenset(part.split("/")[-1] for part in pair.split(" and ")) for pair in told} == expected


def test_a_home_is_free_of_obstacles_of_the_object_and_of_other_robots(content):
    """Zero is free for an iiwa alone; here an obstacle stands there, and another robot beside it."""
    iiwa = {
        "urdf": "package://pybullet_data/kuka_iiwa/model.urdf", "hand": "wsg50",
        "mount": {"link": "lbr_iiwa_link_7", "pose": {"position": [0, 0, 0.045]}},
    }  # fmt: skip
    content["robots"] = [{"name": "a", **iiwa}, {"name": "b", **iiwa, "base": {"position": [0, 0.3, 0]}}]
    content["obstacles"] = [{"name": "post", "sphere": {"radius": 0.1}, "pose": {"position": [0, 0, 1.2]}}]
    content["tasks"] = [
        {"name": "far", "arms": ["a"], "pose": {"position": [0, -2, 0]}},
        {"name": "near", "arms": ["a"], "pose": {"position": [0, 0.3, 1.1]}},  # where b is at zero
    ]
    scene = Scene.from_content(content)
    found = with_free_homes(scene)
    assert len(found.notes) == 2
    with open_world(found) as world:
        for task in found.tasks.values():
            world.set_object(task.T_world_object)
            assert [world.arm_collisions(arm) for arm in found.arms.values()] == [[], []]


@pytest.mark.parametrize("find", [with_free_homes, prepared])
def test_cancel_is_looked_at_before_every_try(content, monkeypatch, find):
    """A box around all of the robot: no home is free, and 1,000 moves are tried."""
    content["obstacles"] = [{"name": "box", "box": [3, 3, 3], "pose": {"position": [0, 0, 1.5]}}]
    scene, told = no_home(content), list[float]()
    monkeypatch.setattr(home, "MOST_MOVES", 40)
    with suppress(SceneError):
        find(scene, told.append)
    before = len(told)
    monkeypatch.setattr(home, "MOST_MOVES", 80)
    with suppress(SceneError):
        find(scene, told.append)
    assert len(told) - 2 * before >= 40


def test_where_nothing_helps_the_error_names_the_pair_and_what_to_do(content):
    """Two robots stand in each other's bases."""
    content["robots"].append({**content["robots"][0], "name": "other", "base": {"position": [0, 0.05, 0]}})
    with pytest.raises(SceneError) as error:
        prepared(Scene.from_content(content))
    text = str(error.value)
    assert text.startswith("scene: robots[0].home: 'panda/panda_link")
    assert "and other/panda_link" in text
    assert "expected values at which panda is not barred from every grasp" in text


def test_the_command_line_says_what_was_found(content, tmp_path, capsys):
    content["robots"][0].pop("home")
    content["map"] = {"heights": 2, "angles": 4, "redundancy": 2}
    assert main(["map", str(write_scene(tmp_path, content))]) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "home:" in line]
    assert line.startswith("symgrasp: bottle_on_table: panda: home: {panda_joint")
