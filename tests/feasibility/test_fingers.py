"""Open fingers are not inside the object beside their pads, measured by PyBullet at steps of its profile."""

from __future__ import annotations

from functools import cache

import numpy as np
import pybullet
import pytest

from symgrasp.feasibility.fit import fit, fits_all
from symgrasp.object.manifold import ROLLS
from symgrasp.object.profile import Profile
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world
from tests.plan.tampering import changed
from tests.plan.test_plan import sequential

STEP = [[0, 0.015], [0.15, 0.015], [0.1501, 0.03], [0.3, 0.03]]
RIM = [[0, 0.015], [0.15, 0.015], [0.1501, 0.022], [0.16, 0.022], [0.1601, 0.015], [0.3, 0.015]]
FLANGE = [[0, 0.015], [0.15, 0.015], [0.1501, 0.05], [0.3, 0.05]]
PROFILES = {"step": STEP, "rim": RIM, "flange": FLANGE}
HANDS = [
    ("log_iiwa_and_panda", "panda"),
    ("log_iiwa_and_panda", "iiwa"),
    ("pr2_pour", "left"),
    ("talos_bottle", "talos_left"),
    ("g1_bottle", "g1_left"),
]


@cache
def scene_of(name: str, shape: str) -> Scene:
    content = Scene.load(name).content
    object_ = {"name": content["object"]["name"], "profile": PROFILES[shape]}
    return Scene.from_content({**content, "object": object_})


def distance(world: BulletWorld, arm: Arm, h: float, roll: float) -> float:
    """Return how far (m) the fingers are from the object that they are open around, below zero if inside."""
    radius = float(world.scene.profile.radius(h))
    q = arm.robot.home[arm.indices]
    grasp = arm.hand.tool_pose(np.eye(4), h, 0.3, roll, radius)
    world.set_object(arm.world_tool_pose(q) @ inverse(grasp))
    world.set_arms([(arm, q, arm.hand.opening(radius))])
    body, client = world.bodies.robots[arm.robot.name], world._client
    found = [
        point[8]
        for piece in world.bodies.object
        for point in pybullet.getClosestPoints(body, piece, 0.05, physicsClientId=client)
        if world.bodies.body_name(body, point[3]).link in arm.hand.touch_links
    ]
    return min(found)


@pytest.mark.parametrize("shape", PROFILES)
@pytest.mark.parametrize(("name", "own"), HANDS)
def test_fingers_stay_out_of_steps_beside_their_pads(name, own, shape):
    scene = scene_of(name, shape)
    arm = scene.arm(own)
    reach = max(arm.hand.finger_width, arm.hand.palm_width) / 2 + 0.004  # the palm has to fit, too
    heights = [h for edge in (0.15, 0.16) for h in np.arange(edge - reach, edge + reach, 7e-4)]
    held = [float(h) for h in heights if fit(arm.hand, scene.profile, float(h)) is None]
    assert len(held) > 4
    with open_world(scene) as world:
        assert min(distance(world, arm, h, roll) for h in held for roll in ROLLS) >= 0


def test_wider_fingers_than_pads_do_not_fit_beside_a_step():
    """The pads of the Panda lie below the step, what carries them beside it."""
    hand = Scene.load("bottle_on_table").arm().hand
    profile = Profile(STEP)
    assert hand.pad_width / 2 < 0.15 - 0.1405 < hand.finger_width / 2
    assert fit(hand, profile, 0.1405) == Reason.SURFACE_TOO_STEEP
    assert fit(hand, profile, 0.15 - hand.finger_width / 2 - 1e-6) is None
    assert fits_all(hand, profile, 0.12, 0.13)
    assert not fits_all(hand, profile, 0.12, 0.1405)


def test_a_plan_with_fingers_inside_a_step_does_not_hold():
    """The scene and its hash are changed together: a step appears beside the pads, below the fingers."""
    plan = sequential()
    h, hand = plan.tasks[0].holds[0].grasp.h, Scene.load("pick_pour_place").arm().hand
    at = h + 0.5 * (hand.pad_width + hand.finger_width) / 2
    profile = plan.scene.content["object"]["profile"]
    r = float(Profile(profile).radius(h))
    below = [knot for knot in profile if knot[0] < at]
    stepped = [
        *below,
        [at, r],
        [at + 1e-4, r + 0.0065],
        [at + 0.004, r + 0.0065],
        [at + 0.0041, r],
        [0.24, r],
    ]
    content = changed(plan.model_dump(mode="json"), ("scene", "content", "object", "profile"), stepped)
    report = verify(Plan.model_validate(content))
    assert any("the pads do not rest" in line for line in report.failures), report.failures
