"""The tasks in a link: where they were moved to, and the list of them where a person changed it.

    tasks=pick,twist,place&at.twist=50,10,30,110,90,0&arms.twist=iiwa,panda

``tasks`` names all of them in order. One that the scene on the server has is as it is there, but for
what ``at.`` (where it was moved to) and ``arms.`` say. Any other is a new one: ``at.`` is its own pose,
and its arms are those of the scene's first task unless ``arms.`` names them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from symgrasp.errors import InputError, one_of
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

from ..state.object_pose import ObjectPose
from ..state.state import State
from .link_values import names_text, one, pose, pose_text, read_names

__all__ = ["is_about_tasks", "read_tasks", "tasks_text"]

SAME = 1e-9
"""Poses whose matrices differ less stand at the same place: files keep them as quaternions."""


def is_about_tasks(key: str) -> bool:
    """Whether a part of a link is read here."""
    return key == "tasks" or key.startswith(("at.", "arms."))


def tasks_text(state: State, known: Mapping[str, Task]) -> dict[str, str]:
    """Return the parts of a link that say how the tasks differ from those on the server.

    Args:
        state: what is shown.
        known: the tasks of its scene as the server has it.
    """
    tasks, parts = state.scene.tasks, {}
    if list(tasks) != list(known):
        parts["tasks"] = names_text(tasks)
    for name, task in tasks.items():
        if task.arms != _usual_arms(name, known):
            parts[f"arms.{name}"] = names_text(task.arms)
        moved = state.poses.get(name)
        if moved is None and not _stands_as_known(task, known):
            moved = ObjectPose.of(task.T_world_object)
        if moved:
            parts[f"at.{name}"] = pose_text(moved)
    return parts


def read_tasks(state: State, settings: Mapping[str, str]) -> State:
    """Return the first state of a scene with the tasks of a link; the first of them is shown.

    Raises:
        SymgraspError: they are no tasks of that scene.
    """
    known = state.scene.tasks
    scene = _listed(state.scene, settings)
    poses = {}
    for key, text in settings.items():
        where, _, name = key.partition(".")
        if where == "at" and scene.task(name).name in known:
            poses[name] = pose(key, text)
    task = scene.task()
    before = poses.get(task.name)
    return replace(state, scene=scene, poses=poses, pose_when_chosen=before, task=task.name, arm=task.arms[0])


def _listed(scene: Scene, settings: Mapping[str, str]) -> Scene:
    """Return the scene with the list of tasks of a link."""
    if not any(key == "tasks" or key.startswith("arms.") for key in settings):
        return scene
    known = scene.tasks
    names = read_names("tasks", settings["tasks"]) if "tasks" in settings else list(known)
    for key in settings:
        what, _, name = key.partition(".")
        if what == "arms" and name not in names:
            raise InputError("link", key, settings[key], f"arms of a task: {one_of(names, name)}")
    tasks = []
    for name in names:
        arms, at = f"arms.{name}", f"at.{name}"
        task = known.get(name)
        if task is None and at not in settings:
            raise InputError("link", "tasks", name, f"{one_of(known, name)}; a new task needs at.<task>")
        own = task.T_world_object if task else pose(at, settings[at]).matrix()
        arm_names = _usual_arms(name, known)
        if arms in settings:
            arm_names = tuple(one(arms, arm, scene.arms) for arm in read_names(arms, settings[arms]))
        tasks.append(Task(name, arm_names, own))
    return scene.with_tasks(tasks)


def _usual_arms(name: str, known: Mapping[str, Task]) -> tuple[str, ...]:
    """Return the arms of a task that a link says nothing about."""
    return known.get(name, next(iter(known.values()))).arms


def _stands_as_known(task: Task, known: Mapping[str, Task]) -> bool:
    """Whether the server has a task of that name with the same pose."""
    own = known.get(task.name)
    return own is not None and np.allclose(own.T_world_object, task.T_world_object, rtol=0, atol=SAME)
