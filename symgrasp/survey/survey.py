"""A survey: a scene, its axes with all names and files resolved, and the batches that its points come in."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from symgrasp.errors import InputError, SceneError, SurveyError, SymgraspError, one_of
from symgrasp.files import LARGEST_YAML, parse_yaml, read_file
from symgrasp.planners.planning import tasks_of_plan
from symgrasp.poses import rotation_z
from symgrasp.scene.field_errors import describe_error
from symgrasp.scene.format import PoseFile, SceneFile
from symgrasp.scene.scene import Scene
from symgrasp.survey.format import (
    BASE,
    LEAN,
    POSITION,
    AxisFile,
    HandAxis,
    NumberAxis,
    ObjectAxis,
    PositionAxis,
    SurveyFile,
    TaskAxis,
    lengths,
)
from symgrasp.survey.paths import keys_of, with_number
from symgrasp.survey.shipped import shipped_surveys

__all__ = ["Axis", "Survey"]

BATCH = 64
"""Most points of a batch. It decides how the store is cut, so it depends on nothing but the survey."""

FEWEST_BATCHES = 32
"""So many batches at least, where there are as many points, for workers to share."""


@dataclass(frozen=True)
class Axis:
    """An axis of a survey.

    Attributes:
        name: the dimension of the store.
        file: the axis as the survey file has it.
        values: n values: numbers, positions (m), names of tasks, or entries of scene files.
        labels: n coordinates of the store: the numbers, or texts.
        notes: which objects or hands are the same under two names, as those of a catalogue may be, in words.
    """

    name: str
    file: AxisFile
    values: tuple[Any, ...]
    labels: tuple[float, ...] | tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def moves_object(self) -> bool:
        """Whether points along the axis differ in the pose of the object or the task alone."""
        return isinstance(self.file, PositionAxis | TaskAxis) or self.file.of in (*POSITION, *LEAN)

    @property
    def unit(self) -> str:
        """The unit of its numbers; empty where there is none, or the scene file says."""
        if self.file.of.endswith("_deg"):
            return "°"
        return "m" if self.file.of in (*POSITION, *BASE) else ""


@dataclass(frozen=True, eq=False)
class Survey:
    """A survey with everything resolved.

    Attributes:
        source: the file it came from, for error messages.
        file: the validated content of the file.
        scene: the scene as its file has it, with the survey's map settings.
        axes: the axes.
    """

    source: str
    file: SurveyFile
    scene: Scene
    axes: tuple[Axis, ...]

    @staticmethod
    def load(survey: str | Path) -> Survey:
        """Load a shipped survey by name, or any by path.

        Raises:
            SurveyError: there is no such survey, it is not YAML, or a field is wrong.
            SymgraspError: its scene, or a file that it refers to, is unusable.
        """
        path = Path(survey)
        if path.suffix not in (".yaml", ".yml"):
            shipped = shipped_surveys()
            if str(survey) not in shipped:
                expected = one_of(shipped, survey) + ", or a .yaml file"
                raise SurveyError("survey", "name", str(survey), expected)
            path = shipped[str(survey)]
        try:
            content = parse_yaml(read_file(path, LARGEST_YAML).decode("utf-8"))
        except OSError as error:
            raise SurveyError(path, "file", str(path), f"a readable text file ({error})") from error
        except ValueError as error:
            raise SurveyError(path, "file", str(error), "a YAML document") from error
        if not isinstance(content, dict):
            raise SurveyError(path, "file", content, "a YAML mapping with schema_version, name, scene, axes")
        try:
            file = SurveyFile.model_validate(content)
        except ValidationError as error:
            raise SurveyError(path, *describe_error(error, content)) from None
        of = Path(file.scene)
        scene = Scene.load(path.parent / of if of.suffix in (".yaml", ".yml") else file.scene)
        return Survey.of(file, scene, str(path), path.parent)

    @staticmethod
    def of(file: SurveyFile, scene: Scene, source: str = "survey", folder: Path = Path()) -> Survey:
        """Resolve a survey of a scene.

        Args:
            file: the survey; its ``scene`` is only a name here.
            scene: the scene.
            source: its name for error messages.
            folder: the folder that file references are relative to.

        Raises:
            SurveyError: a name is unknown, or a value cannot be put into the scene.
        """
        if file.map is not None:
            scene = scene.with_settings(**file.map.model_dump())
        if file.task is not None and file.task not in scene.tasks:
            raise SurveyError(source, "task", file.task, one_of(scene.tasks, file.task))
        if file.arm is not None and file.arm not in scene.arms:
            raise SurveyError(source, "arm", file.arm, one_of(scene.arms, file.arm))
        if file.plan is not None:
            tasks_of_plan(scene, file.plan, file.arm, file.task)
        axes = [
            _resolved(f"axes[{i}]", axis, file, scene, source, folder) for i, axis in enumerate(file.axes)
        ]
        for (i, one), (j, other) in combinations(enumerate(file.axes), 2):
            if _overlap(scene, file, one, other):
                expected = f"what no other axis varies, such as axes[{i}] ({one.name})"
                raise SurveyError(source, f"axes[{j}].of ({other.name})", other.of, expected)
        return Survey(source, file, scene, tuple(axes))

    def to_dict(self) -> dict[str, Any]:
        """Return the survey as plain data, from which `from_dict` makes the same one anywhere."""
        axes = [
            {"file": a.file.model_dump(mode="json", by_alias=True, exclude_none=True), "values": a.values}
            for a in self.axes
        ]
        file = self.file.model_dump(mode="json", by_alias=True, exclude_none=True)
        plain = {"source": self.source, "file": file, "scene": self.scene.content, "axes": axes}
        return json.loads(json.dumps(plain))

    @staticmethod
    def from_dict(plain: Mapping[str, Any]) -> Survey:
        """Make a survey of what `to_dict` returned."""
        file = SurveyFile.model_validate(plain["file"])
        axes = tuple(
            Axis(
                own.name,
                own,
                tuple(tuple(v) if isinstance(own, PositionAxis) else v for v in entry["values"]),
                tuple(_label(own, value) for value in _values(own)),
            )
            for own, entry in zip(file.axes, plain["axes"], strict=True)
        )
        return Survey(plain["source"], file, Scene.from_content(plain["scene"], plain["source"]), axes)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of all that the results depend on: axes, scene, files of robots and hands, this version."""
        plain = {k: v for k, v in self.to_dict().items() if k != "source"}
        first = [0] * len(self.axes)
        hands = [
            self.scene_at((*first[:k], i, *first[k + 1 :])).map_sha256
            for k, axis in enumerate(self.axes)
            if isinstance(axis.file, HandAxis)
            for i in range(len(axis.values))
        ]
        plain |= {"maps": [self.scene.map_sha256, *hands], "version": version("symgrasp")}
        return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person may not have meant, in words; see `Axis`."""
        return tuple(note for axis in self.axes for note in axis.notes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return lengths(self.file)

    @property
    def points(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    @cached_property
    def batch_shape(self) -> tuple[int, ...]:
        """Number of points of a batch along each axis; the last batch along an axis may have fewer.

        Along axes that move nothing but the object first: what a point needs besides a map is built once.
        """
        most = max(1, min(BATCH, self.points // FEWEST_BATCHES))
        shape = [1] * len(self.axes)
        order = sorted(range(len(self.axes)), key=lambda k: (not self.axes[k].moves_object, -k))
        for k in order:
            shape[k] = -(-self.shape[k] // -(-self.shape[k] // most))  # of equal size, as far as can be
            most //= shape[k]
        return tuple(shape)

    @property
    def batches(self) -> int:
        """Number of batches."""
        return math.prod(self.batch_grid)

    @property
    def batch_grid(self) -> tuple[int, ...]:
        """Number of batches along each axis."""
        return tuple(-(-n // b) for n, b in zip(self.shape, self.batch_shape, strict=True))

    def region(self, batch: int) -> tuple[slice, ...]:
        """Return the indices of a batch's points along each axis."""
        where = np.unravel_index(batch, self.batch_grid)
        return tuple(
            slice(int(k) * b, min((int(k) + 1) * b, n))
            for k, b, n in zip(where, self.batch_shape, self.shape, strict=True)
        )

    def points_of(self, batch: int) -> Iterator[tuple[int, ...]]:
        """Yield the points of a batch as indices along each axis; those of one scene follow each other."""
        region = self.region(batch)
        order = sorted(range(len(self.axes)), key=lambda k: self.axes[k].moves_object)
        sizes = [region[k].stop - region[k].start for k in order]
        for where in np.ndindex(*sizes):
            point = [0] * len(self.axes)
            for k, at in zip(order, where, strict=True):
                point[k] = region[k].start + at
            yield tuple(point)

    def scene_key(self, point: tuple[int, ...]) -> tuple[int, ...]:
        """Return the part of a point (indices along each axis) on which its scene depends."""
        return tuple(k for k, axis in zip(point, self.axes, strict=True) if not axis.moves_object)

    def scene_at(self, point: tuple[int, ...]) -> Scene:
        """Return the scene of a point, with the object where the scene has it; see `task_at`.

        Raises:
            SymgraspError: the values of several axes do not go together.
        """
        content = self.scene.content
        for axis, k in zip(self.axes, point, strict=True):
            changed = _changed(content, self.file, self.scene, axis.file, axis.values[k])
            content = content if changed is None else changed
        return self.scene if content is self.scene.content else Scene.from_content(content, self.source)


