"""Robots do not fall along lines that are proven free, and lines along which they stand are mostly proven."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.paths.proof import CLOSEST, FALLEN
from symgrasp.motion.paths.search import prove
from symgrasp.scene.balance import Load, support_margin
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.plan.test_torso import content

STICK = 3.0
"""Mass (kg) of the object, so that it matters where it is held."""


def scene_on(half: float) -> Scene:
    """Two arms on a square whose middle is below their centre of mass at home."""
    plain = content()
    plain["object"]["mass"] = STICK
    robot = Scene.from_content(plain).arm("left").robot
    mass, centre = robot.model.masses()
    links = robot.T_world_base @ robot.model.forward(robot.home)
    x, y, _ = mass @ (np.einsum("lij,lj->li", links[:, :3, :3], centre) + links[:, :3, 3]) / mass.sum()
    corners = ((half, half), (-half, half), (-half, -half), (half, -half))
    plain["robots"][0]["support"] = [[float(x + a), float(y + b)] for a, b in corners]
    return Scene.from_content(plain)


@given(seed=st.integers(0, 10_000), half=st.sampled_from([0.02, 0.05, 0.1]))
@settings(max_examples=5)
def test_robots_stand_along_proven_lines(seed, half):
    scene, rng = scene_on(half), np.random.default_rng(seed)
    arm = scene.arm("left")
    robot = arm.robot
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        state = bodies.home()
        # The stick goes on from the tool.
        situation = bodies.situation(state.with_object(state.tool(arm)), [arm], held_by=[arm])
        home = state.joints(arm)
        start = (home + rng.normal(0, 0.3, (60, len(home)))).clip(arm.lower, arm.upper)
        end = (start + rng.normal(0, 0.3, start.shape)).clip(arm.lower, arm.upper)
        proof = prove(situation, start, end, 0.05)

    def margins(k: int) -> np.ndarray:
        found = []
        for s in np.linspace(0, 1, 40):
            q = start[k] + s * (end[k] - start[k])
            held = arm.world_tool_pose(q) @ [0.0, 0.0, scene.profile.centre_of_mass, 1.0]
            values = state.with_arm(arm, q).values[robot.name]
            found.append(support_margin(robot, values, [Load(STICK, held[:3])]))
        return np.array(found)

    free = np.flatnonzero(proof.free)
    fallen = np.flatnonzero(~proof.free & (proof.hits[:, 0] == FALLEN))
    assume(len(free) and len(fallen))
    for k in free[np.argsort(proof.room[free])][:4]:
        assert margins(k).min() >= proof.room[k] - 1e-9
    for k in fallen[:4]:
        assert margins(k).min() <= CLOSEST + 1e-3
