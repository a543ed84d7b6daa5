"""The YAML format of scenes. The classes mirror the file and produce its JSON Schema."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    Tag,
    model_validator,
)

from symgrasp.errors import as_written
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.object.profile import MOST_KNOTS
from symgrasp.poses import Array, from_position_quat, from_position_rpy, quat_wxyz
from symgrasp.robot.assembly import Frame

__all__ = [
    "SHAPES",
    "WHOLE",
    "ArmFile",
    "HandFile",
    "MapSettings",
    "ObstacleFile",
    "PoseFile",
    "RobotFile",
    "SceneFile",
    "TaskFile",
    "scene_schema",
    "xacro_texts",
]

LARGEST = 1e4
"""Largest absolute value of a number in a scene file (m, degrees or a factor)."""

MOST_ROBOTS, MOST_ARMS, MOST_OBSTACLES, MOST_TASKS = 32, 16, 1000, 500
"""Most robots of a scene, arms of a robot, obstacles and tasks of a scene."""

MOST_CANDIDATES = 10_000_000
"""Most candidates of a map: heights × angles × rolls × redundancy × torso. It takes minutes at worst."""

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=100)]
AUTO_SAMPLES = 32
"""Redundancy samples with which the search of all of it begins, and all that Algorithm 1 tries then."""

MOST_SAMPLES = 2048
"""Most redundancy samples of a map."""

Samples = Annotated[int, Field(ge=1, le=MOST_SAMPLES)]
Vector = tuple[Number, Number, Number]


def _whole(value: object) -> object:
    """Refuse what Python takes for a 1: true, and 1.0."""
    if type(value) is not int:
        raise ValueError("a whole number")
    return value


WHOLE = BeforeValidator(_whole)
"""Lets nothing but integers pass."""


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
        """Return a pose matrix (4, 4) as position and quaternion."""
        pose = np.asarray(pose, dtype=float)
        return PoseFile(position=tuple(pose[:3, 3].tolist()), quat_wxyz=tuple(quat_wxyz(pose).tolist()))


class FrameFile(_Strict):
    """A frame fixed to a link."""

    link: str
    pose: PoseFile = PoseFile()

    def frame(self) -> Frame:
        """Return the frame as the robot room has it."""
        pose = self.pose.matrix()
        return Frame(self.link, tuple(pose[:3, 3].tolist()), tuple(quat_wxyz(pose).tolist()))


class HandFile(_Strict):
    """A hand described inline; the fields of `symgrasp.robot.hand.Hand`."""

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
    finger_width: NotNegative = 0.0
    shift: Number | list[tuple[NotNegative, Number]] = 0.0
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
    """An arm of a robot that has several; the tool is the hand's own unless given.

    ``joints`` names the first and the last joint of the arm; see `symgrasp.robot.arm_joints` for which they
    are otherwise. All others rest at home.
    """

    name: Name
    tool: str | None = None
    joints: tuple[str, str] | None = None
    hand: NamedOrInline
    mount: MountFile | None = None


class RobotFile(_Strict):
    """A robot: one arm (hand, and tool where the hand has none) or several (arms).

    ``torso`` names joints between base and arms, such as a lift, with the number of values that maps try
    for each: the centres of so many equal parts of its range. All arms of the robot move with them.
    ``support`` is what a legged robot stands on: corners [x, y] (m) in the robot's base frame, or the links
    that are its feet. Its centre of mass, with what it holds, must stay above their convex hull.
    ``acceleration`` (rad/s² or m/s²) is the largest of its joints in motions; 2 unless given. ``velocity``
    (rad/s or m/s) bounds their speed where the URDF allows more.
    """

    name: Name
    urdf: str
    """a URDF, or a xacro or MJCF file, which is made one"""
    xacro_args: Annotated[dict[Name, str | StrictBool | int | Number], Field(max_length=100)] | None = None
    """values of the arguments of a xacro file"""
    follow_up_axis: StrictBool | None = None
    """whether COLLADA meshes are turned so that the axis which they state as up is z; RViz, for which many of
    them are made, does not"""
    srdf: str | None = None
    """links that may touch, and states to park in; the file beside the URDF unless given"""
    base: PoseFile = PoseFile()
    tool: str | None = None
    joints: tuple[str, str] | None = None
    hand: NamedOrInline | None = None
    mount: MountFile | None = None
    arms: Annotated[tuple[ArmFile, ...], Field(min_length=1, max_length=MOST_ARMS)] | None = None
    home: tuple[Number, ...] | dict[str, Number] | None = None
    torso: Annotated[dict[str, Samples], Field(min_length=1)] | None = None
    support: (
        Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3, max_length=100)]
        | Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)]
        | None
    ) = None
    acceleration: Positive | None = None
    velocity: Positive | None = None

    @model_validator(mode="after")
    def _tool_or_arms(self) -> RobotFile:
        single = self.hand is not None
        if single == (self.arms is not None) or (not single and (self.tool or self.mount or self.joints)):
            raise ValueError("either tool, joints and hand, or arms")
        return self

    def arm_files(self) -> tuple[ArmFile, ...]:
        """Return the robot's arms; a single arm has the robot's name."""
        if self.arms is not None:
            return self.arms
        assert self.hand is not None
        return (
            ArmFile(name=self.name, tool=self.tool, joints=self.joints, hand=self.hand, mount=self.mount),
        )


def xacro_texts(given: Mapping[str, str | float] | None) -> dict[str, str]:
    """Return the arguments that a scene file gives a xacro file as xacro takes them."""
    texts = {name: str(value) for name, value in (given or {}).items()}
    return {name: text.lower() if text in ("True", "False") else text for name, text in texts.items()}


class ObjectFile(_Strict):
    """The object of revolution: exactly one of a profile, a name of the library, and a mesh.

    A profile is a list of knots [height, radius] in metres, bottom to top. A mesh is measured;
    ``scale`` is metres in one of its units, ``tolerance`` the largest deviation (m) from symmetry, and
    ``flip`` stands the object on its other end. ``mass`` (kg), spread evenly, is a load for robots that could
    fall; hands that hold the object together bear equal parts of it.
    """

    name: Name
    profile: Annotated[list[tuple[Number, Number]], Field(max_length=MOST_KNOTS, fail_fast=True)] | None = (
        None
    )
    library: str | None = None
    mesh: str | None = None
    scale: Positive = 1.0
    mass: NotNegative | None = None
    tolerance: Positive | None = None
    flip: StrictBool | None = None  # not False, which would be written into every scene and change its hash

    @model_validator(mode="after")
    def _one_source(self) -> ObjectFile:
        if sum(source is not None for source in (self.profile, self.library, self.mesh)) != 1:
            raise ValueError("exactly one of profile, library, mesh")
        if self.mesh is None and (self.tolerance is not None or self.flip):
            raise ValueError("tolerance and flip only for a mesh")
        return self


class CylinderFile(_Strict):
    """A cylinder along z, centred."""

    radius: Positive
    height: Positive


class SphereFile(_Strict):
    """A ball."""

    radius: Positive


class ObstacleFile(_Strict):
    """A fixed body: exactly one shape, at a pose. Boxes give full sizes and are centred.

    A mesh, also one in a URDF, counts as its triangles: what is hollow stays hollow. ``scale`` is metres in
    one unit of ``mesh``; of a format that states its unit, a factor on top of that.
    """

    name: Name
    box: tuple[Positive, Positive, Positive] | None = None
    cylinder: CylinderFile | None = None
    sphere: SphereFile | None = None
    mesh: str | None = None
    scale: Positive | None = None
    urdf: str | None = None
    pose: PoseFile = PoseFile()

    @model_validator(mode="after")
    def _one_shape(self) -> ObstacleFile:
        if sum(getattr(self, kind) is not None for kind in SHAPES) != 1:
            raise ValueError("exactly one of " + ", ".join(SHAPES))
        if self.scale is not None and self.mesh is None:
            raise ValueError("a scale only of a mesh")
        return self


SHAPES = ("box", "cylinder", "sphere", "mesh", "urdf")
"""The keys of an obstacle that give its shape."""


class TaskFile(_Strict):
    """A pose of the object; its rotation about its own axis is free.

    Where no arm has held the object before the task, or none holds it afterwards, something must hold it up
    there, unless the task says ``supported: false``.
    """

    name: Name
    arms: Annotated[tuple[str, ...], Field(min_length=1, max_length=MOST_ROBOTS * MOST_ARMS)] | None = None
    pose: PoseFile
    supported: StrictBool | None = None


class CarryFile(_Strict):
    """How the object is carried in motions: ``tilt_deg`` limits the tilt of its axis from the vertical.

    ``tasks`` are two that follow each other; without them it is meant for the way between any two.
    """

    tilt_deg: Annotated[float, Field(gt=0, le=180, allow_inf_nan=False)]
    tasks: tuple[Name, Name] | None = None


class ResolutionFile(_Strict):
    """How small the parts are that cells which may be mixed are split into: along and around the object."""

    mm: Annotated[float, Field(ge=0.01, allow_inf_nan=False)]
    deg: Annotated[float, Field(ge=0.01, allow_inf_nan=False)]


class MapSettings(_Strict):
    """How finely maps are computed."""

    heights: Annotated[int, Field(ge=1, le=1024)] = 48
    angles: Annotated[int, Field(ge=1, le=1024)] = 96
    redundancy: Samples | Literal["auto"] = "auto"
    """auto: all of the redundancy is searched, nothing is stepped over; or a number of samples to try"""
    approach: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.0
    """length (m) of the straight radial retreat that must be free as well"""
    margin: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.0
    """distance (m) to keep from obstacles and other robots"""
    resolution: ResolutionFile | None = None
    """cells that are not proven to hold as a whole are split down to parts of at most this size"""

    @property
    def samples(self) -> int:
        """Number of redundancy samples: with auto, those with which the search begins."""
        return AUTO_SAMPLES if self.redundancy == "auto" else self.redundancy

    def finer(self, grid: Manifold) -> list[Manifold]:
        """Return the finer grids, down to the resolution, that the cells of a map are split into."""
        if self.resolution is None:
            return []
        return grid.finer(1e-3 * self.resolution.mm, np.deg2rad(self.resolution.deg))

    @model_validator(mode="after")
    def _resolution_without_approach(self) -> MapSettings:
        if self.resolution is not None and self.approach:
            raise ValueError("a resolution only without an approach, with which no feasible cell is proven")
        return self

    @model_validator(mode="after")
    def _not_too_many(self) -> MapSettings:
        candidates = self.heights * self.angles * len(ROLLS) * self.samples
        if candidates > MOST_CANDIDATES:
            raise ValueError(
                f"heights × angles × {len(ROLLS)} rolls × redundancy of at most {MOST_CANDIDATES:,}, "
                f"not {candidates:,}"
            )
        return self


class SceneFile(_Strict):
    """A scene file, version 1."""

    schema_version: Annotated[Literal[1], WHOLE]
    name: Name
    description: str = ""
    robots: Annotated[tuple[RobotFile, ...], Field(min_length=1, max_length=MOST_ROBOTS, fail_fast=True)]
    object: ObjectFile
    obstacles: Annotated[tuple[ObstacleFile, ...], Field(max_length=MOST_OBSTACLES, fail_fast=True)] = ()
    tasks: Annotated[tuple[TaskFile, ...], Field(min_length=1, max_length=MOST_TASKS, fail_fast=True)]
    map: MapSettings = MapSettings()
    carry: CarryFile | Annotated[tuple[CarryFile, ...], Field(max_length=MOST_TASKS)] | None = None

    @model_validator(mode="after")
    def _known_carries(self) -> SceneFile:
        names = [task.name for task in self.tasks]
        for carry in self.carries():
            if carry.tasks is not None and carry.tasks not in pairwise(names):
                raise ValueError(f"carry: tasks that follow each other, not {as_written(carry.tasks)}")
        return self

    def carries(self) -> tuple[CarryFile, ...]:
        """Return what is said of carrying, as a list."""
        if isinstance(self.carry, CarryFile):
            return (self.carry,)
        return self.carry or ()

    @model_validator(mode="after")
    def _not_too_many(self) -> SceneFile:
        m, torso = self.map, max(math.prod((r.torso or {}).values()) for r in self.robots)
        candidates = m.heights * m.angles * len(ROLLS) * m.samples * torso
        if candidates > MOST_CANDIDATES:
            raise ValueError(
                f"heights × angles × {len(ROLLS)} rolls × redundancy × torso samples of at most "
                f"{MOST_CANDIDATES:,}, not {candidates:,}"
            )
        return self


def scene_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files."""
    return SceneFile.model_json_schema()
