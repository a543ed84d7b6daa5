"""Changes of the state by a person: scene, object, task, arm, pose, grasp, list of tasks, link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symgrasp.errors import InputError, one_of
from symgrasp.object.manifold import wrap
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

from ..choices.object_choice import ObjectChoice
from ..choices.uploaded_scene import UploadedScene
from .map_view_state import RollChoice
from .object_pose import ObjectPose
from .page_link import Camera, PageLink
from .plans.plan_changes import show_step
from .state import Pick, State
from .task_list import TaskList

__all__ = [
    "GIZMO_NOISE",
    "add_task",
    "change_tasks",
    "choose",
    "choose_arm",
    "choose_candidate",
    "choose_cell",
    "choose_object",
    "choose_roll",
    "choose_surface_cell",
    "choose_task",
    "clear_pick",
    "drag",
    "linked",
    "move_elbow",
    "moved",
    "open_scene",
    "open_upload",
    "reset_pose",
    "seen_from",
    "switched",
    "toggled",
    "turn",
    "without_plan",
]

GIZMO_NOISE = 1e-6
"""A gizmo that moved less (m, or of a unit vector) was only turned: browsers send rounded numbers."""

CAMERA_NOISE = 1e-3
"""A camera that moved less (m) leaves a link up to date: links are rounded to this."""


# -- scene, object, task, arm ---------------------------------------------------------------


def open_scene(state: State, scene: Scene, name: str) -> State:
    """Show another scene; uploads, display options and the history are kept."""
    return replace(
        State.of(scene, name),
        uploaded_object=state.uploaded_object,
        uploaded_scene=state.uploaded_scene,
        uploaded_robot=state.uploaded_robot,
        map_view=state.map_view.for_another_scene(),
        survey=state.survey,
        display=replace(state.display, drag_handles=False, base_handles=False, symmetry_error=False),
        history=state.history,
        tour=state.tour,
    )


def open_upload(state: State, uploaded: UploadedScene) -> State:
    """Show an uploaded scene and keep it in the menu."""
    opened = open_scene(replace(state, uploaded_scene=uploaded), uploaded.scene, uploaded.option)
    return replace(opened, assets=uploaded.assets)


def choose_object(state: State, scene: Scene, choice: ObjectChoice | None) -> State:
    """Show the scene with another object in it, or with its own again (None)."""
    uploaded = choice if choice and choice.measurement else state.uploaded_object
    return replace(
        without_plan(state),
        busy=None,
        result=None,
        pick=None,
        scene=scene,
        object_choice=choice,
        uploaded_object=uploaded,
        display=replace(state.display, symmetry_error=False),
    )


def flip_object(state: State) -> State:
    """Show the scene with the uploaded object that is in it standing on its other end."""
    choice = state.object_choice
    if choice is None or choice.measurement is None:
        return state
    choice = choice.flipped()
    flipped = choose_object(state, state.scene.with_object(choice.name, choice.profile), choice)
    return replace(flipped, display=state.display)


def choose_task(state: State, name: str) -> State:
    """Show another task, with its first arm unless the chosen one takes part in it."""
    task = state.scene.task(name)
    if name == state.task:
        return state
    arm = state.arm if state.arm in task.arms else task.arms[0]
    pose = state.poses.get(name)
    return replace(state, task=name, arm=arm, pose_when_chosen=pose, delta=0.0, step=None, problem="")


def choose_arm(state: State, name: str) -> State:
    """Show the map of another arm of the task, with that arm's grasp if a plan is shown.

    Raises:
        InputError: the task has no such arm.
    """
    arms = state.scene.task(state.task).arms
    if name not in arms:
        raise InputError("page", "arm", name, one_of(arms, name))
    after = replace(state, arm=name, problem="")
    in_plan = after.shown_task and any(hold.arm == name for hold in after.shown_task.holds)
    return show_step(after, state.step or 0) if in_plan else replace(after, step=None)


def switched(state: State, **switches: bool) -> State:
    """Set switches of the page; see `Display`."""
    return replace(state, display=replace(state.display, **switches))


def toggled(state: State, switch: str) -> State:
    """Turn a switch of the page on or off; see `Display`."""
    return switched(state, **{switch: not getattr(state.display, switch)})


# -- pose of the object ---------------------------------------------------------------------


def turn(state: State, delta: float) -> State:
    """Set the turn δ (rad) of the object about its axis; maps are shifted, not recomputed.

    Raises:
        InputError: δ is not finite.
    """
    return replace(state, delta=float(_finite("rotation", delta)), step=None, problem="")


def moved(state: State, **changes: float) -> State:
    """Set fields of the base pose (see `ObjectPose`, in m and rad); a plan is dropped if the pose changes.

    Raises:
        InputError: a value is not finite.
    """
    for name, value in changes.items():
        _finite(name, value)
    pose = replace(state.base, **changes)
    if pose == state.base:
        return state
    return replace(without_plan(state), poses={**state.poses, state.task: pose})


def drag(state: State, pose: Array) -> State:
    """Move the object to the pose (4, 4) of the gizmo; a rotation about its axis changes only δ."""
    new = ObjectPose.of(pose)
    delta = float(wrap(new.spin - state.base.spin))
    shift = np.linalg.norm(pose[:3, 3] - state.T_world_object[:3, 3])
    tilt = np.linalg.norm(pose[:3, 2] - state.T_world_object[:3, 2])
    if max(shift, tilt) < GIZMO_NOISE:
        return turn(state, delta)
    after = moved(state, x=new.x, y=new.y, z=new.z, lean=new.lean, towards=new.towards)
    return replace(after, delta=delta)


def reset_pose(state: State) -> State:
    """Reset the object's pose in the chosen task to that of the scene, and δ to 0."""
    poses = {name: pose for name, pose in state.poses.items() if name != state.task}
    after = state if len(poses) == len(state.poses) else without_plan(state)
    return replace(after, poses=poses, delta=0.0, step=None, problem="")


