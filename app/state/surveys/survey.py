"""The part of the state about surveys: where the object or the robot may stand, as far as it is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from symgrasp.poses import Array
from symgrasp.scene.scene import Scene
from symgrasp.survey.evaluation import State as PointState
from symgrasp.survey.placement import Base

from ..cached import cached
from ..object_pose import ObjectPose, with_poses

__all__ = [
    "SPACINGS", "Places", "Stand", "SurveyKind", "SurveyRequest", "SurveyRun", "SurveyState", "SurveyValue",
]  # fmt: skip

SurveyKind = Literal["object", "robot"]
"""What is moved."""

SurveyValue = Literal["share", "margin", "plan"]
"""What the colours stand for."""

SPACINGS: Mapping[SurveyKind, tuple[float, float, float]] = {
    "object": (0.02, 0.2, 0.05), "robot": (0.1, 0.4, 0.2),
}  # fmt: skip
"""Smallest, largest and first distance (m) of places."""


@dataclass(frozen=True, eq=False)
class SurveyRequest:
    """A survey to compute.

    Attributes:
        scene: the scene as loaded.
        poses: task → where the object was moved to.
        task, arm: names in it.
        kind: what is moved: the object in the task, or the robot of the arm.
        spacing: distance (m) of the places that are tried first.
    """

    scene: Scene
    poses: Mapping[str, ObjectPose]
    task: str
    arm: str
    kind: SurveyKind
    spacing: float

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of the attributes to pickle: another thread may cache one meanwhile."""
        return self.__dict__.copy()

    @property
    def robot(self) -> str:
        """Name of the robot of the arm."""
        return self.scene.arms[self.arm].robot.name

    def moved_scene(self) -> Scene:
        """Return the scene with all tasks at the poses they were moved to."""
        return with_poses(self.scene, self.poses)

    @cached
    def subject(self) -> tuple[Any, ...]:
        """All that its results depend on, besides where the object or robot that it moves is now."""
        robots = self.scene.file.robots
        poses = {t.name: ObjectPose.of(t.T_world_object) for t in self.scene.tasks.values()} | {**self.poses}
        if self.kind == "object":
            poses[self.task] = replace(poses[self.task], x=0.0, y=0.0)
        else:
            robots = tuple(r.model_copy(update={"base": None}) if r.name == self.robot else r for r in robots)
        file = self.scene.file.model_copy(update={"robots": robots, "tasks": ()})
        arms = [task.arms for task in self.scene.tasks.values()]
        return self.kind, self.task, self.arm, file, self.scene.source, poses, arms


@dataclass(frozen=True, eq=False)
class Places:
    """What is known of n places, on the horizontal plane of the survey.

    Attributes:
        xy: (n, 2) where they are (m).
        size: (n,) side (m) of the square that each stands for.
        state: (n,) of `symgrasp.survey.evaluation.State`.
        share: (n,) share of the map's cells that are feasible; NaN where no map was computed.
        margin: (n,) largest margin (m) of a cell; NaN where no map was computed.
        plan: (n,) margin (m) of the best plan; NaN where there is none.
        z: height (m) of the plane.
        bases: where the robot is moved, n bases: at each place the one with most margin.
    """

    xy: Array
    size: Array
    state: np.ndarray
    share: Array
    margin: Array
    plan: Array
    z: float
    bases: tuple[Base, ...] = ()

    def values(self, value: SurveyValue) -> Array:
        """Return the values (n,) in %, mm, or 1 where a plan exists and 0 where none does; NaN: no value."""
        if value == "plan":
            return np.where(self.state == PointState.COMPUTED, np.isfinite(self.plan).astype(float), np.nan)
        return 100 * self.share if value == "share" else 1e3 * self.margin


class Stand(NamedTuple):
    """A base that was planned and verified: where it is, and the smallest margin (m) of its plan."""

    base: Base
    margin: float


@dataclass(frozen=True)
class SurveyRun:
    """A survey under way.

    Attributes:
        number: of its job.
        label: what it computes.
        points, of: how many points are computed, and of how many, as far as is known.
        seconds: since when (s).
    """

    number: int
    label: str = ""
    points: int = 0
    of: int = 0
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class SurveyState:
    """What a browser shows of surveys.

    Attributes:
        kind: what is to be moved.
        value: what the colours stand for.
        spacing: kind → distance (m) of the places.
        shown: whether the 3D view shows the survey.
        request: what the places answer; None before the first.
        places: what is known of them.
        stands: the best bases, planned and verified, best first.
        run: the survey under way.
        problem: one line about what went wrong with the last one.
    """

    kind: SurveyKind = "object"
    value: SurveyValue = "share"
    spacing: Mapping[SurveyKind, float] = field(
        default_factory=lambda: {kind: sizes[2] for kind, sizes in SPACINGS.items()}
    )
    shown: bool = True
    request: SurveyRequest | None = None
    places: Places | None = None
    stands: tuple[Stand, ...] = ()
    run: SurveyRun | None = None
    problem: str = ""

    @property
    def values(self) -> Array:
        """The values (n,) of the places, as they are coloured; see `Places.values`."""
        assert self.places is not None
        return self.places.values(self.value)
