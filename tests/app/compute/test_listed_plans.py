"""Listing plans part by part, also until one has a motion."""

# A plan or a climb may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from app.compute import plan_service
from app.compute.map_service import MapService
from app.compute.plan_service import PLANS_PER_BATCH, SEARCH, MotionRequest, PlanRequest
from app.state import changes
from app.state.plans import plan_changes
from app.state.plans.plan_results import PlanResults
from app.state.state import State
from symgrasp.errors import Cancelled, NoPlanError
from symgrasp.motion.choosing import Failure
from symgrasp.planners.planning import sequential_plans
from symgrasp.scene.scene import Scene
from tests.app.state.states import results_of, with_plan
from tests.conftest import load_small

DATA = Path(__file__).parents[2] / "data"


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def test_all_solutions_are_listed_part_by_part_each_once(plans, monkeypatch):
    monkeypatch.setattr(plan_service, "PLANS_PER_BATCH", 3)
    scene = load_small("pick_pour_place", heights=24)
    request, service = PlanRequest(scene, "sequential", "best", "panda"), MapService()
    maps, _ = service.maps(request.maps, {}, quiet)
    service.close()
    plan_results = plans.plan(request, maps, quiet).added_to(PlanResults(), maps)
    assert (len(plan_results.plans), plan_results.more) == (3, True)
    state = plan_changes.show_results(State.of(scene, ""), plan_results)
    shown = state.plan
    while state.plan_results.more:
        state = plan_changes.more_listed(state, *plans.more(quiet))
        assert state.plan is shown
    grasps = [
        (p.plan.tasks[0].holds[0].grasp.h, p.plan.tasks[0].holds[0].grasp.roll)
        for p in state.plan_results.plans
    ]
    allowed = np.logical_and.reduce([r.map.feasible.any(axis=2) for r in state.plan_results.maps.values()])
    assert len(grasps) == len(set(grasps)) == allowed.sum()
    first = plan_changes.choose_plan(state, 0)
    assert first.plan is plan_results.plans[0]
    assert (first.pick.h, first.step) == (grasps[0][0], 0)


def test_no_common_grasp_is_told_with_what_would_help(plans):
    scene = load_small("pick_pour_place")
    state = changes.moved(changes.choose_task(State.of(scene, ""), "pour"), z=1.2)
    order = PlanRequest(scene, "sequential", "best", "panda", state.poses)
    plan_results = results_of(order)
    assert plan_results.plan is None
    assert plan_results.refusal.conflict.exclusions[0].tasks == ("pour",)
    assert set(plan_results.maps) == {(task, "panda") for task in scene.tasks}
    shown = plan_changes.show_results(state, plan_results)
    assert shown.task == "pour"
    assert shown.problem == ""
    assert changes.moved(shown, x=0.5).plan_results.refusal is None


def test_plans_are_tried_beyond_the_list_until_one_has_a_motion(plans, monkeypatch):
    """They are listed up to that one, and the rest when more are asked for."""
    scene = load_small("bottle_on_table")
    batch = 3
    monkeypatch.setattr(plan_service, "PLANS_PER_BATCH", batch)
    every = list(islice(sequential_plans(scene, "panda"), 4 * batch))
    assert len(every) == 4 * batch

    def moving(last: int) -> None:
        def moving_plans(scene, plans, failures, progress):
            for number, plan in enumerate(plans, start=1):
                if number > last:
                    yield plan, None
                    return
                failures.append(Failure(number, f"no way for {number}"))
                if number == batch + 5:
                    raise Cancelled

        monkeypatch.setattr(plan_service, "moving_plans", moving_plans)

    monkeypatch.setattr(plan_service, "with_motion", lambda plan, motion: plan)
    outcome = plans.plan(PlanRequest(scene, "sequential", "", "panda"), {}, quiet)
    shown = tuple(result.plan for result in outcome.plans)
    assert list(shown) == every[:batch]
    moving(1000)
    with pytest.raises(Cancelled):
        plans.motion(MotionRequest(scene, {}, shown, more=True), quiet)
    moving(batch + 2)
    found = plans.motion(MotionRequest(scene, {}, shown, more=True), quiet)
    assert (found.index, found.plan) == (batch + 2, every[batch + 2])
    assert found.failures[-1] == f"no way for {found.index}"
    assert [result.plan for result in found.listed] == every[batch : found.index + 1]
    later, more = plans.more(quiet)
    assert more
    assert [result.plan for result in later] == every[found.index + 1 :][:batch]
    moving(1)
    alone = plans.motion(MotionRequest(scene, {}, shown[1:], more=True), quiet)
    assert (alone.index, alone.plan, alone.listed) == (1, shown[2], ())
    moving(batch)
    with pytest.raises(NoPlanError, match="no way for 3"):
        plans.motion(MotionRequest(scene, {}, shown, more=False), quiet)


def test_further_plans_are_listed_with_the_one_that_has_a_motion():
    state = with_plan("bottle_on_table", "sequential")
    results = state.plan_results
    count = len(results.plans)
    found = plan_changes.motion_found(state, count + 1, results.plans[1].plan, ("a", "b"), results.plans[:2])
    assert found.plan_results.plans[:count] == results.plans
    assert (len(found.plan_results.plans), found.plan_results.index) == (count + 2, count + 1)
    assert found.plan_results.more == results.more


def test_all_plans_with_the_fewest_regrasps_are_listed(plans):
    scene = Scene.load(str(DATA / "crate_and_hood.yaml"))
    outcome = plans.plan(PlanRequest(scene, "sequential", "regrasp", "panda"), {}, quiet)
    assert len(outcome.plans) == PLANS_PER_BATCH
    assert all(len(result.plan.tasks) == 4 for result in outcome.plans)


@pytest.mark.parametrize(
    ("name", "kind", "method"),
    [
        ("pick_pour_place", "sequential", "best"),
        ("log_two_robots", "bimanual", "exact"),
        ("log_two_robots", "bimanual", "hill_climb"),
    ],
)
def test_the_progress_of_a_planner_is_at_its_end_when_all_is_listed(plans, name, kind, method):
    scene, shares = load_small(name, heights=24), []
    request = PlanRequest(scene, kind, method, "panda" if kind == "sequential" else "lift")
    service = MapService()
    maps, _ = service.maps(request.maps, {}, quiet)
    service.close()
    outcome = plans.plan(request, maps, shares.append)
    assert outcome.plans
    assert shares == sorted(shares)
    parts = len(request.maps) + 1  # the maps come first
    if method != "hill_climb":
        # Each value comes once with a plan, and then again while the next one is sought.
        listed = {share for share in shares if parts * (share - 1) + 1 > SEARCH + 1e-9}
        assert len(listed) == len(outcome.plans)
