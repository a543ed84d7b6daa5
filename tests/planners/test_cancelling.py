"""Planners and motions may be cancelled between the parts of what they load, not only while they search."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from symgrasp.errors import Cancelled
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.exact import engine
from symgrasp.feasibility.exact.engine import ExactEngine
from symgrasp.feasibility.exact.open_candidates import OpenCandidates
from symgrasp.planners.planning import bimanual_plans, plan_bimanual
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.survey.success import PoseNoise, success_map
from symgrasp.world import bodies, bullet, open_world
from tests.conftest import load_small

CALLS: dict[str, Callable[[Scene, Progress], object]] = {
    "map": lambda scene, progress: create_map(scene, progress=progress),
    "complete search": lambda scene, progress: next(iter(bimanual_plans(scene, progress=progress))),
    "hill climbing": lambda scene, progress: plan_bimanual(scene, method="hill_climb", progress=progress),
}


@pytest.fixture
def events(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Note what takes its time when a world and engines are made, as it ends."""
    noted: list[str] = []

    def note(owner: object, name: str) -> None:
        made = getattr(owner, name)

        def noting(*arguments: object, **options: object) -> object:
            found = made(*arguments, **options)
            noted.append(name)
            return found

        monkeypatch.setattr(owner, name, noting)

    note(bodies, "load_urdf")
    note(bullet, "arm_queries")
    note(ExactEngine, "__init__")
    return noted


@pytest.mark.parametrize("name", CALLS)
def test_one_may_cancel_between_robots_arms_and_engines(events, name):
    scene = load_small("log_two_robots")
    CALLS[name](scene, lambda _: events.append("told"))
    work = [event for event in events if event != "told"]
    arms = 1 if name == "map" else 2
    assert sorted(work) == sorted(["load_urdf"] * 2 + ["arm_queries"] * 2 + ["__init__"] * arms)
    in_a_row = [(a, b) for a, b in pairwise(events) if "told" not in (a, b)]
    assert in_a_row == []


@pytest.mark.parametrize("name", CALLS)
def test_it_ends_at_once_where_it_is_cancelled(events, name):
    def cancel(_: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        CALLS[name](load_small("log_two_robots"), cancel)
    assert events == []


def test_windows_that_pybullet_settles_may_be_cancelled_before_every_question(monkeypatch):
    scene = load_small("pick_pour_place")
    events: list[str] = []
    ask: Callable[..., bool] = OpenCandidates.is_free

    def asked(*arguments: object) -> bool:
        events.append("asked")
        return ask(*arguments)

    monkeypatch.setattr(OpenCandidates, "is_free", asked)
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map()
        told: list[float] = []

        def tell(share: float) -> None:
            told.append(share)
            events.append("told")

        maker.windows(m, np.argwhere(m.feasible), tell)
    assert events.count("asked") > 20
    questions = "".join(event[0] for event in events)
    assert "aa" not in questions
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_one_may_cancel_between_the_heights_at_which_a_hand_fits(events, monkeypatch):
    asked = engine.fit

    def noting(*arguments: Any) -> Any:
        events.append("fit")
        return asked(*arguments)

    monkeypatch.setattr(engine, "fit", noting)
    with open_world(load_small("bottle_on_table", 9)) as world:
        MapMaker(world).map(progress=lambda _: events.append("told"))
    assert events.count("fit") == 9
    assert ("fit", "fit") not in pairwise(events)


def test_probabilities_may_be_cancelled_in_the_map_of_the_pose_that_is_expected(events):
    def cancel(_: float) -> None:
        raise Cancelled

    with open_world(load_small("bottle_on_table")) as world:
        opened = list(events)
        task = world.scene.task()
        with pytest.raises(Cancelled):
            success_map(MapMaker(world), task.arms[0], task, PoseNoise(0.01), 1, progress=cancel)
    assert events == opened  # no engine
