"""The plan file: what a planner decided, with everything needed to check it, as versioned JSON."""

from __future__ import annotations

import copy
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StrictInt,
    ValidationError,
    model_validator,
)

from symgrasp import page
from symgrasp.errors import PlanError, SymgraspError
from symgrasp.feasibility.pictures import to_png
from symgrasp.files import check_size, parse_json, read_file, write_atomically
from symgrasp.plan.motion_record import MotionRecord
from symgrasp.poses import Array, quat_wxyz
from symgrasp.references import resolve
from symgrasp.scene.content import content_sha256, file_references
from symgrasp.scene.field_errors import describe_error
from symgrasp.scene.format import MOST_TASKS, WHOLE, SceneFile

if TYPE_CHECKING:  # reading plans takes neither
    from symgrasp.feasibility.map import FeasibilityMap
    from symgrasp.scene.scene import Scene

__all__ = [
    "CLEARANCE_LIMIT",
    "FRAMES",
    "LARGEST_PLAN",
    "UNITS",
    "Grasp",
    "Hold",
    "Plan",
    "PlanTask",
    "Planner",
    "Pose",
    "SceneRecord",
    "plan_schema",
]

CLEARANCE_LIMIT = 0.1
"""Clearances are measured up to this distance (m)."""

LARGEST_PLAN = 5_000_000
"""Largest plan file (bytes) that is read."""

OTHER_FILES = {
    ".yaml": "not a scene",
    ".yml": "not a scene",
    ".zip": "which an archive of the page has beside the robots' files, once it is unpacked",
}
"""Ending of a file that is no plan → what to say of it."""

NUMBERS = re.compile(r"\[\n\s*([-+\d.eE,\s]+?)\n\s*\]")
"""An array of numbers over several lines; in a string there is no line break."""

Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Count = Annotated[StrictInt, Field(ge=0)]
Package = Literal["python", "symgrasp", "numpy", "pybullet"]
VERSION = r"^[0-9][0-9A-Za-z.+_-]{0,99}$"
Row = tuple[Finite, Finite, Finite, Finite]


UNITS = {"length": "m", "angle": "rad", "quaternion": "wxyz"}
FRAMES = {
    "world": "the scene's frame, z up",
    "object": "origin on the axis at the bottom, z along the axis of symmetry",
    "tool": "between the finger tips, z = approach, y = closing direction",
}
"""What every plan says of its numbers."""


def _just(expected: dict[str, str]) -> AfterValidator:
    """Return a validator that lets one value pass."""

    def check(value: dict[str, str]) -> dict[str, str]:
        if value != expected:
            raise ValueError(str(expected))
        return value

    return AfterValidator(check)


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Pose(_Part):
    """A pose, written twice: as a matrix and as position (m) and wxyz quaternion."""

    matrix: tuple[Row, Row, Row, Row]
    position: tuple[Finite, Finite, Finite]
    quat_wxyz: Row

    @staticmethod
    def of(pose: ArrayLike) -> Pose:
        """Write a pose (4, 4)."""
        pose = np.asarray(pose, dtype=float)
        return Pose(matrix=pose.tolist(), position=pose[:3, 3].tolist(), quat_wxyz=quat_wxyz(pose).tolist())

    def array(self) -> Array:
        """Return the matrix (4, 4)."""
        return np.array(self.matrix)


class Grasp(_Part):
    """A grasp on the object's surface."""

    h: Finite = Field(description="height along the axis (m)")
    theta: Finite = Field(description="angle about the axis (rad), in the object's frame")
    roll: Finite = Field(description="turn about the approach (rad): 0 or π")
    pitch: Finite = Field(
        default=0.0,
        description="turn about the closing direction (rad), through the point of the object's axis at h, "
        "positive with the palm above: of arms of five joints, the same in all tasks up to 0.0001",
    )


