"""Planners as the page calls them: their progress rises as they go on, and they can be cancelled anywhere."""

from __future__ import annotations

from contextlib import closing
from itertools import pairwise

import pytest

from app.compute import plan_service
from app.compute.map_service import MapService
from app.compute.plan_service import FIRST, PLANS_PER_BATCH, MotionRequest, PlanRequest, PlanService
from app.state.plans.plan_results import PlanKind
from symgrasp.errors import Cancelled, NoPlanError
from symgrasp.planners.planning import plan_sequential
from symgrasp.scene.scene import load_scene
from tests.app.caught import caught_content
from tests.conftest import load_small

CASES: list[tuple[str, PlanKind, str, str]] = [
    ("pick_pour_place", "sequential", "best", "panda"),
    ("pick_pour_place", "sequential", "first", "panda"),
    ("pick_pour_place", "sequential", "regrasp", "panda"),
    ("log_two_robots", "bimanual", "exact", "lift"),
    ("log_two_robots", "bimanual", "hill_climb", "lift"),
    ("log_four_robots", "bimanual", "exact", "lift"),
    ("handover_between_robots", "handover", "", ""),
]


def request_of(name: str, kind: PlanKind, method: str, who: str) -> PlanRequest:
    return PlanRequest(load_small(name, 16, 24, 8), kind, method, who, seed=39)


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_progress_rises_and_is_over_when_the_plans_are_there(case):
    shares: list[float] = []
    request = request_of(*case)
    with closing(MapService()) as maps, closing(PlanService(maps, ())) as service:
        assert service.plan(request, {}, shares.append).plans
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] < 0.2
    assert shares[-1] <= 1.0
    # What comes after the maps moves as well, where it is more than one search.
    after = {share for share in shares if share > len(request.maps) / (len(request.maps) + 1)}
    assert len(after) > 5 or case[2] in ("first", "regrasp", "hill_climb")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_a_planner_ends_where_it_is_cancelled_and_plans_again(case, share):
    request, told = request_of(*case), []

    def progress(now: float) -> None:
        told.append(now)
        if now >= share:
            raise Cancelled

    with closing(MapService()) as maps, closing(PlanService(maps, ())) as service:
        with pytest.raises(Cancelled):
            service.plan(request, {}, progress)
        assert [now >= share for now in told] == [False] * (len(told) - 1) + [True]  # it went on no further
        assert service.plan(request, {}, lambda _: None).plans


@pytest.mark.parametrize("listed", [1, 5, 9])
def test_listing_ends_where_it_is_cancelled_between_two_plans(listed):
    """What a planner tries between two plans may take long; it asks there as well."""
    request = request_of("handover_between_robots", "handover", "", "")
    told: list[float] = []
    with closing(MapService()) as maps, closing(PlanService(maps, ())) as service:
        service.plan(request, {}, told.append)
    share = sorted(set(told))[listed - PLANS_PER_BATCH - 1]
    again: list[float] = []

    def progress(now: float) -> None:
        again.append(now)
        if again.count(share) == 2:  # once with the plan, and then while the next one is sought
            raise Cancelled

    with (
        closing(MapService()) as maps,
        closing(PlanService(maps, ())) as service,
        pytest.raises(Cancelled),
    ):
        service.plan(request, {}, progress)
    assert max(again) == again[-1] == share


def test_one_may_cancel_between_the_prints_of_tasks_and_their_gaps(monkeypatch):
    scene = load_small("pick_pour_place", 16, 24, 8)
    events: list[str] = []
    for name in ("_print", "_gap"):
        step = getattr(plan_service, name)
        monkeypatch.setattr(
            plan_service, name, lambda *given, step=step: (events.append("step"), step(*given))[1]
        )
    plan_service.plan_result(plan_sequential(scene), scene, lambda: events.append("told"))
    assert events == ["told", "step"] * 2 * 3  # a print and a gap for each of three tasks


def test_the_progress_of_a_motion_rises_over_all_plans_that_have_none():
    scene = load_scene(caught_content())
    with closing(MapService()) as maps, closing(PlanService(maps, ())) as service:
        found = service.plan(PlanRequest(scene, "sequential", "best", "panda"), {}, lambda _: None)
        plans = tuple(result.plan for result in found.plans[:3])
        shares: list[float] = []
        with pytest.raises(NoPlanError, match=r"no motion: plan.*: the reach of panda to pick: no way"):
            service.motion(MotionRequest(scene, {}, plans), shares.append)
        assert shares == sorted(shares)
        for low, high in pairwise((0.0, FIRST, (1 + FIRST) / 2, 1.0)):  # it moves while each is tried
            assert len({share for share in shares if low <= share < high}) > 1
        told = []

        def progress(share: float) -> None:
            told.append(share)
            if share > FIRST:
                raise Cancelled

        with pytest.raises(Cancelled):
            service.motion(MotionRequest(scene, {}, plans), progress)
        assert [share > FIRST for share in told] == [False] * (len(told) - 1) + [True]  # no further
