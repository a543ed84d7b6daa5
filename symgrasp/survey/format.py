"""The YAML format of surveys. The classes mirror the file and produce its JSON Schema."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, StrictBool, Tag, model_validator

from symgrasp.errors import as_written
from symgrasp.scene.format import WHOLE, HandFile, MapSettings, ObjectFile

__all__ = [
    "BASE", "MOST_VALUES", "POSITION", "AxisFile", "HandAxis", "KeepOut", "NumberAxis", "ObjectAxis",
    "PlanKind", "PositionAxis", "SurveyFile", "TaskAxis", "survey_schema",
]  # fmt: skip

LARGEST = 1e4
"""Largest absolute value of a number on an axis (m, degrees or what the scene's number is in)."""

MOST_AXES, MOST_VALUES, MOST_POINTS = 8, 10_000, 10_000_000
"""Most axes of a survey, values of an axis, and points of a survey."""

POSITION = ("position.x", "position.y", "position.z")
"""Axes that move the object: x, y, z (m) of the pose of the point's task."""

LEAN = ("tilt_deg", "direction_deg")
"""Axes that lean the object: how far its axis is from the vertical, and towards which side."""

BASE = ("base.x", "base.y", "base.z", "base.yaw_deg")
"""Axes that move a robot: x, y, z (m) of its base, and its turn about the vertical."""

TURNS = ("direction_deg", "base.yaw_deg")
"""Axes whose values mean the same when they differ by whole turns."""

RESERVED = {
    "angle", "best", "byte", "cell", "cells", "feasible", "letter", "margin", "plan", "plan_margin",
    "problem", "reason", "roll", "row", "share", "state",
}  # fmt: skip
"""Names of what a store holds besides the axes."""

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=100)]
Interval = tuple[Number, Number]
PlanKind = Literal["sequential", "bimanual", "handover"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class _Axis(_Strict):
    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,49}$")]
    """the dimension of the store"""

    @model_validator(mode="after")
    def _free_name(self) -> _Axis:
        if self.name in RESERVED:
            raise ValueError("a name of an axis that no result has, unlike " + ", ".join(sorted(RESERVED)))
        return self


class NumberAxis(_Axis):
    """Numbers: listed, or ``count`` of them at equal steps from ``from`` to ``to``.

    ``of`` says what they are: position.x, .y, .z (m) of the object in the task; tilt_deg and direction_deg,
    how far the object's axis leans from the vertical and towards which side, seen from above and counted from
    x to y; base.x, .y, .z (m) and base.yaw_deg of a robot; or the path of any other number of the scene file,
    in which entries of lists go by their names or their numbers, from 0 on:
    ``obstacles.table.pose.position.2``. The object's rotation about its own axis is no axis of a survey: it
    only shifts maps.
    """

    of: Annotated[str, Field(pattern=r"^[^.]+(\.[^.]+)*$", max_length=300)]
    robot: Name | None = None
    """the robot whose base it is; the first unless given"""
    values: Annotated[tuple[Number, ...], Field(min_length=1, max_length=MOST_VALUES)] | None = None
    from_: Annotated[Number | None, Field(alias="from")] = None
    to: Number | None = None
    count: Annotated[int, WHOLE, Field(ge=2, le=MOST_VALUES)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> NumberAxis:
        grid = (self.from_, self.to, self.count)
        if (self.values is None) == (None in grid) or (self.values is not None and grid != (None,) * 3):
            raise ValueError("either values, or all of from, to and count")
        numbers = self.numbers()
        # What turns by whole turns more is the same pose.
        distinct = {v % 360.0 for v in numbers} if self.of in TURNS else set(numbers)
        if len(distinct) < len(numbers):
            raise ValueError("values that differ")
        if self.robot is not None and self.of not in BASE:
            raise ValueError(f"a robot only with {', '.join(BASE)}")
        if self.of == "tilt_deg" and not all(0 <= v <= 180 for v in numbers):
            raise ValueError("tilts from 0 to 180")
        head, *rest = self.of.split(".")
        if head == "tasks" and ("rpy_deg" in rest or "quat_wxyz" in rest):
            raise ValueError("tilt_deg and direction_deg; a rotation about the object's axis is a shift")
        if head == "map" and rest and rest[0] in ("heights", "angles"):
            raise ValueError("one grid for all points; the survey's map says which")
        return self

    def numbers(self) -> tuple[float, ...]:
        """Return the values."""
        if self.values is not None:
            return self.values
        assert self.from_ is not None and self.to is not None and self.count is not None
        return tuple(np.linspace(self.from_, self.to, self.count).tolist())


class PositionAxis(_Axis):
    """Listed positions (m) of the object in the task."""

    of: Literal["position"]
    values: Annotated[tuple[tuple[Number, Number, Number], ...], Field(min_length=1, max_length=MOST_VALUES)]

    @model_validator(mode="after")
    def _all_differ(self) -> PositionAxis:
        if len(set(self.values)) < len(self.values):
            raise ValueError("values that differ")
        return self


class TaskAxis(_Axis):
    """Tasks of the scene, by name."""

    of: Literal["task"]
    values: Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_VALUES)]


