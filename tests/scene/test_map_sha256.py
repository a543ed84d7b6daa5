"""The key of a scene's maps: equal where they are equal, another one where anything they rest on differs."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from symgrasp.poses import translation
from symgrasp.robot.model import RobotModel
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from tests.conftest import load_small, write_scene

STEP = 1e-3
"""By how much a number of a scene is changed; small enough for every one of them to stay valid."""

ELSEWHERE = {"schema_version", "name", "description", "tasks"}
"""What stands at the top of a scene file and no map depends on."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with meshes, an arm of six joints, a hand and a piece of furniture."""
    for name in ("link", "palm", "shelf", "plate"):
        trimesh.creation.box(extents=[0.1, 0.1, 0.1]).export(tmp_path / f"{name}.stl")
    (tmp_path / "arm.urdf").write_text(arm_urdf())
    palm = link("palm", "palm.stl") + link("finger")
    (tmp_path / "hand.urdf").write_text(robot(palm + joint("squeeze", "palm", "finger", "prismatic")))
    (tmp_path / "shelf.urdf").write_text(robot(link("shelf", "shelf.stl")))
    return tmp_path


def robot(inner: str) -> str:
    return f'<robot name="machine">{inner}</robot>'


def link(name: str, mesh: str = "") -> str:
    shape = f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>' if mesh else ""
    return f'<link name="{name}">{shape}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        '<origin xyz="0 0 0.2"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/>'
        "</joint>"
    )


def arm_urdf() -> str:
    links = link("l0") + "".join(link(f"l{k}", "link.stl") for k in range(1, 7))
    return robot(links + "".join(joint(f"j{k}", f"l{k}", f"l{k + 1}") for k in range(6)))


def full_content() -> dict[str, Any]:
    """A scene in which every kind of number occurs."""
    pose = {"position": [0.5, 0.1, 0.2], "rpy_deg": [10, 20, 30]}
    hand = {
        "name": "gripper", "links": ["palm"], "touch_links": [], "joints": {"squeeze": [[0, 0], [0.1, 0.05]]},
        "min_opening": 0.001, "max_opening": 0.09, "finger_depth": 0.03, "pad_width": 0.02,
        "clearance": 0.004, "radius_tolerance": 0.002, "palm_width": 0.03, "palm_depth": 0.05,
        "tool": {"link": "palm", "pose": {"position": [0, 0, 0.1], "rpy_deg": [0, 0, 5]}},
        "urdf": "hand.urdf",
    }  # fmt: skip
    turned = {"position": [0.1, 0.2, 0.3], "quat_wxyz": [0.5, 0.1, 0.2, 0.3]}
    return {
        "schema_version": 1,
        "name": "everything",
        "robots": [
            {
                "name": "machine", "urdf": "arm.urdf", "base": turned, "home": [0, 0.1, 0.2, 0.3, 0.4, 0.5],
                "hand": hand, "mount": {"link": "l6", "pose": turned},
            }
        ],
        "object": {"name": "can", "profile": [[0, 0.03], [0.1, 0.03], [0.2, 0.02]]},
        "obstacles": [
            {"name": "table", "box": [1, 1, 0.1], "pose": pose},
            {"name": "post", "cylinder": {"radius": 0.1, "height": 0.5}, "pose": pose},
            {"name": "ball", "sphere": {"radius": 0.1}, "pose": pose},
            {"name": "plate", "mesh": "plate.stl", "pose": pose},
            {"name": "shelf", "urdf": "shelf.urdf", "pose": pose},
        ],
        "tasks": [{"name": "hold", "pose": pose}],
        "map": {"heights": 8, "angles": 16, "redundancy": 4, "approach": 0.05, "margin": 0.01},
    }  # fmt: skip


@pytest.fixture
def scene(folder: Path) -> Scene:
    return Scene.load(write_scene(folder, full_content()))


def numbers(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path to every number in plain data."""
    if isinstance(value, (int, float)):
        yield path
    elif isinstance(value, (dict, list)):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(inner, (*path, key))


def nudged(content: dict[str, Any], path: tuple[Any, ...]) -> dict[str, Any]:
    changed = at = copy.deepcopy(content)
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] += 1 if isinstance(at[path[-1]], int) else STEP
    return changed


def test_every_number_of_a_scene_is_part_of_the_key(scene):
    content = {**scene.content, "object": {k: v for k, v in scene.content["object"].items() if k != "scale"}}
    paths = [path for path in numbers(content) if path[0] not in ELSEWHERE]
    assert len(paths) > 70
    keys = [Scene.from_content(nudged(content, path)).map_sha256 for path in paths]
    assert scene.map_sha256 not in keys
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("name", ["link.stl", "palm.stl", "plate.stl", "shelf.stl"])
def test_an_edited_mesh_gives_another_key(name, scene, folder):
    trimesh.creation.box(extents=[0.1, 0.1, 0.2]).export(folder / name)
    assert Scene.from_content(scene.content).map_sha256 != scene.map_sha256
    assert Scene.from_content(scene.content).sha256 == scene.sha256


@pytest.mark.parametrize("name", ["arm.urdf", "hand.urdf", "shelf.urdf"])
def test_an_edited_urdf_gives_another_key(name, scene, folder):
    path = folder / name
    path.write_text(path.read_text().replace('xyz="0 1 0"', 'xyz="1 0 0"').replace("shelf.stl", "plate.stl"))
    assert Scene.from_content(scene.content).map_sha256 != scene.map_sha256


@pytest.mark.parametrize("name", ["pick_pour_place", "log_two_robots"])
def test_scenes_of_the_same_content_share_a_key(name):
    scene = Scene.load(name)
    assert Scene.load(name).map_sha256 == scene.map_sha256
    assert Scene.from_content(json.loads(json.dumps(scene.content))).map_sha256 == scene.map_sha256
    assert pickle.loads(pickle.dumps(scene)).map_sha256 == scene.map_sha256


def test_names_of_scenes_and_tasks_are_no_part_of_the_key(scene):
    content = {**scene.content, "name": "another", "description": "told in other words"}
    task = scene.task()
    moved = Task(task.name, task.arms, translation([0.1, 0.0, 0.0]) @ task.T_world_object)
    same = [
        Scene.from_content(content),
        scene.with_task(moved),
        scene.with_tasks([task, Task("second", task.arms, np.eye(4))]),
    ]
    assert {other.map_sha256 for other in same} == {scene.map_sha256}


def test_another_hand_object_or_setting_gives_another_key():
    scene = load_small("bottle_on_table")
    other = Scene.load("soda_can")
    keys = {
        scene.map_sha256,
        scene.with_object("can", other.profile).map_sha256,
        scene.with_object("can", scene.profile).map_sha256,
        scene.with_settings(margin=0.01).map_sha256,
        scene.with_settings(angles=32).map_sha256,
    }
    assert len(keys) == 5


def test_models_are_equal_by_their_content(folder):
    model = RobotModel(folder / "arm.urdf")
    for same in (RobotModel(folder / "arm.urdf"), pickle.loads(pickle.dumps(model))):
        assert same == model
        assert hash(same) == hash(model)
    trimesh.creation.box(extents=[0.1, 0.1, 0.2]).export(folder / "link.stl")
    assert RobotModel(folder / "arm.urdf") != model
    assert RobotModel(folder / "shelf.urdf") != model
    assert model != model.urdf
