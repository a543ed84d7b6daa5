"""What the page computes unasked, the results of that, and the computation under way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.explain import Explanation
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.poses import Array
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

from .object_pose import ObjectPose, moved

__all__ = [
    "Busy",
    "CompareRequest",
    "Comparison",
    "ExplainRequest",
    "ExplainResult",
    "MapKey",
    "MapRequest",
    "MapResult",
    "Maps",
    "Request",
]

MapKey = tuple[str, str, bytes]
"""Content of all that a map depends on: hash of the scene, name of the arm, the object's pose."""


@dataclass(frozen=True, eq=False)
class MapRequest:
    """Compute a map; equal requests have equal maps, whatever other tasks the scene has.

    Attributes:
        scene: the scene as loaded.
        arm, task: names in it.
        pose: where the object was moved to, None where the scene puts it.
    """

    scene: Scene
    arm: str
    task: str
    pose: ObjectPose | None = None

    @cached_property
    def T_world_object(self) -> Array:
        """The base pose (4, 4)."""
        return self.pose.matrix() if self.pose else self.scene.task(self.task).T_world_object

    @cached_property
    def key(self) -> MapKey:
        """All that the map depends on: neither the task's name nor the scene's other tasks."""
        return self.scene.map_sha256, self.arm, self.T_world_object.tobytes()

    def __eq__(self, other: object) -> bool:
        """Whether the map and its task are the same."""
        return isinstance(other, MapRequest) and (self.task, self.key) == (other.task, other.key)

    def __hash__(self) -> int:
        """Return a number that equal requests share."""
        return hash((self.task, self.key))

    def differs_in_pose(self, other: object) -> bool:
        """Return whether the other one is for the same map, but for the object's pose."""
        return isinstance(other, MapRequest) and (self.task, *self.key[:2]) == (other.task, *other.key[:2])

    def moved_task(self) -> Task:
        """Return the task, moved to the pose."""
        return Task(self.task, self.scene.task(self.task).arms, self.T_world_object)

    def moved_scene(self) -> Scene:
        """Return the scene with the task moved to the pose."""
        return moved(self.scene, {self.task: self.pose} if self.pose else {})


@dataclass(frozen=True, eq=False)
class MapResult:
    """A computed map, and the obstacles that the object is inside of at that pose (one phrase each)."""

    request: MapRequest
    map: FeasibilityMap
    contacts: tuple[str, ...] = ()

    def renamed(self, request: MapRequest) -> MapResult:
        """Return it as the answer to a request with the same key, with the names of its scene and task."""
        if request is self.request:
            return self
        names = (request.scene.name, request.task)
        same = names == (self.map.scene, self.map.task)
        named = self.map if same else replace(self.map, scene=names[0], task=names[1])
        return MapResult(request, named, self.contacts)


Maps = dict[tuple[str, str], MapResult]
"""(task, arm) → its map."""


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
        """Return whether the other one only turns the object further."""
        return isinstance(other, CompareRequest) and self.map == other.map


@dataclass(frozen=True)
class ExplainRequest:
    """Compute the result of every candidate of a cell.

    Attributes:
        map: the map.
        cell: a cell of it, before it is shifted.
    """

    map: MapRequest
    cell: Cell

    def differs_in_pose(self, other: object) -> bool:
        """Return False: the candidates of another cell are of no use."""
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
    """The results of the candidates of a cell."""

    request: ExplainRequest
    explanation: Explanation


@dataclass(frozen=True)
class Busy:
    """A computation under way.

    Attributes:
        job_id: number of its job; the last messages of an earlier one do not count.
        label: what is computed.
        request: what it answers, None for what a person asked for.
        share: how much of it is done.
        late: whether it takes so long that the page says so and newer requests interrupt it.
        compiling: whether code that it needs had to be compiled, which may happen in several pieces.
    """

    job_id: int
    label: str
    request: Request | None = None
    share: float = 0.0
    late: bool = False
    compiling: bool = False

    def goes_before(self, request: Request) -> bool:
        """Return whether a request waits for this computation instead of taking its place.

        A quick map is finished even if the object has moved on meanwhile. If every movement
        interrupted it, none would arrive until the drag ends.
        """
        if self.request is None or self.request == request:
            return True
        return not self.late and self.request.differs_in_pose(request)