class ObjectAxis(_Axis):
    """Objects: names of the library, or what scene files have of an object."""

    of: Literal["object"]
    values: Annotated[tuple[Name | ObjectFile, ...], Field(min_length=1, max_length=MOST_VALUES)]


class HandAxis(_Axis):
    """Hands of an arm: named ones, or described inline as in scene files."""

    of: Literal["hand"]
    arm: Name | None = None
    """the arm; that of the survey unless given"""
    values: Annotated[tuple[Name | HandFile, ...], Field(min_length=1, max_length=MOST_VALUES)]


def _kind(axis: Any) -> str:
    of = axis.get("of") if isinstance(axis, dict) else getattr(axis, "of", None)
    return of if of in ("position", "task", "object", "hand") else "number"


AxisFile: TypeAlias = Annotated[
    Annotated[NumberAxis, Tag("number")]
    | Annotated[PositionAxis, Tag("position")]
    | Annotated[TaskAxis, Tag("task")]
    | Annotated[ObjectAxis, Tag("object")]
    | Annotated[HandAxis, Tag("hand")],
    Discriminator(_kind),
]


class KeepOut(_Strict):
    """A rectangle on the ground (m) in which no base stands that an axis moves."""

    x: Interval
    y: Interval

    @model_validator(mode="after")
    def _in_order(self) -> KeepOut:
        if not all(low < high for low, high in (self.x, self.y)):
            raise ValueError("x: [low, high] and y: [low, high]")
        return self


class SurveyFile(_Strict):
    """A survey file, version 1: a scene, and the axes along which it is varied.

    A point has a map, of one task and one arm: ``task`` and ``arm``, the scene's first task and the task's
    first arm unless given. ``plan`` asks whether a plan of that kind exists as well. ``map`` takes the place
    of the scene's own. ``maps: true`` keeps which cells of every map are feasible, a bit a cell.
    """

    schema_version: Annotated[Literal[1], WHOLE]
    name: Name
    description: str = ""
    scene: Name
    """name of a shipped scene, or a file, relative to the survey's"""
    task: Name | None = None
    arm: Name | None = None
    plan: PlanKind | None = None
    map: MapSettings | None = None
    maps: StrictBool = False
    keep_out: Annotated[tuple[KeepOut, ...], Field(max_length=1000)] = ()
    axes: Annotated[tuple[AxisFile, ...], Field(min_length=1, max_length=MOST_AXES, fail_fast=True)]

    @model_validator(mode="after")
    def _axes_that_go_together(self) -> SurveyFile:
        names = [axis.name for axis in self.axes]
        if len(set(names)) < len(names):
            raise ValueError(f"axes: names that differ, not {as_written(names)}")
        kinds = [axis.of for axis in self.axes]
        if "direction_deg" in kinds and "tilt_deg" not in kinds:
            raise ValueError("axes: tilt_deg along with direction_deg")
        if "task" in kinds and self.task is not None:
            raise ValueError("either task, or an axis of tasks")
        if self.keep_out and not any(of in BASE for of in kinds):
            raise ValueError("keep_out only where an axis moves a base")
        if self.points > MOST_POINTS:
            raise ValueError(f"axes: at most {MOST_POINTS:,} points, not {self.points:,}")
        return self

    @property
    def points(self) -> int:
        """How many points the survey has."""
        return math.prod(lengths(self))


def lengths(file: SurveyFile) -> tuple[int, ...]:
    """Return the number of values of each axis."""
    return tuple(len(a.numbers() if isinstance(a, NumberAxis) else a.values) for a in file.axes)


def survey_schema() -> dict[str, Any]:
    """Return the JSON Schema of survey files."""
    return SurveyFile.model_json_schema()
