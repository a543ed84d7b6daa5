"""Checks of one robot, and of two, say together what the collisions of all robots say."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from symgrasp.world import BulletWorld
from tests.conftest import load_small


@pytest.mark.parametrize("holding", [0, 2, 4])
def test_robots_one_by_one_and_in_pairs(holding):
    scene = load_small("log_four_robots")
    arms = list(scene.arms.values())[:: 2 if holding == 2 else 1][:holding]
    rng = np.random.default_rng(holding)
    seen = set()
    with BulletWorld(scene) as world:
        for k in range(90):
            pose = np.array(scene.task().T_world_object)
            pose[:3, 3] += rng.normal(0, 0.3 if k % 2 else 0.02, 3)
            world.set_object(pose)
            world.margin = float(rng.choice([0.0, 0.4]))
            anywhere = [rng.uniform(arm.lower, arm.upper) for arm in arms]
            near_home = [arm.home + rng.normal(0, 0.2, arm.dof) for arm in arms]
            values = anywhere if k % 3 else near_home
            world.set_arms([(arm, q, 0.07) for arm, q in zip(arms, values, strict=True)])
            alone = {name for name in scene.robots if world.robot_collides(name, arms)}
            together = {pair for pair in combinations(scene.robots, 2) if world.robots_meet(*pair)}
            found = world.collisions(arms)
            assert bool(found) == bool(alone or together)
            bodies = [frozenset(b.body for b in (c.a, c.b) if b.body in scene.robots) for c in found]
            assert {frozenset(pair) for pair in together} == {b for b in bodies if len(b) == 2}
            assert alone == {next(iter(b)) for b in bodies if len(b) == 1}
            seen |= {bool(found), *map(len, bodies)}
    assert seen >= ({False, 1, 2} if holding == 4 else {False, 1})
