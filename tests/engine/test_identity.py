"""The engine's map is the reference's, cell for cell."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.engine import create_map_exact
from symgrasp.feasibility import create_map
from symgrasp.reason import Reason
from symgrasp.scene import Scene
from symgrasp.world import BulletWorld
from tests.conftest import SHIPPED


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_have_the_same_map(name):
    """Feasible cells and the reasons up to the joint limits; every witness is free in PyBullet."""
    scene = Scene.load(name)
    task = scene.task()
    arm = scene.arm(task.arms[0])
    reference, exact = create_map(scene), create_map_exact(scene)
    assert np.array_equal(exact.feasible, reference.feasible)
    early = (reference.reason <= Reason.JOINT_LIMITS) | (exact.reason <= Reason.JOINT_LIMITS)
    assert np.array_equal(exact.reason[early], reference.reason[early])
    with BulletWorld(scene) as world:
        world.set_object(task.T_world_object)
        for cell in np.argwhere(exact.feasible)[::7]:
            witness = exact.witness(tuple(cell))
            assert witness is not None
            world.set_arm(arm, witness.q, witness.opening)
            assert world.first_collision(arm) is None
