"""Changes to the list of a scene's tasks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from symgrasp.errors import InputError, SceneError
from symgrasp.poses import Array
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

from .object_pose import ObjectPose

__all__ = ["TaskList"]


class TaskList(NamedTuple):
    """The tasks of a scene and the poses they were moved to; a change returns a new one.

    Attributes:
        scene: the scene.
        poses: task → base pose, of the tasks that were moved.
        task: the chosen task.
    """

    scene: Scene
    poses: Mapping[str, ObjectPose]
    task: str

    @property
    def T_world_object(self) -> Array:
        """Base pose (4, 4) of the object in the chosen task."""
        pose = self.poses.get(self.task)
        return pose.matrix() if pose else self.scene.task(self.task).T_world_object

    def added(self, pose: Array, previous: ObjectPose | None) -> TaskList:
        """Add a task at an object pose (4, 4), after the chosen one and with its arms.

        Args:
            pose: base pose of the object in the new task.
            previous: the pose that the chosen task returns to; None for that of the scene.
        """
        names = list(self.scene.tasks)
        number = next(n for n in range(len(names) + 1, 10**9) if f"task {n}" not in names)
        task = Task(f"task {number}", self.scene.task(self.task).arms, pose)
        tasks = list(self.scene.tasks.values())
        tasks.insert(names.index(self.task) + 1, task)
        poses = {name: moved for name, moved in self.poses.items() if name != self.task}
        if previous:
            poses[self.task] = previous
        return TaskList(self.scene.with_tasks(tasks), poses, task.name)

    def removed(self) -> TaskList:
        """Remove the chosen task and choose the one before it.

        Raises:
            InputError: it is the only one.
        """
        names = list(self.scene.tasks)
        if len(names) == 1:
            raise InputError("tasks", "remove", self.task, "another task that stays")
        at = names.index(self.task)
        scene = self.scene.with_tasks(task for task in self.scene.tasks.values() if task.name != self.task)
        poses = {name: pose for name, pose in self.poses.items() if name != self.task}
        return TaskList(scene, poses, (names[:at] + names[at + 1 :])[max(at - 1, 0)])

    def shifted(self, by: int) -> TaskList:
        """Move the chosen task by a number of positions in the list, at most to its ends."""
        tasks = list(self.scene.tasks.values())
        at = next(k for k, task in enumerate(tasks) if task.name == self.task)
        to = min(max(at + by, 0), len(tasks) - 1)
        if to == at:
            return self
        tasks.insert(to, tasks.pop(at))
        return self._replace(scene=self.scene.with_tasks(tasks))

    def renamed(self, name: str) -> TaskList:
        """Rename the chosen task.

        Raises:
            InputError: the name is taken or invalid.
        """
        name = name.strip()
        if name == self.task:
            return self
        tasks = [
            replace(task, name=name) if task.name == self.task else task for task in self.scene.tasks.values()
        ]
        poses = {name if old == self.task else old: pose for old, pose in self.poses.items()}
        try:
            return TaskList(self.scene.with_tasks(tasks), poses, name)
        except SceneError as error:  # without the name of the scene's file
            raise InputError("tasks", error.field, name, error.expected) from None
