"""Changes of the state by a person: which robots stand where, and with which arms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symgrasp.errors import InputError, one_of
from symgrasp.poses import Array
from symgrasp.scene.replacing import with_base

from ..choices.robot_choice import OWN_ROBOT, UploadedRobot
from ..choices.scene_assets import BuiltScene
from .changes import GIZMO_NOISE, without_plan
from .object_pose import ObjectPose
from .state import State

__all__ = [
    "hand_changed",
    "place_robot",
    "put_robot",
    "rearmed",
    "robot_dragged",
    "robot_put_at",
    "use_arm",
]


def put_robot(
    state: State, built: BuiltScene, name: str, option: str, uploaded: UploadedRobot | None = None
) -> State:
    """Show the scene with another robot in place of one.

    Args:
        state: the state.
        built: the scene with the other robot.
        name: of the robot that it replaces.
        option: the other robot's option in the menu.
        uploaded: the other robot, if it was uploaded.
    """
    new = list(built.scene.robots)[list(state.scene.robots).index(name)]
    options = {robot: o for robot, o in state.robot_options.items() if robot != name}
    if option != OWN_ROBOT:
        options[new] = option
    folders = [uploaded.folder] if uploaded else []
    arms = built.scene.task(state.task).arms
    own = [arm for arm in arms if built.scene.arms[arm].robot.name == new]
    arm = own[0] if state.robot.name == name and own else state.arm if state.arm in arms else arms[0]
    return replace(
        hand_changed(state, built),
        arm=arm,
        robot_options=options,
        changed_arms=state.changed_arms
        & {a for a in built.scene.arms if built.scene.arms[a].robot.name != new},
        uploaded_robot=uploaded or state.uploaded_robot,
        assets=state.assets.of(built, folders),
    )


def hand_changed(state: State, built: BuiltScene) -> State:
    """Show the scene with another hand on the mount of an arm."""
    return replace(
        without_plan(state),
        busy=None,
        result=None,
        pick=None,
        scene=built.scene,
        assets=state.assets.of(built),
    )


def rearmed(state: State, built: BuiltScene, arm: str) -> State:
    """Show the scene with another tool link of an arm, or a hand that its file does not mount."""
    return replace(hand_changed(state, built), changed_arms=state.changed_arms | {arm})


def robot_put_at(state: State, name: str, pose: ObjectPose) -> State:
    """Put a robot to a pose of its root link, given as a position, a lean and a turn."""
    if np.allclose(pose.matrix(), state.scene.robots[name].T_world_base, rtol=0, atol=GIZMO_NOISE):
        return state
    return replace(without_plan(state), scene=with_base(state.scene, name, pose.matrix()))


def robot_dragged(state: State, T_world_base: Array) -> State:
    """Put the robot of the chosen arm to a pose (4, 4)."""
    return robot_put_at(state, state.robot.name, ObjectPose.of(T_world_base))


def place_robot(state: State, **values: float) -> State:
    """Change single values of where the robot of the chosen arm stands; see `ObjectPose`."""
    pose = ObjectPose.of(state.robot.T_world_base)
    return robot_put_at(state, state.robot.name, replace(pose, **values))


def use_arm(state: State, name: str) -> State:
    """Let another arm of the same robot do what the chosen one does, in all tasks.

    Raises:
        InputError: the robot has no such arm.
    """
    arms = [arm.name for arm in state.scene.arms.values() if arm.robot is state.robot]
    if name not in arms:
        raise InputError("page", "arm", name, one_of(arms, name))
    if name == state.arm:
        return state
    other = {state.arm: name, name: state.arm}
    tasks = [
        replace(task, arms=tuple(other.get(arm, arm) for arm in task.arms))
        for task in state.scene.tasks.values()
    ]
    return replace(without_plan(state), scene=state.scene.with_tasks(tasks), arm=name, pick=None)
