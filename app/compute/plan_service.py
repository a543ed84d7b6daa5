"""Runs planners and verifies plan files for one session; runs in that session's process."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, combinations, islice
from pathlib import Path

import numpy as np

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.motion.choosing import MOST_TRIED, Failure, failures_in_words, moving_plans
from symgrasp.motion.record import from_plan, with_motion
from symgrasp.motion.times import timing
from symgrasp.object.manifold import ROLLS, wrap
from symgrasp.plan.checked_plan import check_plan
from symgrasp.plan.plan import Hold, Plan, PlanTask
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.planners.conflicts import ConflictError
from symgrasp.planners.gaps import print_gap
from symgrasp.planners.planning import (
    Plans,
    bimanual_plans,
    handover_plans,
    plan_bimanual,
    plan_sequential,
    regrasp_plans,
    sequential_plans,
)
from symgrasp.progress import Progress, part_of, rising
from symgrasp.robot.handprint import Handprint
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

from ..choices.scene_assets import NO_ASSETS, SceneAssets
from ..choices.uploaded_scene import UploadedScene
from ..files.plan_archives import read_plan_archive
from ..files.plan_formats import plan_file
from ..files.scene_files import MAX_NAME, refuse_foreign_files
from ..files.shown_paths import shown_paths
from ..scene3d.visual_meshes import built_to_show
from ..state.object_pose import ObjectPose, with_poses
from ..state.plans.plan_results import ClimbReplay, PlanFileReport, PlanKind, PlanResult, PlanResults, Refusal
from ..state.requests import MapRequest, Maps
from .map_service import MapService

__all__ = [
    "MotionOutcome",
    "MotionRequest",
    "OpenedPlan",
    "PlanOutcome",
    "PlanRequest",
    "PlanService",
    "plan_result",
]

PLANS_PER_BATCH = 10
"""How many plans are computed at a time."""

SEARCH = 0.5
"""Share of a planner's progress in which it searches; in the rest the plans are listed."""

FIRST = 0.5
"""Share of the progress of a motion in which the first plan is tried; in the rest all others are."""

FeasibilityMaps = Mapping[tuple[str, str], FeasibilityMap]
"""(task, arm) → map."""


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """A call of a planner.

    Attributes:
        scene: the scene as loaded.
        kind: which planner.
        method: of that planner.
        name: of the arm (sequential) or of the task (bimanual); not used for handovers.
        poses: task → base pose, of the tasks that were moved.
        seed: of hill climbing.
    """

    scene: Scene
    kind: PlanKind
    method: str = ""
    name: str = ""
    poses: Mapping[str, ObjectPose] = field(default_factory=dict)
    seed: int = 0

    @property
    def tasks(self) -> list[Task]:
        """The tasks to plan."""
        tasks = list(self.scene.tasks.values())
        if self.kind == "sequential":
            return [task for task in tasks if task.arms == (self.name,)]
        return [self.scene.task(self.name)] if self.kind == "bimanual" else tasks

    @property
    def maps(self) -> list[MapRequest]:
        """The maps that the planner needs; none where it would reject the tasks."""
        if self.kind == "bimanual" and len(self.tasks[0].arms) == 1:
            return []
        return [
            MapRequest(self.scene, arm, task.name, self.poses.get(task.name))
            for task in self.tasks
            for arm in task.arms
        ]


@dataclass(frozen=True, eq=False)
class PlanOutcome:
    """The outcome of a planner.

    Attributes:
        kind: which planner.
        plans: the first plans, best first; none where there is a refusal.
        more: whether there may be further plans.
        refusal: why there is no plan.
        climb: the hill climbing, if that was the method.
    """

    kind: PlanKind
    plans: tuple[PlanResult, ...] = ()
    more: bool = False
    refusal: Refusal | None = None
    climb: ClimbReplay | None = None

    def added_to(self, results: PlanResults, maps: Maps) -> PlanResults:
        """Return a page's plan results with this outcome and the maps that it was computed from."""
        if self.plans:
            return results.found(self.kind, self.plans, maps, more=self.more, climb=self.climb)
        assert self.refusal
        return results.refused(self.kind, self.refusal, maps, self.climb)


