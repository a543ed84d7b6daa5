"""Planners and motions may be cancelled between the parts of what they load, not only while they search."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest

from symgrasp.errors import Cancelled
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.exact.engine import ExactEngine
from symgrasp.planners.planning import bimanual_plans, plan_bimanual
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.world import bodies, bullet
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
