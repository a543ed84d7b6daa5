"""What a state needs computed, the results, and the computation under way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.explain import CandidateResult, Explanation
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.poses import Array
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.survey.success import PoseNoise

from .cached import cached
from .object_pose import ObjectPose, with_poses

__all__ = [
    "SAME_PHI",
    "Busy",
    "CompareRequest",
    "Comparison",
    "ElbowMotion",
    "ElbowMotions",
    "ElbowRequest",
    "ExplainRequest",
    "ExplainResult",
    "MapKey",
    "MapRequest",
    "MapResult",
    "Maps",
    "Probability",
    "ProbabilityRequest",
    "Request",
    "Windows",
    "WindowsRequest",
]

SAME_PHI = 1e-6
"""Difference (rad) of two redundancy values up to which they are one."""

MapKey = tuple[str, str, bytes]
"""All that a map depends on: hash of the scene without tasks (and who shares the load), name of the arm,
bytes of the object's pose."""


@dataclass(frozen=True, eq=False)
class MapRequest:
    """A map to compute; requests are equal if their tasks have the same name and their maps the same key.

    Attributes:
        scene: the scene as loaded.
        arm, task: names in it.
        pose: where the object was moved to, None where the scene puts it.
    """

    scene: Scene
    arm: str
    task: str
    pose: ObjectPose | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of the attributes to pickle: another thread may cache one meanwhile."""
        return self.__dict__.copy()

    @cached
    def T_world_object(self) -> Array:
        """The base pose (4, 4)."""
        return self.pose.matrix() if self.pose else self.scene.task(self.task).T_world_object

    @cached
    def key(self) -> MapKey:
        """The key of the map, without the task's name and the scene's other tasks."""
        content = self.scene.map_sha256
        if self.scene.object_mass:  # how the load is shared depends on who holds the object
            content += " " + " ".join(self.scene.task(self.task).arms)
        return content, self.arm, self.T_world_object.tobytes()

    def __eq__(self, other: object) -> bool:
        """Return whether the other is a request for the same map and task name."""
        return isinstance(other, MapRequest) and (self.task, self.key) == (other.task, other.key)

    def __hash__(self) -> int:
        """Return a hash that is equal for equal requests."""
        return hash((self.task, self.key))

    def differs_only_in_pose(self, other: object) -> bool:
        """Return whether the other is for the same scene, arm and task, at any pose."""
        return isinstance(other, MapRequest) and (self.task, *self.key[:2]) == (other.task, *other.key[:2])

    def moved_task(self) -> Task:
        """Return the task, moved to the pose."""
        return replace(self.scene.task(self.task), T_world_object=self.T_world_object)

    def moved_scene(self) -> Scene:
        """Return the scene with the task moved to the pose."""
        return with_poses(self.scene, {self.task: self.pose} if self.pose else {})


@dataclass(frozen=True, eq=False)
class MapResult:
    """A computed map.

    Attributes:
        request: what it answers.
        map: the map.
        contacts: a phrase for each obstacle that the object is inside of at that pose.
        preliminary: whether the map is to be looked at only until the exact one is computed: it is a coarse
            one, or samples of the redundancy were searched where all of it is to be.
    """

    request: MapRequest
    map: FeasibilityMap
    contacts: tuple[str, ...] = ()
    preliminary: bool = False

    def renamed(self, request: MapRequest) -> MapResult:
        """Return it as the answer to a request with the same key, with that scene's and task's names."""
        names = (request.scene.name, request.task)
        same = names == (self.map.scene, self.map.task)
        named = self.map if same else replace(self.map, scene=names[0], task=names[1])
        return MapResult(request, named, self.contacts, self.preliminary)


Maps = dict[tuple[str, str], MapResult]
"""(task, arm) → its map."""


@dataclass(frozen=True)
class CompareRequest:
    """A map of the turned object to compute from scratch and to compare with the shifted one.

    Attributes:
        map: the map that is shifted.
        delta: turn (rad) of the object.
    """

    map: MapRequest
    delta: float

    def differs_only_in_pose(self, other: object) -> bool:
        """Return whether the other is for the same map, at any turn."""
        return isinstance(other, CompareRequest) and self.map == other.map


@dataclass(frozen=True)
class _CellRequest:
    """Something to be computed of a cell.

    Attributes:
        map: the map.
        cell: a cell of it, unshifted.
    """

    map: MapRequest
    cell: Cell

    def differs_only_in_pose(self, other: object) -> bool:
        """Return False: what is known of another cell is not shown meanwhile."""
        return False


class ExplainRequest(_CellRequest):
    """A cell whose candidates are all to be checked."""


class ElbowRequest(_CellRequest):
    """A cell of which is to be known how the elbow may move while the hand holds the object there."""


@dataclass(frozen=True)
class ProbabilityRequest:
    """A map of which is to be known how probable its grasps are.

    Attributes:
        map: the map.
        noise: how the object's pose is uncertain.
    """

    map: MapRequest
    noise: PoseNoise

    def differs_only_in_pose(self, other: object) -> bool:
        """Return False: it takes as long as many maps, and is not waited for where another is wanted."""
        return False


@dataclass(frozen=True)
class WindowsRequest:
    """A map of which is to be known how wide the windows of its cells are.

    Attributes:
        map: the map.
    """

    map: MapRequest

    def differs_only_in_pose(self, other: object) -> bool:
        """Return False: it takes as long as maps, and is not waited for where another is wanted."""
        return False


Request = MapRequest | CompareRequest | ExplainRequest | ProbabilityRequest | WindowsRequest | ElbowRequest
"""What a state may need computed; it is started without an action of a person."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    Attributes:
        request: what it answers.
        map: the map computed from scratch, over the grid of the shifted one.
        differing: how many cells, of both rolls, have another reason in the two maps.
    """

    request: CompareRequest
    map: FeasibilityMap
    differing: int


@dataclass(frozen=True, eq=False)
class ExplainResult:
    """The candidates of a cell with their results."""

    request: ExplainRequest
    explanation: Explanation


@dataclass(frozen=True, eq=False)
class Probability:
    """How probable the grasps of a map are.

    Attributes:
        request: what it answers.
        feasible: (R, H, A) at how many draws of the pose each cell of the unshifted map is feasible.
        draws: how many there were.
    """

    request: ProbabilityRequest
    feasible: np.ndarray
    draws: int


@dataclass(frozen=True)
class Busy:
    """A computation under way.

    Attributes:
        job_id: number of its job; messages of any other job are ignored.
        label: what is computed.
        request: what it answers, None for what a person started.
        share: how much of it is done, 0 to 1.
        late: whether it takes so long that the page shows it and newer requests interrupt it.
        compiling: whether code has to be compiled for it.
        waiting: whether computations of others go first.
        seen: whether a preliminary result of it was shown.
    """

    job_id: int
    label: str
    request: Request | None = None
    share: float = 0.0
    late: bool = False
    compiling: bool = False
    waiting: bool = False
    seen: bool = False

    def goes_before(self, request: Request) -> bool:
        """Return whether a request waits for this computation instead of taking its place.

        A map that computes quickly is finished, or a preliminary one of it shown, even if the object has been
        moved since; if every movement interrupted it, no map would be shown until a drag ends.
        """
        if self.request is None or self.request == request:
            return True
        return not (self.late or self.seen) and self.request.differs_only_in_pose(request)


@dataclass(frozen=True, eq=False)
class Windows:
    """How wide the windows of a map's cells are.

    Attributes:
        request: what it answers.
        widest: (R, H, A) width (rad) of the widest window of each cell, NaN where there is none to be known.
    """

    request: WindowsRequest
    widest: np.ndarray


@dataclass(frozen=True, eq=False)
class ElbowMotion:
    """A motion of the elbow along a window of a cell, see `symgrasp.self_motion`.

    Attributes:
        branch: branch of the closed form.
        phi: (k,) values of the redundancy (rad), rising.
        q: (k, n) joint values (rad or m) of the arm there, a torso's first.
    """

    branch: int
    phi: Array
    q: Array

    def holds(self, candidate: CandidateResult, torso: int) -> bool:
        """Return whether a candidate lies on it, of an arm with so many joints of a torso."""
        return (
            self.branch == candidate.branch
            and self.phi[0] - SAME_PHI <= candidate.phi <= self.phi[-1] + SAME_PHI
            and np.allclose(self.q[0, :torso], candidate.q[:torso], atol=SAME_PHI)
        )

    def at(self, phi: float) -> Array:
        """Return the joint values (n,) at a value of the redundancy (rad), at its ends beyond them."""
        return np.array([np.interp(phi, self.phi, values) for values in self.q.T])


@dataclass(frozen=True, eq=False)
class ElbowMotions:
    """How the elbow may move while the hand holds the object at a cell.

    Attributes:
        request: what it answers.
        motions: all that can be seen; none of arms without redundancy.
    """

    request: ElbowRequest
    motions: tuple[ElbowMotion, ...]
