"""The coarse map is Algorithm 1 with few cells and samples, says that it is, and compiles nothing."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.creation.coarse import ANGLES, HEIGHTS, SAMPLES, coarse_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.world import open_world
from tests.conftest import load_small

PROGRAM = """
from symgrasp.compiling import notify_on_compile
from symgrasp.feasibility.creation.coarse import coarse_map, is_map_compiled
from symgrasp.world import open_world
from tests.conftest import load_small

with notify_on_compile(lambda: print("compiles")), open_world(load_small("log_iiwa_and_panda")) as world:
    for arm in world.scene.arms.values():
        assert not is_map_compiled(world.scene, arm)
        print(coarse_map(world, arm, world.scene.task()).feasible.any())
"""


def coarse(scene) -> FeasibilityMap:
    task = scene.task()
    with open_world(scene) as world:
        found = coarse_map(world, scene.arm(task.arms[0]), task)
    assert found
    return found


def test_cells_have_the_reasons_of_those_they_lie_in():
    found = coarse(load_small("bottle_on_table", 2 * HEIGHTS, 3 * ANGLES, SAMPLES))
    few = create_map(load_small("bottle_on_table", HEIGHTS, ANGLES, SAMPLES), method="reference")
    assert np.array_equal(found.reason, few.reason.repeat(2, axis=1).repeat(3, axis=2))
    assert found.reason.shape == (2, found.manifold.heights, found.manifold.angles)


def test_a_grid_of_its_own_size_or_smaller_is_computed_as_it_is():
    scene = load_small("bottle_on_table", HEIGHTS - 1, ANGLES, SAMPLES)
    assert np.array_equal(coarse(scene).reason, create_map(scene, method="reference").reason)


def test_it_claims_nothing_and_says_what_it_is(tmp_path):
    found = coarse(load_small("bottle_on_table"))
    cell = tuple(np.argwhere(found.feasible)[0].tolist())
    assert found.preliminary
    assert found.witness(cell) is None
    assert found.rests_on(cell) == "a coarse map"
    assert not found.proven.any()
    assert np.isnan(found.q).all()
    assert found.shift(0.5).preliminary
    assert found.to_dict()["preliminary"]
    found.save(tmp_path / "map.npz")
    assert FeasibilityMap.load(tmp_path / "map.npz").preliminary
    assert found.plot().get_suptitle().endswith("coarse, preliminary")


@pytest.mark.parametrize("scene", ["log_two_gr3", "tiago_dual_tray"])
def test_there_is_none_where_it_would_take_long(scene):
    small = load_small(scene)
    arms = [arm for arm in small.arms.values() if arm.pitched or arm.robot.torso is not None]
    with open_world(small) as world:
        assert [coarse_map(world, arm, small.task()) for arm in arms] == [None] * len(arms)


def test_nothing_is_compiled_for_it(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True", "True"]
