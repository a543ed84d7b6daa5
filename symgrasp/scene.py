"""Scenes: robots, an object of revolution, obstacles and tasks, and their YAML file format.

The classes named ``…File`` mirror the file and produce its JSON Schema; `Scene` is what the rest
of the library works with: validated, immutable, every name resolved.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, model_validator

from symgrasp.assembly import Frame, Mount
from symgrasp.errors import InputError, SceneError, one_of
from symgrasp.files import SCENES_DIR, resolve
from symgrasp.hand import HANDS, Hand
from symgrasp.manifold import Manifold
from symgrasp.poses import Array, from_position_quat, from_position_rpy, quat_wxyz
from symgrasp.profile import Profile
from symgrasp.robot import Arm, Robot, RobotModel

__all__ = ["MapSettings", "Obstacle", "Scene", "SceneFile", "Task", "scene_schema", "shipped_scenes"]

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=100)]
Vector = tuple[Number, Number, Number]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PoseFile(_Strict):
    """A pose: position (m) and either roll-pitch-yaw (degrees) or a wxyz quaternion."""

    position: Vector = (0.0, 0.0, 0.0)
    rpy_deg: Vector | None = None
    quat_wxyz: tuple[Number, Number, Number, Number] | None = None

    @model_validator(mode="after")
    def _one_rotation(self) -> PoseFile:
        if self.rpy_deg is not None and self.quat_wxyz is not None:
            raise ValueError("either rpy_deg or quat_wxyz, not both")
        if self.quat_wxyz is not None and np.linalg.norm(self.quat_wxyz) < 1e-6:
            raise ValueError("a quaternion with a length above zero")
        return self

    def matrix(self) -> Array:
        """Return the pose as a matrix (4, 4)."""
        if self.quat_wxyz is not None:
            return from_position_quat(self.position, self.quat_wxyz)
        return from_position_rpy(self.position, np.deg2rad(self.rpy_deg or (0.0, 0.0, 0.0)))

    @staticmethod
    def of(pose: ArrayLike) -> PoseFile:
        """Write a matrix (4, 4) as position and quaternion."""
        pose = np.asarray(pose, dtype=float)
        return PoseFile(position=tuple(pose[:3, 3].tolist()), quat_wxyz=tuple(quat_wxyz(pose).tolist()))


class FrameFile(_Strict):
    """A frame fixed to a link."""

    link: str
    pose: PoseFile = PoseFile()

    def frame(self) -> Frame:
        """Return it as the library has it."""
        pose = self.pose.matrix()
        return Frame(self.link, tuple(pose[:3, 3].tolist()), tuple(quat_wxyz(pose).tolist()))


class HandFile(_Strict):
    """A hand described inline; the fields of `symgrasp.hand.Hand`."""

    name: Name
    links: Annotated[tuple[str, ...], Field(min_length=1)]
    touch_links: tuple[str, ...]
    joints: dict[str, Number | list[tuple[NotNegative, Number]]]
    min_opening: NotNegative
    max_opening: Positive
    finger_depth: NotNegative
    pad_width: NotNegative
    clearance: NotNegative = 0.005
    radius_tolerance: NotNegative = 0.003
    palm_width: NotNegative = 0.0
    palm_depth: NotNegative = 0.0
    tool: FrameFile | None = None
    urdf: str | None = None


NamedOrInline = Annotated[
    Annotated[str, Tag("named hand")] | Annotated[HandFile, Tag("inline hand")],
    Discriminator(lambda hand: "named hand" if isinstance(hand, str) else "inline hand"),
]


class MountFile(FrameFile):
    """Where a hand with a URDF of its own is fixed on the robot."""

    prefix: str = ""
    """put before the names of the hand's links and joints, to tell two equal hands apart"""


class ArmFile(_Strict):
    """An arm of a robot that has several; the tool is the hand's own unless given."""

    name: Name
    tool: str | None = None
    hand: NamedOrInline
    mount: MountFile | None = None


class RobotFile(_Strict):
    """A robot: one arm (hand, and tool where the hand has none) or several (arms)."""

    name: Name
    urdf: str
    base: PoseFile = PoseFile()
    tool: str | None = None
    hand: NamedOrInline | None = None
    mount: MountFile | None = None
    arms: Annotated[tuple[ArmFile, ...], Field(min_length=1)] | None = None
    home: tuple[Number, ...] | dict[str, Number] | None = None

    @model_validator(mode="after")
    def _tool_or_arms(self) -> RobotFile:
        single = self.hand is not None
        if single == (self.arms is not None) or (not single and (self.tool or self.mount)):
            raise ValueError("either tool and hand, or arms")
        return self

    def arm_files(self) -> tuple[ArmFile, ...]:
        """Return the arms; a single arm bears the robot's name."""
        if self.arms is not None:
            return self.arms
        assert self.hand is not None
        return (ArmFile(name=self.name, tool=self.tool, hand=self.hand, mount=self.mount),)


