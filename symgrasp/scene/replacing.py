"""Putting another robot into a scene, and robots to another place."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import count

from symgrasp.errors import SceneError, one_of
from symgrasp.poses import Array
from symgrasp.scene.format import PoseFile, RobotFile
from symgrasp.scene.scene import Scene

__all__ = ["renamed", "with_base", "with_robot"]


def with_base(scene: Scene, name: str, T_world_base: Array) -> Scene:
    """Return a scene with a robot at another pose; models, object and obstacles are shared.

    Args:
        scene: the scene.
        name: of the robot.
        T_world_base: pose (4, 4) of its root link.

    Raises:
        SceneError: there is no such robot, or the pose is out of range.
    """
    index = _index(scene, name)
    base = PoseFile.of(T_world_base)
    files = list(scene.file.robots)
    files[index] = files[index].model_copy(update={"base": base})
    robot = replace(scene.robots[name], T_world_base=base.matrix())
    arms = {k: arm.on(robot) if arm.robot.name == name else arm for k, arm in scene.arms.items()}
    file = scene.file.model_copy(update={"robots": tuple(files)})
    return replace(scene, file=file, robots={**scene.robots, name: robot}, arms=arms)


def with_robot(scene: Scene, name: str, entry: RobotFile) -> Scene:
    """Return a scene with another robot in place of one; object, obstacles and the poses of tasks stay.

    Where a task has the k-th arm of the old robot, it gets the k-th of the new one, or its last.

    Args:
        scene: the scene.
        name: of the robot to replace.
        entry: the other one.

    Raises:
        SceneError: there is no such robot, a name is taken, or a value is out of range.
        UrdfError, MeshError: the other's files are unusable.
    """
    index = _index(scene, name)
    old = [arm.name for arm in scene.file.robots[index].arm_files()]
    new = [arm.name for arm in entry.arm_files()]
    other = {k: new[min(i, len(new) - 1)] for i, k in enumerate(old)}

    def arms(names: Iterable[str]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(other.get(k, k) for k in names))

    robots = tuple(entry if i == index else robot for i, robot in enumerate(scene.file.robots))
    tasks = tuple(
        task.model_copy(update={"arms": arms(scene.tasks[task.name].arms)}) for task in scene.file.tasks
    )
    file = scene.file.model_copy(update={"robots": robots, "tasks": tasks})
    return Scene.from_content(file.model_dump(mode="json", exclude_none=True), scene.source)


def _index(scene: Scene, name: str) -> int:
    if name not in scene.robots:
        raise SceneError(scene.source, "robot", name, one_of(scene.robots, name))
    return list(scene.robots).index(name)


def renamed(scene: Scene, name: str, entry: RobotFile) -> RobotFile:
    """Return an entry under names that are free once it has taken the place of a robot.

    Args:
        scene: the scene.
        name: of the robot to replace.
        entry: the robot that is to take its place; its arms are called after it.
    """
    others = {robot for robot in scene.robots if robot != name}
    others |= {arm.name for arm in scene.arms.values() if arm.robot.name != name}
    others |= {scene.file.object.name, *(obstacle.name for obstacle in scene.obstacles)}
    names = {entry.name, *(arm.name for arm in entry.arm_files())}
    number = next(k for k in count(1) if not others & {_numbered(n, k) for n in names})
    arms = entry.arms and tuple(a.model_copy(update={"name": _numbered(a.name, number)}) for a in entry.arms)
    return entry.model_copy(update={"name": _numbered(entry.name, number), "arms": arms})


def _numbered(name: str, number: int) -> str:
    return name if number == 1 else f"{name}_{number}"
