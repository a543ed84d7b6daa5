"""Motions may be cancelled within every proof and search, and do not depend on where that would be."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from symgrasp.errors import Cancelled
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.paths import search
from symgrasp.motion.planning import plan_motion
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import load_small

COMPILED = ("clearances", "grow", "shorten", "drop_points")
PLANS: dict[str, Callable[[Scene], Any]] = {
    "pick_pour_place": plan_sequential,
    "log_two_robots": plan_bimanual,
}


def cancel(_: float) -> None:
    raise Cancelled


@pytest.fixture
def events(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Note calls of compiled code."""
    noted: list[str] = []

    def note(name: str) -> None:
        call = getattr(search, name)

        def noting(*arguments: object) -> object:
            noted.append(name)
            return call(*arguments)

        monkeypatch.setattr(search, name, noting)

    for name in COMPILED:
        note(name)
    return noted


@pytest.mark.parametrize("name", PLANS)
def test_one_may_cancel_between_any_two_calls_of_compiled_code(events, name):
    scene = load_small(name, 12, 24, 8)
    plan = PLANS[name](scene)
    _, motion = plan_motion(scene, plan, progress=lambda _: events.append("told"))
    assert {"told", *COMPILED} == set(events)
    assert [(a, b) for a, b in pairwise(events) if "told" not in (a, b)] == []
    _, again = plan_motion(scene, plan)
    assert len(again.segments) == len(motion.segments)
    for a, b in zip(motion.segments, again.segments, strict=True):
        assert a.kind == b.kind and a.clearance == b.clearance
        assert all(np.array_equal(a.joints[arm], b.joints[arm]) for arm in a.arms)


@pytest.fixture
def free() -> tuple[Situation, Array]:
    """An arm that moves alone, and its configuration."""
    scene = load_small("bottle_on_table")
    arm = scene.arm(scene.task().arms[0])
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        home = bodies.home()
        return bodies.situation(home, [arm]), home.joints(arm)


def test_a_proof_of_many_lines_is_cancelled_after_the_first(events, free, monkeypatch):
    situation, home = free
    lines, prove = [], search.clearances
    monkeypatch.setattr(search, "clearances", lambda *given: (lines.append(len(given[4])), prove(*given))[1])
    rows = np.tile(home, (500, 1))
    with pytest.raises(Cancelled):
        search.prove(situation, rows, rows, progress=cancel)
    assert lines == [1]
    assert search.prove(situation, rows, rows).free.all()


def test_a_path_is_no_longer_shortened_once_it_is_cancelled(events, free):
    situation, home = free
    away = home.copy()
    away[0] += 0.5
    rows = np.array([home, home + 0.1, home - 0.1, away])
    path = search.FoundPath(situation, rows, np.array([1], dtype=np.uint64))
    with pytest.raises(Cancelled):
        search.shortened(path, cancel)
    assert events == ["shorten"]
