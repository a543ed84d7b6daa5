"""What the page asks its worker for by itself, and what the worker is busy with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from app.state.object_pose import ObjectPose, moved
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.explain import Explanation
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.poses import Array
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

__all__ = [
    "Busy",
    "CompareRequest",
    "Comparison",
    "ExplainRequest",
    "ExplainResult",
    "MapRequest",
    "MapResult",
    "Request",
]


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


@dataclass(frozen=True)
class CompareRequest:
    """Compute the map of the turned object from scratch, to compare it with the shifted one.

    Attributes:
        map: the map that is shifted.
        delta: by how much (rad).
    """

    map: MapRequest
    delta: float

    def differs_in_pose(self, other: object) -> bool:
        """Whether the other one only turns the object further."""
        return isinstance(other, CompareRequest) and self.map == other.map


@dataclass(frozen=True)
class ExplainRequest:
    """Judge every candidate of a cell.

    Attributes:
        map: the map.
        cell: a cell of it, before it is shifted.
    """

    map: MapRequest
    cell: Cell

    def differs_in_pose(self, other: object) -> bool:
        """Never: what becomes of another cell is of no use."""
        return False


Request = MapRequest | CompareRequest | ExplainRequest
"""What follows from the state and is computed unasked."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """A map computed from scratch, over the grid of the shifted one, and how many cells differ."""

    request: CompareRequest
    map: FeasibilityMap
    differing: int


@dataclass(frozen=True, eq=False)
class ExplainResult:
    """What becomes of the candidates of a cell."""

    request: ExplainRequest
    explanation: Explanation


@dataclass(frozen=True)
class Busy:
    """A computation under way.

    Attributes:
        ticket: number of the computation; the last words of an earlier one do not count.
        label: what is computed.
        request: what it answers, None for what a person asked for.
        share: how much of it is done.
        late: whether it takes so long that the page says so and newer requests interrupt it.
        compiling: whether code that it needs had to be compiled, which may happen in several pieces.
    """

    ticket: int
    label: str
    request: Request | None = None
    share: float = 0.0
    late: bool = False
    compiling: bool = False

    def goes_first(self, request: Request) -> bool:
        """Whether a request waits for this computation instead of taking its place.

        A quick map is finished even if the object has moved on meanwhile. If every movement
        interrupted it, none would arrive until the drag ends.
        """
        if self.request is None or self.request == request:
            return True
        return not self.late and self.request.differs_in_pose(request)