def _resolved(field: str, axis: AxisFile, file: SurveyFile, scene: Scene, source: str, folder: Path) -> Axis:
    """Return an axis whose values are known to go into the scene, with what they refer to found and measured.

    Raises:
        SurveyError: a value cannot be put into the scene.
    """
    values, first, notes = list(_values(axis)), dict[Any, str](), list[str]()
    labels = tuple(_label(axis, value) for value in values)
    if len(set(labels)) < len(labels):
        raise SurveyError(source, field, list(labels), "values that differ")
    for k, value in enumerate(values):
        changed = None
        try:
            changed = _changed(scene.content, file, scene, axis, value)
            if isinstance(axis, NumberAxis) and changed is not None:
                SceneFile.model_validate(changed)
            elif isinstance(axis, ObjectAxis | HandAxis):
                built = Scene.from_content(changed or {}, source, folder)
                if isinstance(axis, ObjectAxis):
                    values[k] = built.content["object"]
                    what = built.profile.points.tobytes(), built.object_mass
                else:
                    arm = built.arm(_arm_of(axis, file, scene))
                    values[k] = _arm_entry(built.content, arm.name)["hand"]
                    own = replace(arm.hand, name="", tool=None)  # the arm and its robot say where that is
                    what = repr(own), arm.tool, arm.robot.model.sha256
                same = first.setdefault(what, labels[k])
                if same != labels[k]:
                    notes.append(f"{field} ({axis.name}): {labels[k]} is the same as {same}")
        except ValidationError as error:
            expected = describe_error(error, changed)[-1]
            raise SurveyError(source, f"{field} ({axis.name})", labels[k], expected) from None
        except SceneError as error:  # of a scene that was made of the value
            where, key = f"{field}.values[{k}]", error.field.split(".")[-1]
            where = where if isinstance(value, str) else f"{where}.{key}"
            raise SurveyError(source, where, error.value, error.expected) from None
        except SymgraspError as error:
            text = str(error)
            if isinstance(error, InputError) and error.source.startswith(source):
                text = error.without_source
            raise SurveyError(source, f"{field} ({axis.name})", labels[k], text) from None
        except ValueError as error:
            raise SurveyError(source, f"{field}.of", axis.of, str(error)) from None
    return Axis(axis.name, axis, tuple(values), labels, tuple(notes))


