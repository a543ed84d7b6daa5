"""Plans are tried in their order: the first one with a motion is chosen, or the fastest of the first few."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from symgrasp.motion import choosing
from symgrasp.motion.choosing import Failure, best_motion, moving_plans
from symgrasp.motion.paths.search import NoMotionError
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import sequential_plans
from tests.conftest import load_small
from tests.motion.recorded import recorded_plan


def test_the_fastest_of_the_first_few_is_chosen():
    scene = load_small("pick_pour_place", 12, 24, 8)
    failures: list[Failure] = []
    pairs = moving_plans(scene, sequential_plans(scene), failures)
    first = [next(pairs) for _ in range(4)]
    pairs.close()
    durations = [motion.duration for _, motion in first]
    best = 1 + durations[1:].index(min(durations[1:]))
    assert durations[best] < durations[0]  # so that it matters how many are compared
    for count in range(1, len(first) + 1):
        plan, _ = best_motion(scene, sequential_plans(scene), best=count)
        expected = min(durations[:count])
        assert plan.motion
        assert plan.motion.duration == expected
        fastest, _ = first[durations.index(expected)]
        assert [task.holds[0].grasp for task in plan.tasks] == [t.holds[0].grasp for t in fastest.tasks]


class StubPlanner:
    """Finds a motion of every third plan."""

    def __init__(self, *_: object) -> None:
        self.asked = 0

    def plan(self, plan: object, *_: object) -> tuple[object, None]:
        self.asked += 1
        if self.asked % 3:
            raise NoMotionError(f"the carry meets crate {self.asked}")
        return plan, None


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[Plan]:
    """Have every third plan have a motion; holds the plans that were made so far."""
    monkeypatch.setattr(choosing, "MotionPlanner", StubPlanner)
    monkeypatch.setattr(choosing, "timed", lambda motion, progress: motion)
    return []


def made(tried: list[Plan], count: int) -> Generator[Plan]:
    for _ in range(count):
        tried.append(recorded_plan().model_copy())
        yield tried[-1]


def test_plans_are_tried_in_their_order_up_to_the_first_with_a_motion(tried):
    failures: list[Failure] = []
    pairs = moving_plans(load_small("soda_can"), made(tried, 10), failures)
    plan, _ = next(pairs)
    pairs.close()
    assert len(tried) == 3
    assert plan is tried[-1]
    assert failures == [Failure(1, "the carry meets crate 1"), Failure(2, "the carry meets crate 2")]


def test_where_none_has_a_motion_it_is_said_why_of_each(tried):
    with pytest.raises(
        NoMotionError, match=r"plan 1: the carry meets crate 1; plan 2: the carry meets crate 2"
    ):
        best_motion(load_small("soda_can"), made(tried, 2))