@dataclass(frozen=True, eq=False)
class MotionRequest:
    """Plans of a scene, of which one is to get a motion.

    Attributes:
        scene: the scene as loaded.
        poses: task → base pose, of the tasks that were moved.
        plans: the plans, best first.
        more: whether the further plans of the last planner follow on these.
    """

    scene: Scene
    poses: Mapping[str, ObjectPose]
    plans: tuple[Plan, ...]
    more: bool = False


@dataclass(frozen=True, eq=False)
class MotionOutcome:
    """A plan with a motion.

    Attributes:
        index: which of the plans that were asked for it is.
        plan: the plan with its motion.
        failures: why those before it have none.
        listed: further plans of the last planner, up to that one.
    """

    index: int
    plan: Plan
    failures: tuple[str, ...]
    listed: tuple[PlanResult, ...] = ()


@dataclass(frozen=True, eq=False)
class OpenedPlan:
    """A plan file that was read and verified.

    Attributes:
        report: what was checked.
        scene: the plan's scene, if the plan holds.
        plan: the plan, if it holds.
    """

    report: PlanFileReport
    scene: UploadedScene | None = None
    plan: PlanResult | None = None

    @property
    def maps(self) -> list[MapRequest]:
        """The maps that show the plan; none where it does not hold."""
        if self.scene is None or self.plan is None:
            return []
        holds = [(task.name, hold.arm) for task in self.plan.plan.tasks for hold in task.holds]
        return [MapRequest(self.scene.scene, arm, task) for task, arm in dict.fromkeys(holds)]


