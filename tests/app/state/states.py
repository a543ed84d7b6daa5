"""States of a page with small maps and plans, for tests."""

from __future__ import annotations

from functools import cache

from app.compute.map_service import MapService
from app.compute.plan_service import PlanRequest, PlanService
from app.state import job_changes
from app.state.object_pose import ObjectPose
from app.state.plans import plan_changes
from app.state.plans.plan_results import PlanKind, PlanResults
from app.state.requests import MapRequest, MapResult
from app.state.state import State
from symgrasp.feasibility.create import create_map
from tests.conftest import load_small


@cache
def small_map(name: str, task: str, arm: str, pose: ObjectPose | None = None) -> MapResult:
    request = MapRequest(load_small(name), arm, task, pose)
    return MapResult(request, create_map(request.moved_scene(), task=task, arm=arm))


def opened(name: str = "bottle_on_table") -> State:
    """A scene with its map, as the page shows it first."""
    state = State.of(load_small(name), name)
    return job_changes.map_arrived(state, 0, small_map(name, state.task, state.arm))


@cache
def planned(name: str, kind: PlanKind, method: str = "") -> PlanResults:
    scene = load_small(name)
    order = PlanRequest(scene, kind, method, scene.arm().name if kind == "sequential" else scene.task().name)
    return results_of(order)


def results_of(request: PlanRequest, results: PlanResults | None = None) -> PlanResults:
    """Run a planner here, and return what the page then shows."""
    computed: list[MapResult] = []
    maps = MapService(computed.append)
    plans = PlanService(maps, ())
    try:
        outcome = plans.plan(request, {}, lambda share: None)
    finally:
        plans.close()
        maps.close()
    return outcome.added_to(results or PlanResults(), {(r.request.task, r.request.arm): r for r in computed})


def with_plan(name: str, kind: PlanKind, method: str = "") -> State:
    return plan_changes.show_results(opened(name), planned(name, kind, method))
