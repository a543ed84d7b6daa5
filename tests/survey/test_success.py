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
from scipy.stats import binom

from symgrasp.cli.main import main
from symgrasp.errors import NoPlanError
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.object.manifold import ROLLS
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.scene.scene import Scene
from symgrasp.survey.evaluation import plan_margin
from symgrasp.survey.success import Line, PoseNoise, best_columns, interval, plan_for_success, success_map
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
        st.builds(
            Line,
            arrays.arrays(bool, 4),
            arrays.arrays(bool, (6, 4), elements=st.booleans(), fill=st.nothing()),
            arrays.arrays(float, 4, elements=st.sampled_from([0.01, 0.02, 0.03]), fill=st.nothing()),
        ),
        min_size=1,
        max_size=3,
    ),
    st.booleans(),
)
def test_no_columns_are_better(lines, shared):
    found = best_columns(lines, shared=shared)
    tried = {}
    for columns in product(*(np.flatnonzero(line.nominal) for line in lines)):
        draws = [line.draws[:, c] for line, c in zip(lines, columns, strict=True)]
        together = np.logical_and.reduce(draws).mean()
        margin = min(line.margin[c] for line, c in zip(lines, columns, strict=True))
        tried[columns] = (together if shared else np.prod([d.mean() for d in draws])), margin
    if not tried:
        assert found is None
        return
    assert found is not None
    best = max(probability for probability, _ in tried.values())
    assert found.probability == pytest.approx(best)
    most = max(margin for probability, margin in tried.values() if probability > best - 1e-9)
    if best > 0:  # where nothing succeeds, columns that fail do not matter
        assert found.margin == most
    assert tried[found.columns] == pytest.approx((found.probability, found.margin))


@pytest.mark.parametrize(("count", "draws"), [(0, 8), (3, 8), (8, 8), (99, 100), (100, 100)])
def test_an_interval_ends_where_the_count_would_be_too_rare(count, draws):
    """At its ends so many successes or more, or so few or fewer, have the probability that is left out."""
    low, high = interval([count], draws)
    assert low <= count / draws <= high
    if count:
        assert binom.sf(count - 1, draws, low) == pytest.approx(0.025)
    if count < draws:
        assert binom.cdf(count, draws, high) == pytest.approx(0.025)
    assert interval([count, draws], draws)[0] < low or not count


def test_few_draws_do_not_make_a_plan_certain(tmp_path, capsys):
    out = tmp_path / "plan.json"
    command = ["success", "bottle_on_table", "--samples", "3", "--position", "0.1", "--plan", str(out)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "100.0 % of 3 draws" in said
    assert "probability 29.2 to 100.0 % (95 % confidence)" in said
    plan = Plan.load(out)
    assert verify(plan)
    assert f"{1e3 * plan_margin(plan, Scene.load('bottle_on_table').profile):.1f} mm" in said


@pytest.mark.parametrize("shared", [True, False])
def test_the_plan_for_success_holds(shared):
    scene = load_small("pick_pour_place", 8, 16, 4)
    found = plan_for_success(scene, PoseNoise(0.01, shared=shared), count=6)
    assert 0 < found.probability <= 1
    assert found.interval[0] < found.probability <= found.interval[1]
    assert verify(found.plan)
    for task in found.plan.tasks:  # margins are those of the whole map
        (hold,) = task.holds
        m = create_map(scene, task=task.name)
        cell = m.manifold.cell(hold.grasp.h, hold.grasp.theta + task.delta)
        own = m.cell_margins[ROLLS.index(hold.grasp.roll), cell[0], cell[1]]
        assert (hold.margin_along, hold.margin_around) == pytest.approx(tuple(own))


@pytest.mark.parametrize("shared", [True, False])
def test_no_grasp_of_the_sequence_is_more_probable(shared):
    """Against a plain loop: every draw of every task has its map computed alone, every grasp is tried."""
    scene, sigma, tilt, count = load_small("pick_pour_place", 8, 16, 4), 0.03, 0.1, 6
    found = plan_for_success(scene, PoseNoise(sigma, tilt, shared=shared), count=count, seed=4)
    expected, drawn = [], []
    for k, task in enumerate(scene.tasks.values()):
        rng = np.random.default_rng(4 if shared else 4 + k)
        expected.append(create_map(scene, task=task.name).feasible)
        maps = []
        for x, y, z, a, b in rng.standard_normal((count, 5)) * [sigma, sigma, sigma, tilt, tilt]:
            T = np.eye(4)
            T[:3, :3] = Rotation.from_rotvec([a, b, 0]).as_matrix() @ task.T_world_object[:3, :3]
            T[:3, 3] = task.T_world_object[:3, 3] + [x, y, z]
            own = scene.with_task(replace(task, T_world_object=T))
            maps.append(create_map(own, task=task.name).feasible)
        drawn.append(np.array(maps))

    def probability(roll: int, row: int, columns: tuple[int, ...]) -> float:
        held = [own[:, roll, row, column] for own, column in zip(drawn, columns, strict=True)]
        if shared:
            return float(np.logical_and.reduce(held).mean())
        return float(np.prod([own.mean() for own in held]))

    best = 0.0
    for roll, row in np.ndindex(expected[0].shape[:2]):
        choices = [np.flatnonzero(own[roll, row]).tolist() for own in expected]
        best = max([best, *(probability(roll, row, columns) for columns in product(*choices))])
    assert found.probability == pytest.approx(best)
    grasp = found.plan.tasks[0].holds[0].grasp
    cells = [scene.manifold.cell(grasp.h, grasp.theta + task.delta) for task in found.plan.tasks]
    own = probability(ROLLS.index(grasp.roll), cells[0][0], tuple(column for _, column in cells))
    assert found.probability == pytest.approx(own)
    assert 0 < found.probability < 1


def test_no_grasp_no_plan():
    scene = load_small("bottle_on_table", 3, 8, 2)
    far = replace(scene.task(), T_world_object=np.eye(4) + np.eye(4, k=3) * 5)
    with pytest.raises(NoPlanError):
        plan_for_success(scene.with_task(far), PoseNoise(0.01), count=1)