def _arm_of(axis: HandAxis, file: SurveyFile, scene: Scene) -> str:
    """Return the arm whose hands an axis lists."""
    return axis.arm or file.arm or next(iter(scene.arms))


def _values(axis: AxisFile) -> tuple[Any, ...]:
    return axis.numbers() if isinstance(axis, NumberAxis) else axis.values


def _label(axis: AxisFile, value: Any) -> Any:
    """Return the coordinate of a value: the number itself, or a text."""
    if isinstance(axis, NumberAxis | TaskAxis) or isinstance(value, str):
        return value
    if isinstance(axis, PositionAxis):
        return " ".join(f"{v:g}" for v in value)
    return value["name"] if isinstance(value, Mapping) else value.name


def _changed(
    content: dict[str, Any], file: SurveyFile, scene: Scene, axis: AxisFile, value: Any
) -> dict[str, Any] | None:
    """Return the content of a scene with a value of an axis in it; None where it only moves the object.

    Raises:
        ValueError: the axis names something that the scene does not have; says what is expected.
    """
    if isinstance(axis, TaskAxis):
        if value not in scene.tasks:
            raise ValueError(one_of(scene.tasks, value))
        return None
    if isinstance(axis, PositionAxis) or axis.of in (*POSITION, *LEAN):
        return None
    if isinstance(axis, ObjectAxis):
        if isinstance(value, str):
            value = {"name": value, "library": value}
        elif not isinstance(value, dict):
            value = value.model_dump(mode="json", exclude_none=True)
        return {**content, "object": value}
    if isinstance(axis, HandAxis):
        name = _arm_of(axis, file, scene)
        if name not in scene.arms:
            raise ValueError("an arm: " + one_of(scene.arms, name))
        if not isinstance(value, str | dict):
            value = value.model_dump(mode="json", exclude_none=True)
        changed = json.loads(json.dumps(content))
        _arm_entry(changed, name)["hand"] = value
        return changed
    if axis.of in BASE:
        name = axis.robot or next(iter(scene.robots))
        if name not in scene.robots:
            raise ValueError("a robot: " + one_of(scene.robots, name))
        return _moved_base(content, name, axis.of, value)
    return with_number(content, axis.of, value)