class PlanService:
    """Runs planners; used by one thread at a time.

    Args:
        maps: computes the maps.
        folders: where the files of an uploaded scene may lie.
    """

    def __init__(self, maps: MapService, folders: tuple[Path, ...]) -> None:
        self._maps, self._folders = maps, folders
        self._plans: Plans | None = None
        self._scene: Scene | None = None
        self._ahead: deque[Plan] = deque()  # plans that were tried, but are not listed yet
        self._listed = 0
        self._progress: Progress | None = None
        self._share = 0.0  # that was told last of the planner's work

    def close(self) -> None:
        """End the planner, which holds a physics world."""
        self._ahead.clear()
        if self._plans:
            self._plans.close()
            self._plans = None

    def plan(self, request: PlanRequest, cached: Maps, progress: Progress) -> PlanOutcome:
        """Run a planner.

        Args:
            request: which planner for what.
            cached: those of the maps it needs that were computed before.
            progress: called with the finished share; may raise `Cancelled`.

        Raises:
            SceneError: the scene has nothing for that planner.
        """
        self.close()
        scene = with_poses(request.scene, request.poses)
        results, progress = self._maps.maps(request.maps, cached, rising(progress))
        maps = {key: result.map for key, result in results.items()}
        try:
            if request.method == "hill_climb":
                return _climb(request, scene, maps, progress)
            if request.method == "first":
                plan = plan_sequential(scene, request.name, maps, "first", progress)
                return PlanOutcome(request.kind, (plan_result(plan, scene, partial(progress, 1.0)),))
            self._progress, self._scene = progress, scene
            self._plans, self._listed = self._start_planner(request, scene, maps), 0
            plans, more = self._next_plans()
            assert plans  # without a plan it raises NoPlanError
            return PlanOutcome(request.kind, plans, more)
        except NoPlanError as error:
            self.close()
            conflict = error.conflict if isinstance(error, ConflictError) else None
            return PlanOutcome(request.kind, refusal=Refusal(str(error), conflict))

    def more(self, progress: Progress) -> tuple[tuple[PlanResult, ...], bool]:
        """Return the next plans of the last planner, and whether there may be more."""
        self._progress, self._share = progress, SEARCH
        return self._next_plans()

    def motion(self, request: MotionRequest, progress: Progress) -> MotionOutcome:
        """Find the first of some plans that has a motion.

        Raises:
            NoPlanError: none has one; says why.
        """
        progress = rising(progress)
        self._progress, self._share = progress, 0.0
        timing.load(progress)
        failures: list[Failure] = []
        most = MOST_TRIED if request.more else len(request.plans)

        def tell(share: float) -> None:
            """Tell the progress over all plans from that of one."""
            if tried := len(failures):
                share = FIRST + (1 - FIRST) * (tried - 1 + share) / (most - 1)
            else:  # mostly the first one has a motion
                share *= FIRST
            self._share = share
            progress(share)

        scene = with_poses(request.scene, request.poses)
        plans = chain(request.plans, self._not_listed() if request.more else ())
        with closing(moving_plans(scene, plans, failures, progress=tell)) as found:
            for plan, motion in found:
                index, reasons = len(failures), tuple(failure.reason for failure in failures)
                count = max(index + 1 - len(request.plans), 0)
                listed = tuple(plan_result(self._ahead.popleft(), scene) for _ in range(count))
                self._listed += count
                return MotionOutcome(index, with_motion(plan, motion), reasons, listed)
        raise NoPlanError("no motion: " + "; ".join(failures_in_words(failures)))

    def write(
        self, plan: Plan, format_name: str, folders: Sequence[Path], progress: Progress
    ) -> tuple[str, bytes]:
        """Return a plan as a file, which may take the files of its robots; see `plan_file`."""
        progress(0.0)
        return plan_file(plan, format_name, folders)

    def open(
        self, content: bytes, name: str, unpacked: Scene | None, folder: Path | None, progress: Progress
    ) -> OpenedPlan:
        """Read and verify a plan file; if the plan holds, return all that is needed to show it but its maps.

        The references to files in its scene are checked before anything is loaded.

        Args:
            content: of the file.
            name: of the file.
            unpacked: its scene, where that was read from an archive and its files lie elsewhere than the plan
                says: the plan is verified with this scene.
            folder: an empty one to unpack an archive into; None where the file is no archive.
            progress: called with the finished share; may raise `Cancelled`.

        Raises:
            InputError: see `app.files.plan_archives.read_plan_archive`.
            PlanError: the file is too large or is not a plan.
            SceneError, UrdfError: its scene refers to files that an uploaded scene may not use.
        """
        self.close()
        if folder:
            plan = read_plan_archive(name, content, folder, self._folders)
            content = plan.to_json().encode()
        elif unpacked:
            plan = Plan.parse(content, name)
            plan = plan.model_copy(update={"scene": plan.scene.with_content(unpacked.content)})
            content = plan.to_json().encode()
        else:
            plan = Plan.parse(content, name)
            refuse_foreign_files(f"{name}: scene.content", plan.scene.content, self._folders)
        checked = check_plan(content, name, part_of(progress, 0, 2))
        report = PlanFileReport(name, checked.report.checks, tuple(map(shown_paths, checked.report.failures)))
        scene, plan = checked.scene, checked.plan
        if scene is None:
            return OpenedPlan(report)
        built = built_to_show(scene, part_of(progress, 1, 2))
        assets = SceneAssets(built.visuals) if folder else NO_ASSETS
        uploaded = UploadedScene(f"{name[:MAX_NAME]} (upload)", scene, assets)
        return OpenedPlan(report, uploaded, plan_result(plan, scene, partial(progress, 1.0)))

    def _start_planner(self, request: PlanRequest, scene: Scene, maps: FeasibilityMaps) -> Plans:
        def report_progress(share: float) -> None:
            assert self._progress  # replaced by every call, so that `more` reports its own
            if not self._listed:
                self._share = SEARCH * share
            self._progress(self._share)  # also while plans are listed: it may cancel

        if request.method == "regrasp":
            return regrasp_plans(scene, request.name, maps, report_progress)
        if request.kind == "sequential":
            return sequential_plans(scene, request.name, maps, report_progress)
        if request.kind == "bimanual":
            return bimanual_plans(scene, request.name, maps, report_progress)
        return handover_plans(scene, maps, report_progress)

    def _not_listed(self) -> Iterator[Plan]:
        """Yield the plans that follow on those that are listed; they stay to be listed later."""
        yield from tuple(self._ahead)
        for plan in self._plans or ():
            self._ahead.append(plan)
            yield plan

    def _next_plans(self) -> tuple[tuple[PlanResult, ...], bool]:
        if self._plans is None or self._scene is None:
            return (), False
        assert self._progress
        plans: list[PlanResult] = []
        for plan in islice(self._not_listed(), PLANS_PER_BATCH):
            self._ahead.popleft()
            plans.append(plan_result(plan, self._scene, partial(self._progress, self._share)))
            self._listed += 1
            self._share = SEARCH + (1 - SEARCH) * len(plans) / PLANS_PER_BATCH
            self._progress(self._share)
        more = len(plans) == PLANS_PER_BATCH
        if not more:
            self.close()
        return tuple(plans), more


