"""Whole motions of two-armed robots, and one with an object set down and grasped anew, all verified."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import pytest

from symgrasp.motion.choosing import best_motion
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.conflicts import ConflictError
from symgrasp.planners.planning import plan_sequential, regrasp_plans, sequential_maps
from symgrasp.scene.scene import Scene
from tests.conftest import some

DATA = Path(__file__).parent.parent / "data"


@pytest.mark.parametrize(
    ("name", "arms", "redundancy"),
    some(1, [("log_two_humanoids", 4, "auto"), ("log_two_gr3", 4, 16), ("tiago_dual_tray", 2, 16)]),
)
def test_all_hands_of_humanoids_take_an_object_together_and_lift_it(name, arms, redundancy):
    """The plans are the best ones of shipped scenes, whose maps take long.

    An arm reaches for the object beside others where there is room.
    """
    path = DATA / f"plan_{name}.json"
    plan = Plan.parse(path.read_text(encoding="utf-8"), str(path))
    scene = Scene.from_content(plan.scene.content)
    assert scene.file == Scene.load(name).with_settings(redundancy=redundancy).file
    found, failures = best_motion(scene, (plan for plan in [plan]))
    assert failures == []
    assert found.motion
    segments = found.motion.segments
    kinds = [kind for kind, _ in groupby(segment.kind for segment in segments)]
    assert kinds == ["open", "reach", "approach", "close", "lift"]
    hands = {hold.arm for hold in plan.tasks[0].holds}
    assert len(hands) == arms
    assert all(hands == set(s.joints) for s in segments if s.kind != "reach")
    assert hands == set(segments[-1].held_by)
    report = verify(found)
    assert report, report.failures


def test_an_object_is_set_down_and_grasped_anew_where_no_grasp_serves_all_tasks():
    """A crate hides its lower half where it is fetched, and a hood the upper one where it is stored."""
    scene = Scene.load(str(DATA / "crate_and_hood.yaml"))
    maps = sequential_maps(scene)
    with pytest.raises(ConflictError):
        plan_sequential(scene, maps=maps)
    plan, _ = best_motion(scene, regrasp_plans(scene, maps=maps))
    assert [task.name for task in plan.tasks] == ["fetch", "stand", "stand", "store"]
    first, last = (plan.tasks[k].holds[0].grasp for k in (0, -1))
    assert first.h > 0.14 > last.h
    assert [task.holds[0].grasp for task in plan.tasks] == [first, first, last, last]
    assert plan.motion
    take, leave = (
        ["open", "reach", "approach", "close", "lift", "carry", "lower"],
        ["open", "retreat", "home"],
    )
    kinds = [kind for kind, _ in groupby(segment.kind for segment in plan.motion.segments)]
    assert kinds == [*take, *leave, *take[1:], *leave]
    report = verify(plan)
    assert report, report.failures
