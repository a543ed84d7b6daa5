"""What the page asks the planners for: the same calls as those of the command line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations, islice

import numpy as np

from app.compute.map_service import Maps, MapService, check_visuals
from app.files.scene_files import refuse_foreign_files
from app.state.object_pose import ObjectPose, moved
from app.state.plan_results import ClimbReplay, Kind, PlanFileReport, PlanResult, PlanResults, Refusal
from app.state.requests import MapRequest
from app.state.uploaded_scene import UploadedScene
from symgrasp.errors import NoPlanError, PlanError
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS
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
    sequential_plans,
)
from symgrasp.progress import Progress
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

__all__ = ["PLAN_LIMIT", "OpenedPlan", "PlanRequest", "PlanService"]

PLAN_LIMIT = 5_000_000
"""Largest plan file (bytes) that is looked at."""

LISTED = 10
"""How many plans are listed at a time."""


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """What is to be planned.

    Attributes:
        scene: the scene as loaded.
        kind: which planner.
        method: of that planner.
        name: of the arm (sequential) or of the task (bimanual); not used for handovers.
        poses: task → base pose, of the tasks that were moved.
        seed: of hill climbing.
    """

    scene: Scene
    kind: Kind
    method: str = ""
    name: str = ""
    poses: Mapping[str, ObjectPose] = field(default_factory=dict)
    seed: int = 0

    @property
    def tasks(self) -> list[Task]:
        """The tasks that are planned."""
        tasks = list(self.scene.tasks.values())
        if self.kind == "sequential":
            return [task for task in tasks if task.arms == (self.name,)]
        return [self.scene.task(self.name)] if self.kind == "bimanual" else tasks

    @property
    def requests(self) -> list[MapRequest]:
        """The maps it takes."""
        return [
            MapRequest(self.scene, arm, task.name, self.poses.get(task.name))
            for task in self.tasks
            for arm in task.arms
        ]


@dataclass(frozen=True, eq=False)
class OpenedPlan:
    """A plan file that was looked at.

    Attributes:
        report: what was found out.
        scene: the plan's scene, if the plan holds.
        plan: the plan, if it holds.
    """

    report: PlanFileReport
    scene: UploadedScene | None = None
    plan: PlanResult | None = None


class PlanService:
    """Plans for one browser; used by one thread at a time.

    Args:
        bench: computes the maps.
    """

    def __init__(self, bench: MapService) -> None:
        self.bench = bench
        self._list: Plans | None = None
        self._scene: Scene | None = None
        self._progress: Progress | None = None

    def close(self) -> None:
        """End the list of plans, which holds a physics world."""
        if self._list:
            self._list.close()
            self._list = None

    def run(self, order: PlanRequest, plan_results: PlanResults, progress: Progress) -> PlanResults:
        """Run a planner; return the book with what it found, or with why it found nothing.

        Raises:
            SceneError: the scene has nothing for that planner.
        """
        self.close()
        scene = moved(order.scene, order.poses)
        many = order.kind != "bimanual" or len(order.tasks[0].arms) > 1
        maps, rest = self.bench.maps(order.requests if many else [], progress)
        known = {key: result.map for key, result in maps.items()}
        try:
            if order.method == "hill_climb":
                return self._climb(order, scene, maps, plan_results, rest)
            if order.method in ("first", "regrasp"):
                by_task = {task: m for (task, _), m in known.items()}
                plan = plan_sequential(scene, order.name, by_task, order.method, rest)
                return plan_results.found(order.kind, (_result(plan, scene, maps),), more=False)
            self._progress, self._scene = rest, scene
            self._list = self._listing(order, scene, known)
            plans, more = self._next(maps, first=True)
            return plan_results.found(order.kind, plans, more=more)
        except NoPlanError as error:
            self.close()
            conflict = error.conflict if isinstance(error, ConflictError) else None
            return plan_results.refused(order.kind, Refusal(str(error), conflict), maps)

    def more(self, maps: Maps, progress: Progress) -> tuple[tuple[PlanResult, ...], bool]:
        """Return further plans of the last run, and whether there may be still more."""
        self._progress = progress
        return self._next(maps)

    def open(self, content: bytes, name: str, progress: Progress) -> OpenedPlan:
        """Read a plan file and verify it; if it holds, return all that is needed to show it.

        Nothing of it is built before its references to files are known to be harmless.

        Raises:
            PlanError: the file is too large or is not a plan.
            SceneError: its scene refers to files that an upload may not.
        """
        self.close()
        if len(content) > PLAN_LIMIT:
            size, limit = f"{len(content) / 1e6:.1f} MB", f"{PLAN_LIMIT / 1e6:g} MB"
            raise PlanError(name, "size of the file", size, f"a plan of at most {limit}")
        folders = self.bench.store.folders
        refuse_foreign_files(f"{name}: scene.content", Plan.parse(content, name).scene.content, folders)
        checked = check_plan(content, name, lambda share: progress(share / 2))
        report = PlanFileReport(name, checked.report.checks, tuple(checked.report.failures))
        scene, plan = checked.scene, checked.plan
        if scene is None:
            return OpenedPlan(report)
        check_visuals(scene)
        keys = dict.fromkeys((task.name, hold.arm) for task in plan.tasks for hold in task.holds)
        requests = [MapRequest(scene, arm, task) for task, arm in keys]
        maps, _ = self.bench.maps(requests, lambda share: progress((1 + share) / 2))
        return OpenedPlan(report, UploadedScene(f"{name} (upload)", scene), _result(plan, scene, maps))

    def _listing(
        self, order: PlanRequest, scene: Scene, maps: Mapping[tuple[str, str], FeasibilityMap]
    ) -> Plans:
        def tell(share: float) -> None:
            assert self._progress
            self._progress(share)

        if order.kind == "sequential":
            return sequential_plans(scene, order.name, {task: m for (task, _), m in maps.items()}, tell)
        if order.kind == "bimanual":
            return bimanual_plans(scene, order.name, {arm: m for (_, arm), m in maps.items()}, tell)
        return handover_plans(scene, maps, tell)

    def _next(self, maps: Maps, *, first: bool = False) -> tuple[tuple[PlanResult, ...], bool]:
        if self._list is None or self._scene is None:
            return (), False
        scene = self._scene
        plans = tuple(_result(plan, scene, maps) for plan in islice(self._list, LISTED))
        more = len(plans) == LISTED
        if not more:
            self.close()
        assert plans or not first  # a planner that finds nothing says why
        return plans, more

    def _climb(
        self, order: PlanRequest, scene: Scene, maps: Maps, plan_results: PlanResults, progress: Progress
    ) -> PlanResults:
        """Climb, and search completely on the same maps to compare."""
        by_arm = {arm: result.map for (_, arm), result in maps.items()}
        steps: list[ClimbStep] = []
        found = exact = refusal = None
        try:
            plan = plan_bimanual(
                scene, order.name, by_arm, "hill_climb", order.seed, progress=progress, trace=steps
            )
            found = _result(plan, scene, maps)
        except NoPlanError as error:
            refusal = Refusal(str(error))
        try:
            exact = _result(plan_bimanual(scene, order.name, by_arm, progress=progress), scene, maps)
        except NoPlanError as error:
            refusal = Refusal(str(error))
        arms = order.tasks[0].arms
        climb = ClimbReplay(order.name, arms, order.seed, tuple(steps), found, exact) if steps else None
        if found:
            return plan_results.found(order.kind, (found,), more=False, climb=climb)
        assert refusal
        return plan_results.refused(order.kind, refusal, maps, climb)


def _result(plan: Plan, scene: Scene, maps: Maps) -> PlanResult:
    prints = tuple(
        {h.arm: _print(scene, maps[task.name, h.arm].map, h) for h in task.holds} for task in plan.tasks
    )
    return PlanResult(plan, maps, prints, tuple(_gap(scene, task) for task in plan.tasks))


def _print(scene: Scene, m: FeasibilityMap, hold: Hold) -> np.ndarray:
    """Return the cells (H, A) under the hand, in the object's frame."""
    row, column = m.manifold.cell(hold.grasp.h, hold.grasp.theta)
    roll = ROLLS.index(hold.grasp.roll)
    return scene.arm(hold.arm).handprint(m.manifold, row, roll).on(m.manifold, column)


def _gap(scene: Scene, task: PlanTask) -> float | None:
    """Return the smallest gap (m) between the prints of a task's hands."""
    grid = scene.manifold
    placed = []
    for hold in task.holds:
        row, column = grid.cell(hold.grasp.h, hold.grasp.theta)
        roll = ROLLS.index(hold.grasp.roll)
        placed.append((scene.arm(hold.arm).handprint(grid, row, roll), column))
    pairs = combinations(placed, 2)
    return min((print_gap(a, b, second - first, grid) for (a, first), (b, second) in pairs), default=None)
