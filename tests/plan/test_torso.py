"""Plans in which a body moves its torso, with one value for both of its arms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from symgrasp.feasibility.create import MapMaker
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.engine.random_scenes import random_torso_scene

TORSO = ("lift_joint", "waist_joint")


def content():
    """Two arms on a torso, and a stick across in front of them."""
    scene = random_torso_scene(0)
    pose = {"position": [0.55, -0.35, 0.35], "rpy_deg": [-90, 0, 0]}
    scene["robots"][0]["torso"] = {"lift_joint": 3, "waist_joint": 3}
    scene["object"] = {"name": "stick", "profile": [[0, 0.03], [0.7, 0.03]]}
    scene["tasks"] = [
        {"name": "carry", "arms": ["left", "right"], "pose": pose},
        {"name": "give", "arms": ["left"], "pose": pose},
    ]
    scene["obstacles"] = []
    scene["map"] = {"heights": 10, "angles": 16, "redundancy": 1}
    return scene


@cache
def bimanual() -> Plan:
    return plan_bimanual(Scene.from_content(content()))


def changed(plan: Plan, k: int, **joints: float) -> Plan:
    """The plan with other joint values of one of its holds."""
    (task,) = plan.tasks
    holds = list(task.holds)
    holds[k] = holds[k].model_copy(update={"joints": {**holds[k].joints, **joints}})
    return plan.model_copy(update={"tasks": (task.model_copy(update={"holds": tuple(holds)}),)})


def test_both_arms_have_one_torso_in_a_plan():
    (task,) = bimanual().tasks
    values = [[hold.joints[name] for name in TORSO] for hold in task.holds]
    assert values[0] == values[1]
    assert list(task.holds[0].joints)[:2] == list(TORSO)
    report = verify(bimanual())
    assert report, str(report)


@pytest.mark.parametrize("hold", [0, 1])
def test_verify_notices_another_torso(hold):
    (task,) = bimanual().tasks
    moved = changed(bimanual(), hold, lift_joint=task.holds[hold].joints["lift_joint"] + 1e-3)
    assert "differ in lift_joint" in str(verify(moved))


def test_the_torso_lifts_where_it_must():
    """A stick higher up is out of reach of the torso's lowest value, and within that of another."""
    scene = Scene.from_content(content())
    with open_world(scene) as world:
        by_torso = MapMaker(world).maps_by_torso("left", "carry")
        any_value = MapMaker(world).map("left", "carry")
    feasible = np.array([m.feasible for m in by_torso])
    assert np.array_equal(any_value.feasible, feasible.any(axis=0))
    assert len({m.tobytes() for m in feasible}) > 3
    plan = plan_sequential(scene, "left")
    assert set(TORSO) < set(plan.tasks[0].holds[0].joints)
    assert verify(plan)


def test_hands_of_one_body_that_hold_the_object_are_clear_of_it():
    """The clearance of an arm leaves out the object in the other hand's fingers."""
    plan = bimanual()
    scene = Scene.from_content(plan.scene.content)
    (task,) = plan.tasks
    with open_world(scene) as world:
        world.set_object(task.object_pose_turned.array())
        arms = [scene.arm(hold.arm) for hold in task.holds]
        world.set_arms(
            (arm, [hold.joints[name] for name in arm.joint_names], hold.opening)
            for arm, hold in zip(arms, task.holds, strict=True)
        )
        for arm, hold in zip(arms, task.holds, strict=True):
            fingers = {link for other in arms for link in other.hand.touch_links}
            pairs = [
                c for c in world.pairs_within(arm, 0.1)
                if not (c.reason.name == "OBJECT_COLLISION" and c.a.link in fingers)
            ]  # fmt: skip
            nearest = min([0.1, *(0.1 - c.depth for c in pairs)])
            assert hold.clearance <= nearest
            assert hold.clearance == pytest.approx(nearest, abs=2e-5)  # stated a little too low
            assert hold.clearance > world.clearance(arm, 0.1)