class Hold(_Part):
    """How one arm holds the object in one task."""

    arm: str
    robot: str
    grasp: Grasp
    tool_pose: Pose = Field(description="T_world_tool")
    joints: dict[str, Finite] = Field(description="joint name → value (rad), base to tool")
    hand_joints: dict[str, Finite] = Field(description="hand joint name → value (m or rad)")
    opening: Finite = Field(description="distance between the finger pads (m)")
    clearance: Finite = Field(
        ge=0,
        le=CLEARANCE_LIMIT,
        description=f"smallest distance (m) of bodies that may not touch; {CLEARANCE_LIMIT} stands for more",
    )
    margin_along: Finite = Field(ge=0, description="how far (m) the grasp may be off along the axis")
    margin_around: Finite = Field(ge=0, description="how far (rad) the grasp may be off about the axis")
    margins: Literal["cells", "proven"] = Field(
        default="cells",
        description="what the margins are: cells, the distances to the next infeasible cells of the map, all "
        "nearer cells being feasible at their centres; or proven, lower bounds within which every grasp is "
        "feasible, 0 where nothing is proven",
    )
    limit_slack: Finite | None = Field(
        default=None, ge=0, description="distance (rad) of the nearest joint from its limit, at most π"
    )
    conditioning: Finite | None = Field(
        default=None,
        ge=0,
        le=1,
        description="smallest over largest singular value of the Jacobian, lengths over that of the arm",
    )


class PlanTask(_Part):
    """The object pose of a task, the turn about its axis, and the hands on it."""

    name: str
    object_pose: Pose = Field(description="T_world_object as the scene gives it")
    delta: Finite = Field(description="turn of the object about its own axis (rad)")
    object_pose_turned: Pose = Field(description="object_pose · Rz(delta)")
    holds: tuple[Hold, ...]
    balance: dict[str, Finite] = Field(
        default={},
        description="robot that could fall → how far (m) its centre of mass is inside of its support",
    )


class Planner(_Part):
    """What made the plan."""

    algorithm: Literal["best", "first", "regrasp", "exact", "hill_climb"]
    seed: Count | None = None
    settings: dict[Literal["restarts", "iterations"], Count] = {}
    statistics: dict[Literal["placements", "restarts", "iterations", "counted", "body_checks"], Count] = {}


class SceneRecord(_Part):
    """The scene the plan is for."""

    name: str
    sha256: str
    content: dict[str, Any]

    def with_content(self, content: dict[str, Any]) -> SceneRecord:
        """Return the record of a scene with this content, which is hashed."""
        return self.model_copy(update={"content": content, "sha256": content_sha256(content)})