class ObjectFile(_Strict):
    """The object of revolution: knots [height, radius] in metres, bottom to top."""

    name: Name
    profile: list[tuple[Number, Number]]


class CylinderFile(_Strict):
    """A cylinder along z, centred."""

    radius: Positive
    height: Positive


class SphereFile(_Strict):
    """A ball."""

    radius: Positive


class ObstacleFile(_Strict):
    """A fixed body: exactly one shape, at a pose. Boxes give full sizes and are centred."""

    name: Name
    box: tuple[Positive, Positive, Positive] | None = None
    cylinder: CylinderFile | None = None
    sphere: SphereFile | None = None
    mesh: str | None = None
    urdf: str | None = None
    pose: PoseFile = PoseFile()

    @model_validator(mode="after")
    def _one_shape(self) -> ObstacleFile:
        if sum(getattr(self, kind) is not None for kind in SHAPES) != 1:
            raise ValueError("exactly one of " + ", ".join(SHAPES))
        return self


SHAPES = ("box", "cylinder", "sphere", "mesh", "urdf")


class TaskFile(_Strict):
    """A pose of the object; its rotation about its own axis is free."""

    name: Name
    arms: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    pose: PoseFile


class MapSettings(_Strict):
    """How finely maps are computed."""

    heights: Annotated[int, Field(ge=1, le=1024)] = 48
    angles: Annotated[int, Field(ge=1, le=1024)] = 96
    redundancy: Annotated[int, Field(ge=1, le=1024)] = 32
    approach: NotNegative = 0.0
    """length (m) of the straight radial retreat that must be free as well"""
    margin: NotNegative = 0.0
    """distance (m) that bodies must keep"""


class SceneFile(_Strict):
    """A scene file, version 1."""

    schema_version: Literal[1]
    name: Name
    description: str = ""
    robots: Annotated[tuple[RobotFile, ...], Field(min_length=1)]
    object: ObjectFile
    obstacles: tuple[ObstacleFile, ...] = ()
    tasks: Annotated[tuple[TaskFile, ...], Field(min_length=1)]
    map: MapSettings = MapSettings()


def scene_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files."""
    return SceneFile.model_json_schema()


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A fixed body.

    Attributes:
        name: its name.
        kind: box, cylinder, sphere, mesh or urdf.
        size: box: full sizes (3,); cylinder: radius, height; sphere: radius; otherwise empty.
        path: the mesh or URDF file, otherwise None.
        T_world_obstacle: its pose (4, 4).
    """

    name: str
    kind: str
    size: tuple[float, ...]
    path: Path | None
    T_world_obstacle: Array


