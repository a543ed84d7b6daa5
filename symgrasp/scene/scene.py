"""Scenes: robots, an object of revolution, obstacles and tasks, validated and with all names resolved."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from symgrasp.errors import SceneError, one_of
from symgrasp.files import LARGEST_YAML, parse_yaml, read_file
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.page import page_module
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.building import SceneBuilder, check_settings
from symgrasp.scene.content import content_sha256
from symgrasp.scene.field_errors import describe_error
from symgrasp.scene.format import (
    MOST_TASKS,
    MapSettings,
    ObjectFile,
    PoseFile,
    SceneFile,
    TaskFile,
)
from symgrasp.scene.map_content import map_content
from symgrasp.scene.parts import Obstacle, Task
from symgrasp.scene.shipped import missing_extra, shipped_scenes

__all__ = ["Scene", "load_scene"]


@dataclass(frozen=True, eq=False)
class Scene:
    """Robots, an object of revolution, obstacles and tasks; immutable, ``with_…`` return changed copies.

    Attributes:
        source: the file it came from, for error messages.
        file: the validated content of the file, with every file reference made absolute.
        robots: name → robot.
        arms: name → arm, over all robots.
        profile: the object's r(h).
        obstacles: the obstacles.
        tasks: name → task, in order.
        notes: what the file did not say and was guessed, in words; `file` says it all.
    """

    source: str
    file: SceneFile
    robots: Mapping[str, Robot]
    arms: Mapping[str, Arm]
    profile: Profile
    obstacles: tuple[Obstacle, ...]
    tasks: Mapping[str, Task]
    notes: tuple[str, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of the attributes to pickle: another thread may cache one meanwhile."""
        return self.__dict__.copy()

    @staticmethod
    def load(scene: str | Path) -> Scene:
        """Load a shipped scene by name, or any scene by path.

        Args:
            scene: a shipped name, or the path of a YAML file.

        Raises:
            SceneError: there is no such scene, it is not YAML, or a field is wrong.
            UrdfError: a robot's URDF is unusable.
            ProfileError: the object's profile is unusable.
            MeshError: the object's mesh is unusable.
        """
        path = Path(scene)
        if path.suffix not in (".yaml", ".yml"):
            shipped = shipped_scenes()
            if path.is_file():
                raise SceneError(path, "file", path.suffix, "a scene: a file that ends in .yaml")
            if str(scene) not in shipped:
                raise SceneError("scene", "name", str(scene), one_of(shipped, scene) + ", or a .yaml file")
            path = shipped[str(scene)]
            extra = missing_extra(path)
            if extra:
                expected = f"a scene whose robots are installed: pip install 'symgrasp[{extra}]'"
                raise SceneError("scene", "name", str(scene), expected)
        try:
            text = read_file(path, LARGEST_YAML).decode("utf-8")
        except (OSError, ValueError) as error:
            raise SceneError(path, "file", str(path), f"a readable text file ({error})") from error
        return Scene.parse(text, source=str(path), folder=path.parent)

    @staticmethod
    def parse(text: str, source: str = "scene", folder: Path = Path()) -> Scene:
        """Build a scene from YAML text.

        Args:
            text: the content of a scene file.
            source: its name for error messages.
            folder: the folder that file references are relative to.

        Raises:
            SceneError, UrdfError, ProfileError, MeshError: see `load`.
        """
        try:
            content = parse_yaml(text)
        except ValueError as error:
            raise SceneError(source, "file", str(error), "a YAML document") from error
        if not isinstance(content, dict):
            raise SceneError(source, "file", content, "a YAML mapping with schema_version, name, robots, …")
        return Scene.from_content(content, source, folder)

    @staticmethod
    def from_content(content: Mapping[str, Any], source: str = "scene", folder: Path = Path()) -> Scene:
        """Build a scene from the parsed content of a scene file; see `parse` for the arguments.

        Raises:
            SceneError, UrdfError, ProfileError, MeshError: see `load`.
        """
        try:
            file = SceneFile.model_validate(content)
        except ValidationError as error:
            raise SceneError(source, *describe_error(error, content)) from None
        return Scene(source, *SceneBuilder(file, source, folder).build())

    @cached_property
    def content(self) -> dict[str, Any]:
        """The content of the scene file as plain data, from which `from_content` builds the same scene."""
        return self.file.model_dump(mode="json", exclude_none=True)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the content as canonical JSON."""
        return content_sha256(self.content)

    @cached_property
    def map_sha256(self) -> str:
        """SHA-256 of all that a map depends on besides the arm, the task's pose and the grid asked for.

        Robots, object, obstacles, map settings, and the files of URDFs and collision meshes as they
        were when the scene was loaded. The scene's name, description and tasks have no part in it.
        """
        thing, mass = self.file.object.name, self.object_mass
        return content_sha256(
            map_content(self.robots, self.arms, thing, self.profile, mass, self.obstacles, self.settings)
        )

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.file.name

    @property
    def settings(self) -> MapSettings:
        """The resolution of the maps, and the retreat and margin that they demand."""
        return self.file.map

    @property
    def object_mass(self) -> float:
        """Mass of the object (kg); zero where the file gives none."""
        return self.file.object.mass or 0.0

    @cached_property
    def manifold(self) -> Manifold:
        """The grasp manifold of the object, at the resolution of the settings."""
        return Manifold(self.profile, self.settings.heights, self.settings.angles)

    def arm(self, name: str | None = None) -> Arm:
        """Return an arm by name, or the first arm if no name is given.

        Raises:
            SceneError: there is no such arm.
        """
        if name is None:
            return next(iter(self.arms.values()))
        if name not in self.arms:
            raise SceneError(self.source, "arm", name, one_of(self.arms, name))
        return self.arms[name]

    def task(self, name: str | None = None) -> Task:
        """Return a task by name, or the first task if no name is given.

        Raises:
            SceneError: there is no such task.
        """
        if name is None:
            return next(iter(self.tasks.values()))
        if name not in self.tasks:
            raise SceneError(self.source, "task", name, one_of(self.tasks, name))
        return self.tasks[name]

    def with_task(self, task: Task) -> Scene:
        """Return the scene with the task of the same name replaced; robots and object are shared.

        Raises:
            SceneError: there is no task of that name.
        """
        self.task(task.name)
        file = _task_file(task)
        files = tuple(file if t.name == task.name else t for t in self.file.tasks)
        return replace(
            self,
            file=self.file.model_copy(update={"tasks": files}),
            tasks={**self.tasks, task.name: task},
        )

    def with_supported(self, task: str, *, supported: bool | None) -> Scene:
        """Return the scene in which a task says, or does not say, whether something holds the object up."""
        files = (
            t.model_copy(update={"supported": supported}) if t.name == task else t for t in self.file.tasks
        )
        return replace(
            self,
            file=self.file.model_copy(update={"tasks": tuple(files)}),
            tasks={**self.tasks, task: replace(self.task(task), supported=supported)},
        )

    def with_tasks(self, tasks: Iterable[Task]) -> Scene:
        """Return the scene with these tasks in this order; robots and object are shared.

        Raises:
            SceneError: there are no tasks or too many, a name is used twice or empty, or an arm is unknown.
        """
        tasks = tuple(tasks)
        names = [task.name for task in tasks]
        if not names:
            raise SceneError(self.source, "tasks", names, "at least one task")
        if len(tasks) > MOST_TASKS:
            raise SceneError(self.source, "tasks", len(tasks), f"at most {MOST_TASKS:,} of them")
        files = []
        for i, task in enumerate(tasks):
            if task.name in names[:i]:
                raise SceneError(self.source, "tasks: name", task.name, "a name that is not used twice")
            for arm in task.arms:
                self.arm(arm)
            try:
                files.append(_task_file(task))
            except ValidationError as error:
                raise SceneError(f"tasks[{i}]", *describe_error(error, {"name": task.name})) from None
        return replace(
            self,
            file=self.file.model_copy(update={"tasks": tuple(files)}),
            tasks={task.name: task for task in tasks},
        )

    def with_object(self, name: str, profile: Profile) -> Scene:
        """Return the scene with another object in place of its own; robots and obstacles are shared.

        Raises:
            SceneError: the name is empty or too long, or that of a robot or obstacle.
        """
        try:
            object_file = ObjectFile(name=name, profile=[tuple(p) for p in profile.points.tolist()])
        except ValidationError as error:
            raise SceneError("object", *describe_error(error, {"name": name})) from None
        if name in (*self.robots, *(o.name for o in self.obstacles)):
            raise SceneError("object", "name", name, "a name that no robot or obstacle of the scene has")
        return replace(self, file=self.file.model_copy(update={"object": object_file}), profile=profile)

    @property
    def replaceable_hands(self) -> dict[str, str]:
        """Name of each arm whose hand can be replaced by `with_hand` → name of its hand."""
        arms = [arm for robot in self.file.robots for arm in robot.arm_files()]
        return {a.name: a.hand for a in arms if a.mount and a.tool is None and isinstance(a.hand, str)}

    def with_hand(self, arm: str, hand: str) -> Scene:
        """Return the scene with another hand on an arm.

        Args:
            arm: name of the arm, one of `replaceable_hands`.
            hand: name of a hand with a URDF of its own.

        Raises:
            SceneError: the arm's hand cannot be replaced, or there is no such hand that can be mounted.
            UrdfError: a name of the hand's URDF is taken on the robot.
        """
        if arm not in self.replaceable_hands:
            raise SceneError(self.source, "arm", arm, one_of(self.replaceable_hands, arm))
        content = self.file.model_dump(mode="json", exclude_none=True)
        for robot in content["robots"]:
            for entry in robot.get("arms", [robot]):
                if entry["name"] == arm:
                    entry["hand"] = hand
        return Scene.from_content(content, self.source)

    def show(self) -> None:
        """Show the scene with the map of its first task and that task's first arm; see `FeasibilityMap.show`.

        Raises:
            SymgraspError: the package of the page is not installed.
        """
        page_module("server.notebook").scene_map(self).show()

    def with_settings(self, **changes: float | str) -> Scene:
        """Return the scene with other map settings; robots and object are shared.

        Raises:
            SceneError: a setting is unknown or out of range.
        """
        try:
            settings = MapSettings.model_validate({**self.settings.model_dump(), **changes})
        except ValidationError as error:
            raise SceneError("map settings", *describe_error(error, changes)) from None
        check_settings(self.source, self.arms.values(), self.profile, settings)
        return replace(self, file=self.file.model_copy(update={"map": settings}))


def load_scene(scene: str | Path | Mapping[str, Any]) -> Scene:
    """Load a scene.

    Args:
        scene: the name of a shipped scene, the path of a .yaml file, or the content of such a file; files
            that a content refers to are found from the current folder.

    Raises:
        SceneError: no such scene, not YAML, or a field is wrong.
        UrdfError, MeshError, ProfileError: a file that the scene refers to is unusable.
    """
    return Scene.from_content(scene) if isinstance(scene, Mapping) else Scene.load(scene)


def _task_file(task: Task) -> TaskFile:
    """Return a task as a scene file has it; raise ValidationError if its name is empty or too long."""
    pose = PoseFile.of(task.T_world_object)
    return TaskFile(name=task.name, arms=task.arms, pose=pose, supported=task.supported)
