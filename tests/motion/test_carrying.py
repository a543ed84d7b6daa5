"""The object is carried between all configurations of its grasp, and tilts no further than the scene says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from symgrasp.ik import solver_for
from symgrasp.motion.drafting import carrying, draft
from symgrasp.motion.drafting.carrying import tilt_limit
from symgrasp.motion.drafting.ways import LIFT
from symgrasp.motion.paths.lines import Leg, LineTree, configurations
from symgrasp.motion.paths.search import NoMotionError
from symgrasp.motion.planning import plan_motion
from symgrasp.planners.planning import plan_sequential
from symgrasp.poses import Array, pose_error, translation
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import load_small

NEAR = 1e-3
"""Distance (m) within which a proof may refuse what PyBullet finds free."""


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Array, Array]]:
    """Note the starts and goals of all carries."""
    noted: list[tuple[Array, Array]] = []
    connect = carrying.connect

    def noting(situation: Any, starts: Array, goals: Array, *rest: Any) -> Array:
        noted.append((starts, goals))
        return connect(situation, starts, goals, *rest)

    monkeypatch.setattr(carrying, "connect", noting)
    return noted


def test_a_carry_may_begin_and_end_in_every_configuration_of_the_grasp(ends):
    """Of all redundancy values and branches, those at which PyBullet finds arm and object free."""
    scene = load_small("pick_pour_place", 12, 24, 8)
    plan = plan_sequential(scene)
    plan_motion(scene, plan)
    (starts, goals), _ = ends
    pick, pour = plan.tasks[:2]
    hold, arm = pour.holds[0], scene.arm()
    opening = 2 * float(scene.profile.radius(hold.grasp.h))
    expected = []
    with open_world(scene) as world:
        for q in configurations(solver_for(arm, 8), hold.tool_pose.array()):
            world.set_robot(arm.robot.name, arm.robot_values(q, opening))
            world.set_object(pour.object_pose_turned.array())
            gap = min(
                world.clearance(arm, 0.05), *(0.05 - c.depth for c in world.object_contacts(0.05)), 0.05
            )
            expected += [q] if gap > NEAR else []
            there = np.abs(goals - q).max(axis=1).min() < 1e-9
            assert there == (gap > 0) or abs(gap) <= NEAR
    assert len(expected) > 1
    lifted = translation([0, 0, LIFT]) @ pick.holds[0].tool_pose.array()
    assert len(starts) > 1
    assert max(float(error.max()) for error in pose_error(arm.world_tool_pose(starts), lifted)) < 1e-6


def test_straight_ways_out_of_all_tasks_are_looked_at_before_free_motions(ends, monkeypatch):
    """Where the last one has none, no free motion is sought."""
    scene = load_small("pick_pour_place", 12, 24, 8)
    plan = plan_sequential(scene)
    place = plan.tasks[-1].holds[0].tool_pose.array()
    follow = draft.follow

    def blocked(legs: Sequence[Leg], *rest: Any, **more: Any) -> LineTree:
        if np.allclose(legs[-1].poses[-1], place, atol=1e-6):
            raise NoMotionError("a wall")
        return follow(legs, *rest, **more)

    monkeypatch.setattr(draft, "follow", blocked)
    with pytest.raises(NoMotionError, match="the carry from pour to place: its end: a wall"):
        plan_motion(scene, plan)
    assert ends == []
    monkeypatch.setattr(draft, "follow", follow)
    plan_motion(scene, plan)
    assert len(ends) == 2


def test_a_limit_between_two_tasks_goes_before_that_for_all():
    content = load_small("pick_pour_place", 12, 24, 8).content
    carry = [{"tilt_deg": 120}, {"tasks": ["pick", "pour"], "tilt_deg": 130}]
    plan = plan_sequential(Scene.from_content(content))
    pick, pour, place = plan.tasks

    def largest(carry: object) -> list[float]:
        scene = Scene.from_content({**content, "carry": carry})
        limits = [tilt_limit(scene, pick, pour), tilt_limit(scene, pour, place)]
        return [round(float(np.rad2deg(limit.largest + limit.kept)), 6) for limit in limits]

    assert largest(carry) == [130, 120]
    assert largest(carry[1:]) == [130, np.inf]
    assert largest({"tilt_deg": 120}) == [120, 120]
    assert largest(None) == [np.inf, np.inf]
