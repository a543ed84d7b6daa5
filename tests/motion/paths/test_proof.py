"""Lines that are proven free are free in PyBullet, with the clearance that is stated; and limits hold."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from symgrasp.bench.maps.random_scenes import KINDS, scene_of_kind
from symgrasp.errors import SceneError
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.paths.proof import CLOSEST
from symgrasp.motion.paths.search import NoMotionError, connect, prove
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world
from tests.conftest import load_small
from tests.engine.random_scenes import random_scene, random_torso_scene

BODY_STEP = 5e-4
"""Distance (m) that no point moves further between two states which are looked at."""

LONGEST = 1.6
"""Length (m) of the longest arm here, with its hand and what is below it."""


def points_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    count = 2 + int(np.abs(end - start).sum() * LONGEST / BODY_STEP)
    return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)


def distance_in_bullet(world: BulletWorld, arm, q: np.ndarray) -> float:
    """Smallest distance of the arm from all that it must not meet: its fingers from the object, too."""
    world.set_robot(arm.robot.name, arm.robot_values(q))
    own = [c.depth for c in world.arm_collisions(arm)]
    others = [name for name in world.scene.robots if name != arm.robot.name]
    object_inside = [c.depth for c in world.object_in_robots(others)]
    return -max([*own, *object_inside], default=0.0)


def random_lines(situation: Situation, arm, rng: np.random.Generator, count: int) -> tuple:
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    near = arm.robot.home[arm.indices] + rng.normal(0, 0.6, (count, len(arm.indices)))
    start = near.clip(low, high)
    end = (start + rng.normal(0, 0.25, start.shape)).clip(low, high)
    return start, end, prove(situation, start, end, 0.05).clearance


def test_no_false_free(thorough):
    @given(seed=st.integers(0, 10_000), torso=st.booleans())
    @settings(max_examples=6 if thorough else 2)
    def none_in(seed: int, torso: bool) -> None:
        try:
            assert_free(random_torso_scene(seed) if torso else random_scene(seed), seed, 3)
        except SceneError:
            assume(False)

    none_in()


@pytest.mark.parametrize("kind", KINDS)
def test_no_false_free_in_scenes_of_other_kinds(kind, tmp_path):
    assert_free(scene_of_kind(kind, 1, tmp_path), 1, 1)


def assert_free(content: dict[str, Any], seed: int, count: int) -> None:
    """Look all along those random lines which are proven with the least clearance, so many of them."""
    scene = Scene.from_content(content)
    rng = np.random.default_rng(seed)
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        arm = scene.arm()
        situation = bodies.situation(bodies.home(), [arm])
        start, end, clearance = random_lines(situation, arm, rng, 200)
        free = np.flatnonzero(clearance >= 0)
        for k in free[np.argsort(clearance[free])][:count]:
            for q in points_between(start[k], end[k]):
                assert distance_in_bullet(world, arm, q) >= 0.0


@contextmanager
def lines_of_the_panda(
    seed: int, count: int
) -> Iterator[tuple[BulletWorld, Arm, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield a world, its arm, and starts, ends and proven clearances of random lines between bottles."""
    scene = load_small("pick_pour_place")
    with open_world(scene) as world:
        bodies, arm = MotionScene(scene, world), scene.arm()
        situation = bodies.situation(bodies.home(), [arm])
        start, end, clearance = random_lines(situation, arm, np.random.default_rng(seed), count)
        yield world, arm, start, end, clearance


def test_a_pin_in_the_hand_is_found_wherever_on_the_line_it_is():
    """All lines pass through one configuration, at any share of their length; few are blocked otherwise."""
    scene = load_small("pick_pour_place")
    arm = scene.arm()
    there, rng = arm.home, np.random.default_rng(4)
    hand = arm.robot.model.forward(arm.robot_values(there))[arm.robot.model.link_index("panda_hand")]
    at = (arm.robot.T_world_base @ hand @ [0.0, 0.0, 0.03, 1.0])[:3]
    pin = {"name": "pin", "box": [1e-3, 1e-3, 1e-3], "pose": {"position": at.tolist()}}
    share = np.concatenate([np.repeat([0.0, 1.0], 20), rng.random(460)])[:, None]
    ways = rng.normal(0, 0.3, (len(share), arm.dof)) * rng.choice([0.1, 1.0, 3.0], (len(share), 1))
    start, end = there - share * ways, there + (1 - share) * ways
    free = []
    for obstacles in ([], [pin]):
        content = {**scene.content, "obstacles": [*scene.content["obstacles"], *obstacles]}
        with open_world(Scene.from_content(content)) as world:
            bodies = MotionScene(world.scene, world)
            free.append(prove(bodies.situation(bodies.home(), [arm]), start, end).free)
    without, with_pin = free
    assert without.mean() > 0.5
    assert not with_pin.any()


