"""The check of a plan may be cancelled between the grasps, maps and states of a motion that it looks at."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from symgrasp.errors import Cancelled
from symgrasp.feasibility.candidates import CandidateChecker, CheckResult
from symgrasp.feasibility.create import MapMaker
from symgrasp.motion.choosing import best_motion
from symgrasp.plan import check_margins
from symgrasp.plan.check_motion_states import _NearBodies
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from symgrasp.poses import Array
from symgrasp.reason import Reason
from tests.conftest import load_small


@pytest.fixture
def events() -> list[str]:
    return []


def note(
    monkeypatch: pytest.MonkeyPatch, owner: type, name: str, events: list[str], event: Callable[..., str]
) -> None:
    """Note calls of a method."""
    call = getattr(owner, name)

    def noting(*arguments: object, **options: object) -> object:
        events.append(event(options))
        return call(*arguments, **options)

    monkeypatch.setattr(owner, name, noting)


def untold(events: list[str]) -> list[tuple[str, str]]:
    """Return the events between which one could not cancel."""
    return [(a, b) for a, b in pairwise(events) if "told" not in (a, b)]


@pytest.fixture(scope="module")
def moving() -> Plan:
    scene = load_small("soda_can", 8, 16, 8)

    def plans() -> Any:
        yield plan_sequential(scene)

    return best_motion(scene, plans())[0]


def test_states_of_a_motion_are_looked_at_one_by_one(monkeypatch, events, moving):
    note(monkeypatch, _NearBodies, "too_close", events, lambda _: "state")
    shares: list[float] = []

    def tell(share: float) -> None:
        shares.append(share)
        events.append("told")

    assert verify(moving, tell)
    assert events.count("state") > 50
    assert untold(events) == []
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_grasps_within_margins_are_looked_at_one_by_one(monkeypatch, events):
    plan = plan_sequential(load_small("soda_can", 8, 16, 8))
    note(monkeypatch, CandidateChecker, "check", events, lambda _: "check")
    assert verify(plan, lambda _: events.append("told"))
    assert events.count("check") > 5
    assert untold(events) == []


class SamplesAreNotFree(CandidateChecker):
    """Finds nothing free at the samples of a map's redundancy, so the values between them are tried."""

    def check(self, T_base_tool: Array, q: Array, sample: int, opening: float) -> CheckResult:
        found = super().check(T_base_tool, q, sample, opening)
        known = len(self.ik.phi) > self.world.scene.settings.samples
        return found if known else found._replace(reason=Reason.SCENE_COLLISION)


def test_maps_that_grasps_between_samples_are_found_with_may_be_cancelled(monkeypatch, events):
    scene = load_small("log_two_robots").with_settings(redundancy="auto")
    plan = plan_bimanual(scene)
    monkeypatch.setattr(check_margins, "CandidateChecker", SamplesAreNotFree)
    note(monkeypatch, MapMaker, "map", events, lambda given: "map" if given.get("progress") else "map untold")
    assert verify(plan, lambda _: events.append("told"))
    assert "map" in events and "map untold" not in events

    def cancel_in_a_map(_: float) -> None:
        if "map" in events:
            raise Cancelled

    events.clear()
    with pytest.raises(Cancelled):
        verify(plan, cancel_in_a_map)
    assert events == ["map"]