def without_plan(state: State) -> State:
    """Drop all plan results, and whatever a person started that is being computed."""
    busy = state.busy if state.busy and state.busy.request else None
    results = state.plan_results.cleared()
    return replace(state, plan_results=results, step=None, busy=busy, refused=None, problem="")


# -- grasp ----------------------------------------------------------------------------------


def choose(state: State, h: float, theta: float) -> State:
    """Pick the grasp at height h (m) and angle θ (rad) in the object's frame.

    Raises:
        InputError: h is outside of the object, or a value is not finite.
    """
    profile = state.scene.profile
    if not profile.h_min <= _finite("h", h) <= profile.h_max:
        expected = f"{100 * profile.h_min:g} to {100 * profile.h_max:g} cm"
        raise InputError("grasp", "h (cm)", round(100 * h, 3), expected)
    theta = float(wrap(_finite("θ", theta)))
    map_view = state.map_view.for_another_cell()
    return replace(state, pick=Pick(float(h), theta), map_view=map_view, step=None, problem="")


def choose_cell(state: State, row: int, column: int) -> State:
    """Pick the centre of a cell of the shifted map, `State.map`."""
    if state.map is None:
        return state
    manifold = state.map.manifold
    return choose(state, float(manifold.h[row]), float(manifold.theta[column]))


def choose_surface_cell(state: State, row: int, column: int) -> State:
    """Pick a cell of the unshifted map, whose colours lie on the object's surface."""
    if state.result is None:
        return state
    _, turned = state.result.map.manifold.shift(state.delta)
    return choose_cell(state, row, (column - turned) % state.result.map.manifold.angles)


def choose_roll(state: State, roll: RollChoice) -> State:
    """Show other rolls; a picked grasp keeps h and θ and takes the roll shown."""
    pick = replace(state.pick, roll=None) if state.pick else None
    return replace(state, pick=pick, map_view=replace(state.map_view.for_another_cell(), roll=roll))


def choose_candidate(state: State, candidate: int) -> State:
    """Show a candidate of the picked cell by its index; 0 is the best."""
    return replace(state, map_view=state.map_view.with_candidate(candidate), step=None)


def move_elbow(state: State, phi: float) -> State:
    """Move the elbow of the arm that holds the object to a value of the redundancy (rad)."""
    return replace(state, map_view=replace(state.map_view, elbow=phi), step=None)


def clear_pick(state: State) -> State:
    """Drop the picked grasp; the arms return home."""
    return replace(state, pick=None, map_view=state.map_view.for_another_cell(), step=None)


# -- list of tasks --------------------------------------------------------------------------


def change_tasks(state: State, change: Callable[[TaskList], TaskList]) -> State:
    """Change the list of tasks; plan results are dropped if it changes."""
    before = TaskList(state.scene, state.poses, state.task)
    after = change(before)
    if after == before:
        return state
    arms = after.scene.task(after.task).arms
    stays = np.array_equal(after.T_world_object, before.T_world_object)
    is_same = len(after.scene.tasks) == len(before.scene.tasks)
    return replace(
        without_plan(state),
        scene=after.scene,
        poses=after.poses,
        task=after.task,
        arm=state.arm if state.arm in arms else arms[0],
        pose_when_chosen=state.pose_when_chosen if is_same else after.poses.get(after.task),
        delta=state.delta if stays else 0.0,
    )


def add_task(state: State) -> State:
    """Add a task at the object's present pose; the chosen task returns to the pose it had when chosen."""
    pose = state.request.T_world_object
    return change_tasks(state, lambda tasks: tasks.added(pose, state.pose_when_chosen))


# -- link -----------------------------------------------------------------------------------


def linked(state: State, address: str, camera: Camera) -> State:
    """Store the link that was made of the state; its camera is the six numbers of `Camera`."""
    return replace(state, link=PageLink(address, state.link_values, camera), problem="")


def seen_from(state: State, camera: Camera) -> State:
    """Take a new camera pose: a link with another one becomes out of date."""
    if state.link is None or not state.link.values:
        return state
    if np.allclose(camera, state.link.camera, rtol=0, atol=CAMERA_NOISE):
        return state
    return replace(state, link=replace(state.link, values=()))


def _finite(name: str, value: float) -> float:
    if not np.isfinite(value):
        raise InputError("page", name, value, "a finite number")
    return value
