"""Robots that are replaced and moved: one step each, and nothing else of the scene changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.choices.robot_arms import tool_links
from app.choices.robot_choice import OWN_ROBOT, installed_robots
from app.choices.scene_assets import BuiltScene, UploadFolder
from app.files.links import Link
from app.files.robot_files import catalogue_entry
from app.state import robot_changes
from app.state.object_pose import ObjectPose
from app.state.state import State
from app.state.undo import redo, remember, undo
from symgrasp.errors import InputError
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.scene.replacing import renamed, with_base, with_robot
from symgrasp.scene.scene import Scene

IIWA = next(robot for robot in CATALOGUE if robot.name == "iiwa")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.load("handover_between_robots")


def put(state: State) -> State:
    name = state.robot.name
    entry = renamed(state.scene, name, catalogue_entry(IIWA))
    built = BuiltScene(with_robot(state.scene, name, entry), {})
    return remember(state, robot_changes.put_robot(state, built, name, IIWA.title), "", 0.0)


def test_a_robot_takes_anothers_place_in_one_step(scene):
    moved = {scene.task().name: ObjectPose(0.1, 0.2, 0.3)}
    first = replace(State.of(scene, "handover_between_robots"), poses=moved, delta=0.5)
    after = put(first)
    assert after.robot_option == IIWA.title
    assert (after.task, after.poses, after.delta) == (first.task, moved, 0.5)
    others = [name for name in scene.robots if name != first.robot.name]
    assert [name for name in after.scene.robots if name in others] == others
    back = undo(after)
    assert (back.scene, back.robot_option) == (scene, OWN_ROBOT)
    assert redo(back).scene is after.scene


def test_only_the_robot_of_the_chosen_arm_moves(scene):
    state = State.of(scene, "handover_between_robots")
    after = robot_changes.place_robot(state, x=0.25, spin=np.deg2rad(30))
    for name, robot in after.scene.robots.items():
        before = scene.robots[name]
        assert robot.model is before.model
        if name == state.robot.name:
            turn = np.deg2rad(30)
            assert np.isclose(robot.T_world_base[0, 3], 0.25)
            assert np.allclose(robot.T_world_base[:2, 0], [np.cos(turn), np.sin(turn)])
        else:
            assert robot is before
    assert after.request.key != state.request.key
    again = Scene.from_content(after.scene.content)  # as it is saved
    assert all(
        np.allclose(r.T_world_base, after.scene.robots[n].T_world_base) for n, r in again.robots.items()
    )
    assert again.map_sha256 == after.scene.map_sha256


def test_a_robot_that_is_let_go_where_it_was_has_not_moved(scene):
    state = State.of(scene, "handover_between_robots")
    pose = state.robot.T_world_base.copy()
    pose[:3, 3] += 1e-8  # browsers send rounded numbers
    assert robot_changes.robot_dragged(state, pose) is state
    assert robot_changes.place_robot(state, x=ObjectPose.of(state.robot.T_world_base).x) is state


def test_a_hand_is_put_on_links_of_the_robot_alone():
    """Not on the frame that a hand is given at its tips, nor on a hand that is mounted."""
    mounted = Scene.load("ur5_bottle")
    (name,) = mounted.arms
    assert "tool0" in tool_links(mounted, name)
    assert not set(tool_links(mounted, name)) & {*mounted.arm().hand.links, mounted.arm().tool}
    assert tool_links(Scene.load("pr2_pour"), "left")[-1] == "l_gripper_tool_frame"


def test_tool_poses_move_with_the_base(scene):
    arm = scene.arm()
    pose = ObjectPose(0.3, -0.2, 0.1, 0.4, 1.0, 2.0).matrix()
    moved = with_base(scene, arm.robot.name, pose).arm()
    q = np.linspace(-1, 1, arm.dof)
    assert np.allclose(moved.world_tool_pose(q), pose @ arm.tool_pose(q))


def test_links_say_that_they_cannot_carry_a_robot(scene):
    state = State.of(scene, "handover_between_robots")
    for changed in (put(state), robot_changes.place_robot(state, z=0.5)):
        with pytest.raises(InputError, match="save the scene instead"):
            Link.of(changed, scene)
    Link.of(state, scene)


def test_folders_of_uploads_go_with_the_last_state():
    folder = UploadFolder()
    path = folder.path
    assert path.is_dir()
    del folder
    assert not path.exists()


def test_the_menu_offers_what_is_installed():
    assert {"Franka Emika Panda", IIWA.title} <= set(installed_robots())