def test_stated_clearance_is_below_the_true_one():
    with lines_of_the_panda(5, 300) as (world, arm, start, end, clearance):
        free = np.flatnonzero(clearance >= 0)
        for k in free[:: len(free) // 10]:
            for q in start[k] + np.linspace(0, 1, 60)[:, None] * (end[k] - start[k]):
                world.set_robot(arm.robot.name, arm.robot_values(q))
                assert clearance[k] <= world.clearance(arm, 0.05) + 1e-6


def test_free_lines_are_mostly_proven():
    # The proof is conservative: of the lines that are free with a millimetre to spare, it finds nearly all.
    with lines_of_the_panda(2, 150) as (world, arm, start, end, clearance):
        missed = 0
        for k in np.flatnonzero(clearance < 0):
            states = start[k] + np.linspace(0, 1, 80)[:, None] * (end[k] - start[k])
            if min(distance_in_bullet(world, arm, q) for q in states) >= 0.0:
                margin = min(_clearance(world, arm, q) for q in states)
                missed += margin > 1e-3 + CLOSEST
        assert missed == 0


def _clearance(world: BulletWorld, arm, q: np.ndarray) -> float:
    world.set_robot(arm.robot.name, arm.robot_values(q))
    inside = [0.01 - c.depth for c in world.pairs_within(arm, 0.01)]
    return min(inside, default=0.01)


def test_a_parked_robot_is_an_obstacle():
    """Configurations that are free without it, and not with it, touch it in PyBullet."""
    content = load_small("log_two_robots").content
    (right,) = (robot for robot in content["robots"] if robot["name"] == "right")
    right["base"]["position"] = [0.6 * x for x in right["base"]["position"]]  # nearer than it stands
    scene = Scene.from_content(content)
    alone = [robot for robot in content["robots"] if robot["name"] == "left"]
    tasks = [{**task, "arms": ["left"]} for task in content["tasks"]]
    arm = scene.arm("left")
    q = np.random.default_rng(3).uniform(arm.lower, arm.upper, (4000, arm.dof))
    with open_world(Scene.from_content({**content, "robots": alone, "tasks": tasks})) as world:
        bodies = MotionScene(world.scene, world)
        without = prove(bodies.situation(bodies.home(), [world.scene.arm("left")]), q, q).free
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        situation = bodies.situation(bodies.home(), [arm])
        proof = prove(situation, q, q)
        assert not (proof.free & ~without).any()
        taken = np.flatnonzero(without & ~proof.free)
        assert len(taken) > 20
        for k in taken[:20]:
            world.set_robot("left", arm.robot_values(q[k]))
            touched = [c for c in world.pairs_within(arm, 1e-3) if "right" in (c.a.body, c.b.body)]
            assert touched
            assert "right" in {situation.names[piece].body for piece in proof.hits[k]}
        with pytest.raises(NoMotionError, match=r"its start is in collision: .*right/"):
            connect(situation, q[taken[:1]], arm.home[None])


def test_a_start_in_collision_is_said_to_be_that():
    scene = load_small("pick_pour_place")
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        arm = scene.arm()
        situation = bodies.situation(bodies.home(), [arm])
        low = np.array([[0.0, 1.7, 0.0, -0.3, 0.0, 1.6, 0.8]])  # the hand in the table
        with pytest.raises(NoMotionError, match=r"its start is in collision: .*table"):
            connect(situation, low, arm.home[None])


@given(seed=st.integers(0, 1000))
@settings(max_examples=10)
def test_free_motion_is_found_and_tilts_no_further_than_it_may(seed):
    scene = load_small("pick_pour_place")
    rng = np.random.default_rng(seed)
    largest = np.deg2rad(15)
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        arm = scene.arm()
        # An object that is upright in the hand at any configuration.
        state = bodies.home().with_arm(arm, rng.uniform(arm.lower, arm.upper))
        tool = state.tool(arm)
        T = np.eye(4)
        T[:3, 3] = tool[:3, 3]
        situation = bodies.situation(state.with_object(T), [arm], held_by=[arm], tilt=largest)
        q = rng.uniform(arm.lower, arm.upper, (4000, 7))
        q = q[[_tilt(arm, state, T, x) < largest - 1e-2 for x in q]]
        free = q[prove(situation, q, q).free]
        assume(len(free) >= 6)
        path = connect(situation, free[:1], free[1:], seed)
        assert (path[0] == free[0]).all()
        assert ((path >= arm.lower) & (path <= arm.upper)).all()
        for a, b in pairwise(path):
            for s in np.linspace(0, 1, 50):
                assert _tilt(arm, state, T, a + s * (b - a)) <= largest


def _tilt(arm, state, T_world_object, q) -> float:
    """The tilt of an object that is fixed to the tool as it is in a state, from poses alone."""
    fixed = np.linalg.inv(state.tool(arm)) @ T_world_object
    z = (arm.world_tool_pose(q) @ fixed)[:3, 2]
    return float(np.arccos(np.clip(z[2], -1, 1)))
