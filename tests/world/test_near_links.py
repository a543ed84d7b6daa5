"""Links that are called far apart are far apart in PyBullet, and few are called near."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.scene.scene import Scene
from symgrasp.world import near_links, open_world

STATES, DISTANCE = 12, 0.03


@pytest.mark.parametrize("name", ["log_two_humanoids", "tiago_dual_tray", "log_four_robots"])
def test_links_that_are_called_far_apart_are_far_apart(name):
    scene = Scene.load(name)
    rng = np.random.default_rng(0)
    values = {}
    for robot in scene.robots.values():
        spread = rng.uniform(-0.6, 0.6, (STATES, len(robot.home)))
        values[robot.name] = np.clip(robot.home + spread, robot.model.lower, robot.model.upper)
    with open_world(scene) as world:
        pairs = list(world.link_pairs())
        near = near_links(world, values, pairs, DISTANCE)
        measured = 0
        for k in range(STATES):
            for robot, rows in values.items():
                world.set_robot(robot, rows[k])
            every = world.all_pairs_within(DISTANCE, pairs)
            found = {(c.a, c.b) for c in every if (c.a, c.b) in set(pairs)}
            assert found <= set(near[k])
            assert sorted(world.all_pairs_within(DISTANCE, near[k])) == sorted(every)
            measured += len(found)
    assert measured > STATES
    assert sum(map(len, near)) < 0.5 * STATES * len(pairs)


def test_pairs_of_links_are_those_that_are_checked_for_arms():
    """Those of one robot, and of two, that the checks of maps find in each other."""
    scene = Scene.load("log_two_robots")
    rng = np.random.default_rng(1)
    names = list(scene.robots)
    with open_world(scene) as world:
        pairs = {frozenset(pair) for pair in world.link_pairs()}
        seen = set()
        for _ in range(40):
            for robot in scene.robots.values():
                world.set_robot(robot.name, robot.home + rng.uniform(-1.5, 1.5, len(robot.home)))
            for arm in scene.arms.values():
                robots = [c for c in world.pairs_within(arm, 0.1) if {c.a.body, c.b.body} <= set(names)]
                seen |= {frozenset((c.a, c.b)) for c in robots}
    assert seen <= pairs
    assert {len({name.body for name in pair}) for pair in seen} == {1, 2}
