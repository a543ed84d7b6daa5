"""Several arms take an object, carry it and let go of it at once, or in turn where there is no room."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache

import numpy as np
import pytest

from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.choosing import best_motion
from symgrasp.motion.drafting import taking
from symgrasp.motion.paths.search import NoMotionError
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import handover_plans, plan_bimanual
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from tests.conftest import load_small

ARMS = ("left", "right")


@cache
def moved_log() -> Scene:
    """Return a scene in which two arms move a log that lies on a trestle along it."""
    content = load_small("log_two_robots", 20, 24, 6).content
    tasks = [
        {"name": name, "arms": [*ARMS], "pose": {"position": [x, 0.0, 0.4351], "rpy_deg": [0, 90, 0]}}
        for name, x in (("here", -0.5), ("there", -0.44))
    ]
    return Scene.from_content({**content, "tasks": tasks})


def parts(plan: Plan) -> list[tuple[str, tuple[str, ...]]]:
    assert plan.motion
    return [(segment.kind, tuple(segment.joints)) for segment in plan.motion.segments]


def test_arms_take_move_and_leave_an_object_together():
    plan, _ = best_motion(moved_log(), handover_plans(moved_log()))
    taken, carried = ("open", "reach", "approach", "close"), ("lift", "carry", "lower")
    assert parts(plan) == [(kind, ARMS) for kind in (*taken, *carried, "open", "retreat", "home")]
    report = verify(plan)
    assert report, report.failures


@pytest.mark.parametrize("load", [lambda: load_small("log_two_robots", 20, 24, 6), moved_log])
def test_arms_go_in_turn_where_there_is_no_room_for_them_at_once(load, monkeypatch):
    """Everything in which several arms would move to or from the object is called blocked."""
    free_together = taking._free_together

    def no_room(
        situation: Situation, lines: Mapping[str, Sequence[Array]], progress: Progress | None
    ) -> Iterator[dict[str, Array]]:
        if len(lines) > 1:
            raise NoMotionError("no room")
        return free_together(situation, lines, progress)

    monkeypatch.setattr(taking, "_free_together", no_room)
    scene = load()
    plans = handover_plans(scene) if len(scene.tasks) > 1 else (plan for plan in [plan_bimanual(scene)])
    found, _ = best_motion(scene, plans)
    taken, left = ("open", "reach", "approach", "close"), ("open", "retreat", "home")
    own = [part for part in parts(found) if part[0] not in ("lift", "carry", "lower")]
    turns = [(kind, (name,)) for name in ARMS for kind in taken]
    if len(scene.tasks) > 1:
        turns += [(kind, (name,)) for name in ARMS for kind in left]
    assert own == turns
    report = verify(found)
    assert report, report.failures


def test_arms_reach_in_turn_where_only_that_has_room(monkeypatch):
    """The arms wait for each other before the straight approach."""
    free_together = taking._free_together

    def no_room(
        situation: Situation, lines: Mapping[str, Sequence[Array]], progress: Progress | None
    ) -> Iterator[dict[str, Array]]:
        at_home = [len(paths) == 1 and np.ptp(paths[0], axis=0).max() > 0.5 for paths in lines.values()]
        if len(lines) > 1 and all(at_home):
            raise NoMotionError("no room")
        return free_together(situation, lines, progress)

    monkeypatch.setattr(taking, "_free_together", no_room)
    scene = load_small("log_two_robots", 20, 24, 6)
    found, _ = best_motion(scene, (plan for plan in [plan_bimanual(scene)]))
    reaches = [("reach", (name,)) for name in ARMS]
    assert parts(found) == [("open", ARMS), *reaches, ("approach", ARMS), ("close", ARMS), ("lift", ARMS)]
    report = verify(found)
    assert report, report.failures


@pytest.mark.parametrize("arms", [1, 2, 4])
def test_paths_that_are_nearly_the_best_are_combined_for_every_arm(arms):
    """However many paths the others have."""
    lines = {f"arm {k}": [np.full((2, 1), rank) for rank in range(200)] for k in range(arms)}
    tried = [tuple(int(path[0, 0]) for path in chosen.values()) for chosen in taking.combinations(lines)]
    assert all(list(chosen) == list(lines) for chosen in taking.combinations(lines))
    assert len(tried) == len(set(tried)) == taking.COMBINATIONS
    assert tried[0] == (0,) * arms
    assert [sum(ranks) for ranks in tried] == sorted(sum(ranks) for ranks in tried)
    for column in np.array(tried).T:
        assert {0, 1, 2} <= {*column.tolist()}
    few = {"a": lines["arm 0"][:2], "b": lines["arm 0"][:3]}
    assert len(list(taking.combinations(few))) == 6


def test_paths_at_equal_shares_have_the_rows_of_all():
    a, b = np.array([[0.0, 1.0], [2.0, 1.0], [3.0, 0.0]]), np.array([[5.0], [6.0], [6.0], [4.0]])
    ways = taking._at_equal_shares({"a": a, "b": b})
    shares = [0, 1 / 3, 1 / 2, 2 / 3, 1]
    np.testing.assert_allclose(
        ways["a"], [[0, 1], [4 / 3, 1], [2, 1], [7 / 3, 2 / 3], [3, 0]], rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(ways["b"], [[5], [6], [6], [6], [4]], rtol=0, atol=1e-11)
    assert len(ways["a"]) == len(shares)
    for path, way in ((a, ways["a"]), (b, ways["b"])):
        np.testing.assert_array_equal(way[[0, -1]], path[[0, -1]])