def _overlap(scene: Scene, file: SurveyFile, one: AxisFile, other: AxisFile) -> bool:
    """Return whether two axes vary the same number, or one varies a part of what the other does."""
    return any(
        a[: len(b)] == b[: len(a)] for a in _varied(scene, file, one) for b in _varied(scene, file, other)
    )


def _varied(scene: Scene, file: SurveyFile, axis: AxisFile) -> Iterator[tuple[str | int, ...]]:
    """Yield the keys of what an axis varies in the content of a scene; what begins alike is a part of it."""
    content = scene.content
    robots = {entry["name"]: k for k, entry in enumerate(content["robots"])}
    if isinstance(axis, HandAxis):
        arm = _arm_of(axis, file, scene)
        index = robots[scene.arms[arm].robot.name]
        arms = [entry["name"] for entry in content["robots"][index].get("arms", ())]
        yield ("robots", index, *(("arms", arms.index(arm)) if arms else ()), "hand")
    elif isinstance(axis, ObjectAxis):
        yield ("object",)
    elif isinstance(axis, TaskAxis):
        yield ("task",)  # a choice of what is there
    elif isinstance(axis, PositionAxis) or axis.of in (*POSITION, *LEAN):
        step: tuple[str | int, ...] = ("lean", axis.of)
        if axis.of not in LEAN:
            step = ("position", *(() if axis.of == "position" else ("xyz".index(axis.of[-1]),)))
        names = [file.task or next(iter(scene.tasks))]
        for own in file.axes:
            if isinstance(own, TaskAxis):
                names = list(own.values)
        for k, entry in enumerate(content["tasks"]):
            if entry["name"] in names:
                yield ("tasks", k, "pose", *step)
    elif axis.of in BASE:
        base = ("robots", robots[axis.robot or next(iter(robots))], "base")
        if axis.of == "base.yaw_deg":
            yield from ((*base, name) for name in ("rpy_deg", "quat_wxyz"))
        else:
            yield (*base, "position", "xyz".index(axis.of[-1]))
    else:
        yield keys_of(content, axis.of)


def _arm_entry(content: Mapping[str, Any], arm: str) -> dict[str, Any]:
    """Return the entry of an arm in the content of a scene."""
    entries = [entry for robot in content["robots"] for entry in robot.get("arms", [robot])]
    return next(entry for entry in entries if entry["name"] == arm)


def _moved_base(content: dict[str, Any], robot: str, of: str, value: float) -> dict[str, Any]:
    """Return the content of a scene with a coordinate (m or °) of a robot's base changed."""
    index = next(k for k, entry in enumerate(content["robots"]) if entry["name"] == robot)
    entry = content["robots"][index]
    T = PoseFile.model_validate(entry["base"]).matrix()
    if of == "base.yaw_deg":
        turn = rotation_z(math.radians(value) - math.atan2(T[1, 0], T[0, 0]))
        T[:3, :3] = turn[:3, :3] @ T[:3, :3]
    else:
        T["xyz".index(of[-1]), 3] = value
    base = PoseFile.of(T).model_dump(mode="json", exclude_none=True)
    robots = list(content["robots"])
    robots[index] = {**entry, "base": base}
    return {**content, "robots": robots}
