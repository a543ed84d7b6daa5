"""What is certain of two robots is so in PyBullet, and most is certain."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.engine.robot_pairs import COLLIDING, FREE, RobotPairs
from symgrasp.world import BulletWorld
from tests.conftest import load_small


@pytest.mark.parametrize("margin", [0.0, 0.03])
@pytest.mark.parametrize("name", ["log_four_robots", "log_iiwa_and_panda"])
def test_certain_pairs_against_bullet(name, margin):
    scene = load_small(name)
    one, other = list(scene.robots.values())[:2]
    rng = np.random.default_rng(0)

    def at_random(robot):
        lower, upper = np.clip([robot.model.lower, robot.model.upper], -np.pi, np.pi)
        return rng.uniform(lower, upper, (40, len(robot.home)))

    a, b = at_random(one), at_random(other)
    with BulletWorld(scene) as world:
        world.margin = margin
        pairs = RobotPairs(world)
        found = pairs.certify(pairs.place(one, list(a)), pairs.place(other, list(b)), margin)
        meet = np.empty(found.shape, dtype=bool)
        for i, j in np.ndindex(*found.shape):
            world.set_robot(one.name, a[i])
            world.set_robot(other.name, b[j])
            meet[i, j] = world.robots_meet(one.name, other.name)
    assert 0 < meet.mean() < 0.9
    assert not meet[found == FREE].any()
    assert meet[found == COLLIDING].all()
    assert np.isin(found, (FREE, COLLIDING)).mean() > 0.95


def test_links_that_are_left_out_collide_with_nothing():
    scene = load_small("log_four_robots")
    one, other = list(scene.robots.values())[:2]
    with BulletWorld(scene) as world:
        pairs = RobotPairs(world)
        a = pairs.place(one, [one.home], without=one.model.colliding_links())
        assert (pairs.certify(a, pairs.place(one, [one.home]), 1.0) == FREE).all()
        assert (pairs.certify(pairs.place(one, [one.home]), pairs.place(other, [other.home]), 9.0) > 0).all()
