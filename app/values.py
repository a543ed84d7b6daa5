"""The values that a page's state is made of: object poses, map requests, and what was computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from symgrasp.feasibility import FeasibilityMap
from symgrasp.plan import Plan
from symgrasp.poses import Array, axis_frame, rotation_z, spin
from symgrasp.scene import Scene
from symgrasp.scene_build import Task
from symgrasp.views import View

__all__ = ["Camera", "MadeLink", "MapRequest", "MapResult", "ObjectPose", "PlanResult", "RollChoice", "moved"]

Camera = tuple[float, ...]
"""Where the camera stands and the point it looks at (m): six numbers."""


@dataclass(frozen=True)
class MadeLink:
    """A link that was made.

    Attributes:
        address: the whole address.
        told: what was shown then, see `app.facts.Facts.told`; nothing once it was looked at from elsewhere.
        camera: where it was looked at from.
    """

    address: str
    told: tuple[object, ...]
    camera: Camera


@dataclass(frozen=True)
class ObjectPose:
    """A pose as a person sets it: where the bottom stands, which way the axis leans, the spin.

    Attributes:
        x, y, z: origin of the object (m).
        lean: angle (rad) between the axis and the world's z.
        towards: azimuth (rad) that the axis leans towards.
        spin: turn (rad) about the object's own axis.
    """

    x: float
    y: float
    z: float
    lean: float = 0.0
    towards: float = 0.0
    spin: float = 0.0

    @staticmethod
    def of(pose: Array) -> ObjectPose:
        """Take a pose (4, 4) apart."""
        axis = pose[:3, 2]
        lean = float(np.arctan2(np.hypot(axis[0], axis[1]), axis[2]))
        towards = float(np.arctan2(axis[1], axis[0])) if lean > 1e-9 else 0.0
        x, y, z = pose[:3, 3].tolist()
        return ObjectPose(x, y, z, lean, towards, spin(pose))

    def matrix(self) -> Array:
        """Return the pose (4, 4)."""
        sine = np.sin(self.lean)
        pose = np.eye(4)
        pose[:3, 2] = [sine * np.cos(self.towards), sine * np.sin(self.towards), np.cos(self.lean)]
        pose[:3, 3] = [self.x, self.y, self.z]
        return axis_frame(pose) @ rotation_z(self.spin)


class RollChoice(Enum):
    """Which of the two rolls a map shows; the value is what the page calls it."""

    EITHER = "either"
    ZERO = "0°"
    HALF_TURN = "180°"

    def rolls(self, m: FeasibilityMap) -> np.ndarray:
        """Return the index (H, A) of the roll that is shown: what got furthest, with most clearance."""
        if self is RollChoice.EITHER:
            return (m.reason + np.nan_to_num(m.clearance)).argmax(axis=0)
        return np.full(m.reason.shape[1:], 0 if self is RollChoice.ZERO else 1)

    def reason(self, m: FeasibilityMap) -> np.ndarray:
        """Return the reasons (H, A) that are shown."""
        return self.of(m, m.reason)

    def values(self, m: FeasibilityMap, view: View) -> np.ndarray:
        """Return the values (H, A) of a view that are shown, in its unit."""
        return self.of(m, m.values(view))

    def of(self, m: FeasibilityMap, cells: np.ndarray) -> np.ndarray:
        """Return what is shown (H, A) of cells (R, H, A) of both rolls."""
        return np.take_along_axis(cells, self.rolls(m)[None], axis=0)[0]

    def roll(self, m: FeasibilityMap, row: int, column: int) -> int:
        """Return the index of the roll that is shown at a cell."""
        return int(self.rolls(m)[row, column])


@dataclass(frozen=True, eq=False)
class MapRequest:
    """What a map is computed for; equal requests have equal maps, whatever other tasks the scene has.

    Attributes:
        scene: the scene as loaded.
        arm, task: names in it.
        pose: where the object was moved to, None where the scene puts it.
    """

    scene: Scene
    arm: str
    task: str
    pose: ObjectPose | None = None

    @property
    def T_world_object(self) -> Array:
        """The base pose (4, 4)."""
        return self.pose.matrix() if self.pose else self.scene.task(self.task).T_world_object

    @cached_property
    def place(self) -> tuple[object, ...]:
        """All that the map depends on, so neither the task's name nor the scene's other tasks."""
        return (*self._stage, self.T_world_object.tobytes())

    @cached_property
    def _stage(self) -> tuple[object, ...]:
        scene = self.scene
        shared = (scene.robots, scene.obstacles, scene.profile, scene.settings)
        return (*map(id, shared), self.arm)  # the scene keeps them alive

    def __eq__(self, other: object) -> bool:
        """Whether the map and its name are the same."""
        return isinstance(other, MapRequest) and (self.task, self.place) == (other.task, other.place)

    def __hash__(self) -> int:
        """Return a number that equal requests share."""
        return hash((self.task, self.place))

    def __reduce__(self) -> tuple[object, ...]:
        """Leave out what was derived: it means nothing in another process."""
        return MapRequest, (self.scene, self.arm, self.task, self.pose)

    def differs_in_pose(self, other: object) -> bool:
        """Whether the other one is for the same map, but for the object's pose."""
        return isinstance(other, MapRequest) and (self.task, self._stage) == (other.task, other._stage)

    def moved_task(self) -> Task:
        """Return the task, moved there."""
        return Task(self.task, self.scene.task(self.task).arms, self.T_world_object)

    def moved_scene(self) -> Scene:
        """Return the scene with the task moved there."""
        return moved(self.scene, {self.task: self.pose} if self.pose else {})


def moved(scene: Scene, poses: Mapping[str, ObjectPose]) -> Scene:
    """Return the scene with tasks moved to other poses."""
    for name, pose in poses.items():
        scene = scene.with_task(Task(name, scene.task(name).arms, pose.matrix()))
    return scene


@dataclass(frozen=True, eq=False)
class MapResult:
    """A computed map, and what the object is inside of at that pose (one phrase each)."""

    request: MapRequest
    map: FeasibilityMap
    contacts: tuple[str, ...] = ()

    def of(self, request: MapRequest) -> MapResult:
        """Return it as the answer to a request for the same place, maybe under another task's name."""
        if request == self.request:
            return self
        return MapResult(request, replace(self.map, task=request.task), self.contacts)


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A plan and what is needed to show it.

    Attributes:
        plan: the plan.
        maps: for every (task, arm) the map it was made from, at δ = 0.
        prints: for every task of the plan, in order, arm → the cells (H, A) under its hand.
        gaps: for every task of the plan the smallest gap (m) between two prints, negative where they
            overlap, None where one hand holds alone.
    """

    plan: Plan
    maps: Mapping[tuple[str, str], MapResult]
    prints: tuple[Mapping[str, np.ndarray], ...]
    gaps: tuple[float | None, ...]