class Plan(_Part):
    """A plan, format version 3: version 1 has no motion, and version 2 no proven margins."""

    schema_version: Annotated[Literal[1, 2, 3], WHOLE]
    kind: Literal["sequential", "bimanual", "handover"]
    scene: SceneRecord
    versions: dict[Package, Annotated[str, Field(pattern=VERSION)]]
    planner: Planner
    units: Annotated[dict[str, str], _just(UNITS)]
    frames: Annotated[dict[str, str], _just(FRAMES)]
    robots: dict[str, tuple[str, ...]] = Field(description="robot → names of all its joints")
    tasks: Annotated[tuple[PlanTask, ...], Field(max_length=MOST_TASKS, fail_fast=True)]
    motion: MotionRecord | None = Field(default=None, description="how the arms get from grasp to grasp")

    @model_validator(mode="after")
    def _motion_since_version_2(self) -> Plan:
        if self.motion is not None and self.schema_version == 1:
            raise ValueError("schema_version 2 of a plan with a motion")
        return self

    @model_validator(mode="after")
    def _proven_margins_since_version_3(self) -> Plan:
        proven = any(hold.margins == "proven" for task in self.tasks for hold in task.holds)
        if proven and self.schema_version < 3:
            raise ValueError("schema_version 3 of a plan with proven margins")
        return self

    def to_json(self) -> str:
        """Return the plan as JSON text; floats read back exactly."""
        text = json.dumps(self.model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False)
        return (
            NUMBERS.sub(
                lambda found: "[" + ", ".join(number.strip() for number in found[1].split(",")) + "]", text
            )
            + "\n"
        )

    def save(self, path: str | Path) -> None:
        """Write the plan, in one piece."""
        with write_atomically(Path(path)) as file:
            file.write(self.to_json().encode())

    def maps(self, scene: Scene) -> dict[tuple[str, str], FeasibilityMap]:
        """Compute the maps of all holds: (task, arm) → map of the scene, which must be the plan's."""
        from symgrasp.feasibility.create import MapMaker  # reading plans takes no physics
        from symgrasp.world import open_world

        with open_world(scene) as world:
            maker = MapMaker(world)
            keys = dict.fromkeys((task.name, hold.arm) for task in self.tasks for hold in task.holds)
            return {(task, arm): maker.map(arm, task) for task, arm in keys}

    def show(self) -> None:
        """Show on the maps of its tasks where the arms hold, and the arms at the object in 3D.

        A notebook displays both. Elsewhere they are written to files in the system's temporary folder,
        whose addresses are printed, and the 3D view is opened in a browser.

        Raises:
            SymgraspError: the scene in the plan is unusable.
        """
        from symgrasp.scene.scene import Scene

        scene = Scene.from_content(self.scene.content, "plan: scene.content")
        maps = self.maps(scene)
        for task in self.tasks:
            for hold in task.holds:
                seen = maps[task.name, hold.arm].shift(task.delta)
                png = to_png(seen.plot(marks=[(hold.grasp.h, hold.grasp.theta)]))
                page.show_picture(png, f"{self.scene.name}, {task.name} with {hold.arm}")
        name = f"{self.scene.name}, {self.kind} plan"
        try:
            document = page.page_module("server.notebook").plan_document(self, scene, maps)
        except (ImportError, SymgraspError) as error:
            print(f"{name}: no 3D view: {error}")
        else:
            page.show_html(document, name)

    def found_from(self, folder: Path) -> Plan:
        """Return the plan with absolute paths in place of those that its scene gives relative to a folder.

        A plan whose scene does not have the hash that the plan states stays as it is.
        """
        record, content = self.scene, copy.deepcopy(self.scene.content)
        if content_sha256(content) != record.sha256:
            return self
        try:
            SceneFile.model_validate(content)
        except ValidationError:
            return self
        moved = False
        for _, holder, key in file_references(content):
            reference = holder[key]
            if "://" not in reference and not Path(reference).is_absolute():
                path = resolve(reference, folder) or folder / reference
                holder[key], moved = str(path.resolve()), True
        return self.model_copy(update={"scene": record.with_content(content)}) if moved else self

    @staticmethod
    def load(path: str | Path) -> Plan:
        """Read a plan; what its scene refers to by relative paths is beside it.

        Raises:
            PlanError: the file is missing or is not such a plan.
        """
        expected = OTHER_FILES.get(Path(path).suffix)
        if expected and Path(path).is_file():
            raise PlanError(path, "file", Path(path).suffix, f"a plan: a JSON file, {expected}")
        try:
            content = read_file(Path(path), LARGEST_PLAN)
        except (OSError, ValueError) as error:
            raise PlanError(path, "file", str(error), "a readable JSON file") from error
        return Plan.parse(content, str(path)).found_from(Path(path).parent)

    @staticmethod
    def parse(content: str | bytes, source: str) -> Plan:
        """Read the content of a plan file; ``source`` names it in errors.

        Raises:
            PlanError: it is not such a plan.
        """
        try:
            check_size(content, LARGEST_PLAN)
            data = parse_json(content)
        except (ValueError, RecursionError) as error:
            raise PlanError(source, "file", str(error), "a readable JSON file") from error
        try:
            return Plan.model_validate(data)
        except ValidationError as error:
            raise PlanError(source, *describe_error(error, data)) from None


def plan_schema() -> dict[str, Any]:
    """Return the JSON Schema of plan files."""
    return Plan.model_json_schema()
