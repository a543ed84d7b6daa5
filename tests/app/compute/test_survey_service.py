"""What a survey of the page finds is what a map, or a plan, of each place says."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from app.compute import survey_service
from app.compute.survey_service import SurveyPart, SurveyService
from app.state.object_pose import ObjectPose
from app.state.surveys.survey import SurveyRequest
from symgrasp.errors import Cancelled
from symgrasp.feasibility.create import create_map
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_sequential
from symgrasp.scene.replacing import with_base
from symgrasp.survey import placement
from symgrasp.survey.evaluation import State
from tests.conftest import load_small


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    monkeypatch.setattr(survey_service, "COARSE", (6, 16, 4))
    monkeypatch.setattr(survey_service, "INTERVAL", 0.0)


def test_every_place_of_the_object_has_the_share_of_its_map():
    scene = load_small("bottle_on_table", 6, 16, 4)
    poses = {"pick": ObjectPose(0.5, 0.1, 0.0)}
    request = SurveyRequest(scene, poses, "pick", "panda", "object", 0.3)
    parts: list[SurveyPart] = []
    assert SurveyService(parts.append).survey(request, lambda _: None) == ()
    places = parts[-1].places
    assert parts[-1].points == parts[-1].of == len(places.xy) > 8
    assert [len(part.places.xy) for part in parts[:-1]] == list(range(1, len(parts)))
    assert {State.COMPUTED, State.OBJECT_BLOCKED} == set(places.state.tolist())
    for k in np.flatnonzero(places.state == State.COMPUTED)[::3]:
        x, y = places.xy[k].tolist()
        T = replace(poses["pick"], x=x, y=y).matrix()
        m = create_map(scene.with_task(replace(scene.task(), T_world_object=T)))
        assert places.share[k] == m.feasible.mean()
        assert np.isfinite(places.plan[k]) == m.feasible.any()  # one task alone: a plan wherever a grasp is
    for before, after in pairwise(parts):  # a click means what was drawn
        assert np.array_equal(after.places.xy[: len(before.places.xy)], before.places.xy)


def test_the_best_bases_are_where_plans_hold(monkeypatch):
    monkeypatch.setattr(placement, "ROUNDS", 1)
    monkeypatch.setattr(placement, "SEEDS", 1)
    monkeypatch.setattr(placement, "TURN", 360.0)
    scene = load_small("pick_pour_place", 6, 16, 4)
    request = SurveyRequest(scene, {}, "pick", "panda", "robot", 0.4)
    parts: list[SurveyPart] = []
    stands = SurveyService(parts.append).survey(request, lambda _: None)
    places = parts[-1].places
    assert 0 < len(stands) <= survey_service.STANDS
    assert len({stand.base[:2] for stand in stands}) == len(stands)
    assert len(places.bases) == len(places.xy)
    assert places.size.min() < places.size.max()
    for stand in stands:
        moved = with_base(scene, "panda", stand.base.moved(scene.robots["panda"].T_world_base))
        plan = plan_sequential(moved)
        assert verify(plan)
        margins = [
            min(h.margin_along, h.margin_around * float(moved.profile.radius(h.grasp.h)))
            for task in plan.tasks
            for h in task.holds
        ]
        assert stand.margin == pytest.approx(min(margins))
    (best,) = np.flatnonzero((places.xy == stands[0].base[:2]).all(axis=1))
    assert places.plan[best] == pytest.approx(np.nanmax(places.plan))
    assert all(tuple(xy) == base[:2] for xy, base in zip(places.xy.tolist(), places.bases, strict=True))


def test_a_survey_can_be_cancelled():
    scene = load_small("bottle_on_table", 6, 16, 4)
    request = SurveyRequest(scene, {}, "pick", "panda", "object", 0.1)
    parts: list[SurveyPart] = []

    def cancel(share: float) -> None:
        if share > 0.05:
            raise Cancelled

    with pytest.raises(Cancelled):
        SurveyService(parts.append).survey(request, cancel)
    assert 0 < parts[-1].points < parts[-1].of
