"""Probabilities of grasps: against maps of every draw computed alone, and against all columns tried."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.plan.verify import verify
from symgrasp.survey.success import PoseNoise, best_columns, plan_for_success, success_map
from symgrasp.survey.success_picture import draw_success
from symgrasp.world import open_world
from tests.conftest import load_small


def test_a_probability_is_the_share_of_the_maps_of_all_draws():
    scene, noise = load_small("bottle_on_table", 4, 12, 4), PoseNoise(0.03, 0.1, "uniform")
    task = scene.task()
    with open_world(scene) as world:
        found = success_map(MapMaker(world), "panda", task, noise, count=5, seed=3)
    rng, maps = np.random.default_rng(3), []
    for x, y, z, a, b in rng.uniform(-1, 1, (5, 5)) * [0.03, 0.03, 0.03, 0.1, 0.1]:
        T = np.eye(4)
        T[:3, :3] = Rotation.from_rotvec([a, b, 0]).as_matrix() @ task.T_world_object[:3, :3]
        T[:3, 3] = task.T_world_object[:3, 3] + [x, y, z]
        maps.append(create_map(scene.with_task(replace(task, T_world_object=T))).feasible)
    assert np.array_equal(found.probability, np.mean(maps, axis=0))
    assert 0 < found.standard_error.max() <= 0.5 / 5**0.5
    assert len(draw_success(found).axes) == 3


def test_without_noise_grasps_are_certain_or_impossible():
    scene = load_small("bottle_on_table", 4, 12, 4)
    with open_world(scene) as world:
        found = success_map(MapMaker(world), "panda", scene.task(), PoseNoise(0.0), count=2)
    assert np.array_equal(found.probability, found.nominal.feasible)


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(
            arrays.arrays(bool, 4), arrays.arrays(bool, (6, 4), elements=st.booleans(), fill=st.nothing())
        ),
        min_size=1,
        max_size=3,
    ),
    st.booleans(),
)
def test_no_columns_are_better(lines, shared):
    found = best_columns(lines, shared=shared)
    tried = {}
    for columns in product(*(np.flatnonzero(nominal) for nominal, _ in lines)):
        draws = [d[:, c] for (_, d), c in zip(lines, columns, strict=True)]
        together = np.logical_and.reduce(draws).mean()
        tried[columns] = together if shared else np.prod([d.mean() for d in draws])
    if not tried:
        assert found is None
        return
    assert found is not None
    assert found[0] == pytest.approx(max(tried.values()))
    assert tried[tuple(found[1])] == pytest.approx(found[0])


@pytest.mark.parametrize("shared", [True, False])
def test_the_plan_for_success_holds(shared):
    scene = load_small("pick_pour_place", 8, 16, 4)
    found = plan_for_success(scene, PoseNoise(0.01, shared=shared), count=6)
    assert 0 < found.probability <= 1
    assert verify(found.plan)


def test_no_grasp_no_plan():
    scene = load_small("bottle_on_table", 3, 8, 2)
    far = replace(scene.task(), T_world_object=np.eye(4) + np.eye(4, k=3) * 5)
    with pytest.raises(NoPlanError):
        plan_for_success(scene.with_task(far), PoseNoise(0.01), count=1)