def _climb(request: PlanRequest, scene: Scene, maps: FeasibilityMaps, progress: Progress) -> PlanOutcome:
    """Run the hill climbing, and the complete search on the same maps to compare."""
    steps: list[ClimbStep] = []
    climbed = exact = refusal = None
    seconds, begun = 0.0, time.perf_counter()
    try:
        first = part_of(progress, 0, 2)
        plan = plan_bimanual(
            scene, request.name, maps, "hill_climb", request.seed, progress=first, trace=steps
        )
        seconds = time.perf_counter() - begun
        climbed = plan_result(plan, scene, partial(progress, 0.5))
    except NoPlanError as error:
        seconds, refusal = time.perf_counter() - begun, Refusal(str(error))
    try:
        exact_plan = plan_bimanual(scene, request.name, maps, progress=part_of(progress, 1, 2))
        exact = plan_result(exact_plan, scene, partial(progress, 1.0))
    except NoPlanError as error:
        refusal = Refusal(str(error))
    arms = request.tasks[0].arms
    climb = None
    if steps:
        climb = ClimbReplay(request.name, arms, request.seed, tuple(steps), climbed, exact, seconds)
    if climbed:
        return PlanOutcome(request.kind, (climbed,), climb=climb)
    return PlanOutcome(request.kind, refusal=refusal, climb=climb)


def plan_result(plan: Plan, scene: Scene, trying: Callable[[], None] = lambda: None) -> PlanResult:
    """Return a plan of a scene with the prints of its hands and the gaps between them.

    Args:
        plan: the plan.
        scene: its scene.
        trying: called before the prints of every task, and the gaps between them; may raise `Cancelled`.
    """
    prints, gaps = [], []
    for task in plan.tasks:
        trying()
        prints.append({h.arm: _print(scene, h) for h in task.holds})
        trying()
        gaps.append(_gap(scene, task))
    return PlanResult(plan, tuple(prints), tuple(gaps), from_plan(plan, scene))


def _print(scene: Scene, hold: Hold) -> np.ndarray:
    """Return the cells (H, A) under the hand, in the object's frame."""
    handprint, column = _handprint(scene, hold)
    return handprint.on(scene.manifold, column)


def _gap(scene: Scene, task: PlanTask) -> float | None:
    """Return the smallest gap (m) between the prints of a task's hands."""
    grid = scene.manifold
    pairs = combinations([_handprint(scene, hold) for hold in task.holds], 2)
    return min((print_gap(a, b, second - first, grid) for (a, first), (b, second) in pairs), default=None)


def _handprint(scene: Scene, hold: Hold) -> tuple[Handprint, int]:
    """Return the print of a hand that holds at column 0, and the column at which it does."""
    grid, arm, grasp = scene.manifold, scene.arm(hold.arm), hold.grasp
    row, column = grid.cell(grasp.h, grasp.theta)
    offset = float(wrap(grasp.theta - grid.theta[column])) if arm.pitched else 0.0
    return arm.handprint(grid, row, ROLLS.index(grasp.roll), grasp.pitch, offset), column