@dataclass(frozen=True, eq=False)
class Task:
    """A pose of the object, and the arms that hold it there.

    Attributes:
        name: its name.
        arms: names of the arms.
        T_world_object: object pose (4, 4); turning it about its own z changes nothing.
    """

    name: str
    arms: tuple[str, ...]
    T_world_object: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """Robots, an object of revolution, obstacles and tasks.

    Attributes:
        source: the file it came from, for messages.
        file: the validated content with every file reference made absolute.
        robots: name → robot.
        arms: name → arm, over all robots.
        profile: the object's r(h).
        obstacles: the fixed bodies.
        tasks: name → task, in order.
    """

    source: str
    file: SceneFile
    robots: Mapping[str, Robot]
    arms: Mapping[str, Arm]
    profile: Profile
    obstacles: tuple[Obstacle, ...]
    tasks: Mapping[str, Task]

    @staticmethod
    def load(scene: str | Path) -> Scene:
        """Load a shipped scene by name, or any scene by path.

        Raises:
            SceneError: no such scene, not YAML, or a field is wrong.
            UrdfError: a robot's URDF is unusable.
            ProfileError: the object's profile is unusable.
        """
        path = Path(scene)
        if path.suffix not in (".yaml", ".yml"):
            shipped = shipped_scenes()
            if str(scene) not in shipped:
                raise SceneError("scene", "name", str(scene), one_of(shipped, scene) + ", or a .yaml file")
            path = shipped[str(scene)]
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SceneError(path, "file", str(path), f"a readable text file ({error})") from error
        return Scene.parse(text, source=str(path), folder=path.parent)

    @staticmethod
    def parse(text: str, source: str = "scene", folder: Path = Path()) -> Scene:
        """Build a scene from YAML text; relative files are sought in ``folder``.

        Raises:
            SceneError, UrdfError, ProfileError: as `load`.
        """
        try:
            content = yaml.safe_load(text)
        except (yaml.YAMLError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise SceneError(source, "file", reason, "a YAML document") from error
        if not isinstance(content, dict):
            raise SceneError(source, "file", content, "a YAML mapping with schema_version, name, robots, …")
        return Scene.from_content(content, source, folder)

    @staticmethod
    def from_content(content: Mapping[str, Any], source: str = "scene", folder: Path = Path()) -> Scene:
        """Build a scene from the content of a file.

        Raises:
            SceneError, UrdfError, ProfileError: as `load`.
        """
        try:
            file = SceneFile.model_validate(content)
        except ValidationError as error:
            raise SceneError(source, *describe(error, content)) from None
        return _Builder(file, source, folder).scene()

    @cached_property
    def content(self) -> dict[str, Any]:
        """The full content as plain data, enough to build the same scene again."""
        return self.file.model_dump(mode="json", exclude_none=True)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the content as canonical JSON."""
        return hashlib.sha256(json.dumps(self.content, sort_keys=True).encode()).hexdigest()

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.file.name

    @property
    def settings(self) -> MapSettings:
        """How finely maps are computed."""
        return self.file.map

    @cached_property
    def manifold(self) -> Manifold:
        """The grid over the object's surface."""
        return Manifold(self.profile, self.settings.heights, self.settings.angles)

    def arm(self, name: str | None = None) -> Arm:
        """Return an arm by name, or the first.

        Raises:
            SceneError: there is no such arm.
        """
        if name is None:
            return next(iter(self.arms.values()))
        if name not in self.arms:
            raise SceneError(self.source, "arm", name, one_of(self.arms, name))
        return self.arms[name]

    def task(self, name: str | None = None) -> Task:
        """Return a task by name, or the first.

        Raises:
            SceneError: there is no such task.
        """
        if name is None:
            return next(iter(self.tasks.values()))
        if name not in self.tasks:
            raise SceneError(self.source, "task", name, one_of(self.tasks, name))
        return self.tasks[name]

    def with_task(self, task: Task) -> Scene:
        """Return the scene with the task of that name replaced; robots and object are shared."""
        self.task(task.name)
        file = TaskFile(name=task.name, arms=task.arms, pose=PoseFile.of(task.T_world_object))
        files = tuple(file if t.name == task.name else t for t in self.file.tasks)
        return replace(
            self,
            file=self.file.model_copy(update={"tasks": files}),
            tasks={**self.tasks, task.name: task},
        )

    def with_settings(self, **changes: float) -> Scene:
        """Return the scene with other map settings; robots and object are shared.

        Raises:
            SceneError: a setting is unknown or out of range.
        """
        try:
            settings = MapSettings.model_validate({**self.settings.model_dump(), **changes})
        except ValidationError as error:
            raise SceneError("map settings", *describe(error, changes)) from None
        return replace(self, file=self.file.model_copy(update={"map": settings}))


def shipped_scenes() -> dict[str, Path]:
    """Return the scenes that come with the package: name → file, in order."""
    return {path.stem: path for path in sorted(SCENES_DIR.glob("*.yaml"))}


def describe(error: ValidationError, content: Any) -> tuple[str, object, str]:
    """Turn the first problem of a validation into field, value and what was expected."""
    first = error.errors(include_url=False)[0]
    # Union members add their class name to the location; a path into the content has none.
    path: list[str | int] = []
    at = content
    for step in first["loc"]:
        try:
            at = at[step]
        except (KeyError, IndexError, TypeError):
            if not (first["type"] == "missing" and step == first["loc"][-1]):
                continue
        path.append(step)
    field = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")
    if first["type"] == "extra_forbidden":
        return field, first["input"], "a key of the file format; check its spelling"
    if first["type"] == "missing":
        return field, None, "a value; this key is required"
    expected = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return field or "file", first["input"], expected


class _Builder:
    """Resolves the names and files of a scene file."""

    def __init__(self, file: SceneFile, source: str, folder: Path) -> None:
        self.file, self.source, self.folder = file, source, folder
        self._models: dict[tuple[Path, tuple[Mount, ...]], RobotModel] = {}

    def scene(self) -> Scene:
        file = self._absolute()
        self.file = file
        self._unique("robots", (r.name for r in file.robots))
        self._unique("obstacles", (o.name for o in file.obstacles))
        self._unique("tasks", (t.name for t in file.tasks))
        bodies = [r.name for r in file.robots] + [o.name for o in file.obstacles] + [file.object.name]
        self._unique("robots, obstacles and object", bodies)
        robots: dict[str, Robot] = {}
        arms: dict[str, Arm] = {}
        for i, entry in enumerate(file.robots):
            robot, own = self._robot(i, entry)
            robots[robot.name] = robot
            self._unique("arms", [*arms, *(arm.name for arm in own)])
            arms |= {arm.name: arm for arm in own}
        return Scene(
            self.source,
            file,
            robots,
            arms,
            Profile(file.object.profile, self.source + ": object"),
            tuple(self._obstacle(i, o) for i, o in enumerate(file.obstacles)),
            {t.name: self._task(i, t, arms) for i, t in enumerate(file.tasks)},
        )

    def _unique(self, field: str, names: Iterable[str]) -> None:
        seen: set[str] = set()
        for name in names:
            if name in seen:
                raise SceneError(self.source, f"{field}: name", name, "a name that is not used twice")
            seen.add(name)

    def _absolute(self) -> SceneFile:
        """Check every file reference; make the relative ones absolute so the content can travel."""
        robots = tuple(self._absolute_robot(f"robots[{i}]", r) for i, r in enumerate(self.file.robots))
        obstacles = []
        for i, o in enumerate(self.file.obstacles):
            kind = "mesh" if o.mesh is not None else "urdf"
            reference = getattr(o, kind)
            if reference is not None:
                reference = self._reference(f"obstacles[{i}].{kind}", reference, kind)
                o = o.model_copy(update={kind: reference})
            obstacles.append(o)
        return self.file.model_copy(update={"robots": robots, "obstacles": tuple(obstacles)})

    def _absolute_robot(self, field: str, robot: RobotFile) -> RobotFile:
        update: dict[str, Any] = {"urdf": self._reference(f"{field}.urdf", robot.urdf, "URDF")}
        if robot.hand is not None:
            update["hand"] = self._absolute_hand(f"{field}.hand", robot.hand)
        if robot.arms is not None:
            hands = [self._absolute_hand(f"{field}.arms[{k}].hand", a.hand) for k, a in enumerate(robot.arms)]
            arms = zip(robot.arms, hands, strict=True)
            update["arms"] = tuple(a.model_copy(update={"hand": hand}) for a, hand in arms)
        return robot.model_copy(update=update)

    def _absolute_hand(self, field: str, hand: str | HandFile) -> str | HandFile:
        if isinstance(hand, str) or hand.urdf is None:
            return hand
        return hand.model_copy(update={"urdf": self._reference(f"{field}.urdf", hand.urdf, "URDF")})

    def _reference(self, field: str, reference: str, kind: str) -> str:
        path = resolve(reference, self.folder)
        if path is None:
            expected = "package://<python package>/<path>, or a path relative to the scene"
            raise SceneError(self.source, field, reference, f"an existing {kind} file: {expected}")
        return reference if reference.startswith("package://") else str(path.resolve())

    def _path(self, reference: str) -> Path:
        path = resolve(reference, self.folder)
        assert path is not None  # _absolute has checked it
        return path

    def _robot(self, i: int, entry: RobotFile) -> tuple[Robot, list[Arm]]:
        field = f"robots[{i}]"
        fields = [field] if entry.arms is None else [f"{field}.arms[{k}]" for k in range(len(entry.arms))]
        files = entry.arm_files()
        hands = [self._hand(f, a) for f, a in zip(fields, files, strict=True)]
        mounts, tools = [], []
        for f, a, hand in zip(fields, files, hands, strict=True):
            mounts += self._mount(f, a, hand, entry)
            tools.append(self._tool(f, a, hand))
            if a.tool is None and hand.tool is not None and not hand.tool.is_link:
                mounts.append(Mount(hand.tool, None, tools[-1]))
        model = self._model(self._path(entry.urdf), tuple(mounts))
        chains = [self._chain(f, tool, model) for f, tool in zip(fields, tools, strict=True)]
        shared = frozenset(n for k, c in enumerate(chains) for n in c for o in chains[:k] if n in o)
        home = self._home(i, entry, model, chains, shared, hands)
        robot = Robot(entry.name, model, entry.base.matrix(), home)
        parts = zip(files, tools, hands, strict=True)
        return robot, [Arm(a.name, robot, tool, hand, shared) for a, tool, hand in parts]

    def _model(self, path: Path, mounts: tuple[Mount, ...]) -> RobotModel:
        if (path, mounts) not in self._models:
            self._models[path, mounts] = RobotModel(path, mounts)
        return self._models[path, mounts]

    def _mount(self, field: str, arm: ArmFile, hand: Hand, robot: RobotFile) -> list[Mount]:
        """Return what puts the arm's hand on the robot: nothing where the robot comes with it."""
        if arm.mount is None:
            return []
        if hand.urdf is None:
            raise SceneError(self.source, f"{field}.mount", hand.name, "a hand with a urdf of its own")
        bare = self._model(self._path(robot.urdf), ())
        if arm.mount.link not in bare.link_names:
            expected = f"a link of {bare.path.name}: " + one_of(bare.link_names, arm.mount.link)
            raise SceneError(self.source, f"{field}.mount.link", arm.mount.link, expected)
        return [Mount(arm.mount.frame(), self._path(hand.urdf), arm.mount.prefix)]

    def _tool(self, field: str, arm: ArmFile, hand: Hand) -> str:
        """Return the name of the link that is the arm's tool frame."""
        if arm.tool is not None:
            return arm.tool
        if hand.tool is None:
            raise SceneError(
                self.source, f"{field}.tool", None, f"a link; hand {hand.name} names none itself"
            )
        return hand.tool.link if hand.tool.is_link else f"{arm.name}_tool"

    def _chain(self, field: str, tool: str, model: RobotModel) -> list[str]:
        if tool not in model.link_names:
            expected = f"a link of {model.path.name}: " + one_of(model.link_names, tool)
            raise SceneError(self.source, f"{field}.tool", tool, expected)
        return [j.name for j in model.chain(tool) if j.source >= 0 and j.kind != "prismatic"]

    def _hand(self, field: str, arm: ArmFile) -> Hand:
        if isinstance(arm.hand, str):
            if arm.hand not in HANDS:
                raise SceneError(self.source, f"{field}.hand", arm.hand, one_of(HANDS, arm.hand))
            hand = HANDS[arm.hand]
        else:
            tool = arm.hand.tool
            fields = {**dict(arm.hand), "tool": tool and tool.frame()}
            try:
                hand = Hand(**fields)
            except InputError as error:
                where = f"{field}.hand.{error.field}"
                raise SceneError(self.source, where, error.value, error.expected) from None
        return hand.prefixed(arm.mount.prefix) if arm.mount else hand

    def _home(
        self,
        i: int,
        entry: RobotFile,
        model: RobotModel,
        chains: list[list[str]],
        shared: frozenset[str],
        hands: list[Hand],
    ) -> Array:
        field = f"robots[{i}].home"
        values = model.default_values()
        for hand in hands:  # parked hands stand open, unless the scene says otherwise
            for name, value in hand.joint_values(hand.max_opening).items():
                if name in model.joint_names:
                    values[model.joint_names.index(name)] = value
        order = [n for chain in chains for n in chain if n not in shared]
        given: Mapping[str, float]
        if entry.home is None:
            given = {}
        elif isinstance(entry.home, dict):
            given = entry.home
        elif len(entry.home) != len(order):
            raise SceneError(
                self.source, field, list(entry.home), f"{len(order)} values, for " + ", ".join(order)
            )
        else:
            given = dict(zip(order, entry.home, strict=True))
        for name, value in given.items():
            if name not in model.joint_names:
                raise SceneError(self.source, field, name, one_of(model.joint_names, name))
            k = model.joint_names.index(name)
            if not model.lower[k] <= value <= model.upper[k]:
                limits = f"{name} within [{model.lower[k]:g}, {model.upper[k]:g}]"
                raise SceneError(self.source, field, value, limits)
            values[k] = value
        values.setflags(write=False)
        return values

    def _obstacle(self, i: int, o: ObstacleFile) -> Obstacle:
        kind = next(k for k in SHAPES if getattr(o, k) is not None)
        size: tuple[float, ...] = ()
        path = None
        if o.box is not None:
            size = o.box
        elif o.cylinder is not None:
            size = (o.cylinder.radius, o.cylinder.height)
        elif o.sphere is not None:
            size = (o.sphere.radius,)
        else:
            path = self._path(o.mesh or o.urdf or "")
        return Obstacle(o.name, kind, size, path, o.pose.matrix())

    def _task(self, i: int, t: TaskFile, arms: Mapping[str, Arm]) -> Task:
        names = t.arms or (next(iter(arms)),)
        for name in names:
            if name not in arms:
                raise SceneError(self.source, f"tasks[{i}].arms", name, one_of(arms, name))
        self._unique(f"tasks[{i}].arms", names)
        return Task(t.name, names, t.pose.matrix())
