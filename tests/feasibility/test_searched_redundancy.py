"""Maps for which all of the redundancy is searched, against maps at many samples."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.bench.maps.random_scenes import KINDS, scene_of_kind
from symgrasp.errors import Cancelled, SceneError
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.exact import redundancy_search
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.poses import inverse, translation
from symgrasp.reason import Reason
from symgrasp.scene.format import AUTO_SAMPLES, MOST_SAMPLES, MapSettings
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import SHIPPED, load_small
from tests.engine.random_scenes import random_scene, random_torso_scene


def covered(scene: Scene) -> tuple[FeasibilityMap, FeasibilityMap]:
    """The map of the first task for which all of the redundancy is searched, and that at the most samples."""
    with open_world(scene.with_settings(redundancy="auto")) as world:
        auto = MapMaker(world).map()
    with open_world(scene.with_settings(redundancy=MOST_SAMPLES)) as world:
        return auto, MapMaker(world).map()


def assert_none_missed(auto: FeasibilityMap, dense: FeasibilityMap) -> None:
    assert not (dense.feasible & ~auto.feasible).any()
    assert not (auto.proven & dense.feasible).any()


@settings(max_examples=8)
@given(st.integers(0, 10_000))
def test_what_samples_show_is_told_before(seed):
    scene = Scene.from_content(random_scene(seed)).with_settings(redundancy="auto")
    told: list[FeasibilityMap] = []
    with open_world(scene) as world:
        auto = MapMaker(world).map(sampled=told.append)
    with open_world(scene.with_settings(redundancy=AUTO_SAMPLES)) as world:
        samples = MapMaker(world).map()
    before = told[0] if told else auto  # where nothing is left to search
    assert len(told) <= 1
    assert np.array_equal(before.feasible, samples.feasible)
    assert np.array_equal(before.q, samples.q, equal_nan=True)
    assert not (before.feasible & ~auto.feasible).any()


def assert_witnesses(scene: Scene, m: FeasibilityMap) -> None:
    """Witnesses that are at no sample pass the checks of Algorithm 1, at their own redundancy."""
    arm, task = scene.arm(m.arm), scene.task(m.task)
    tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object)
    own = solver_for(arm, scene.settings.samples)
    with open_world(scene) as world:
        world.set_object(m.T_world_object)
        for index in np.argwhere(m.feasible & (m.sample >= len(own.phi)))[:20]:
            cell = Cell(*index.tolist())
            witness = m.witness(cell)
            assert witness is not None
            assert np.allclose(arm.tool_pose(witness.q), tools[cell], atol=1e-6)
            ik = solver_for(arm, 1, more=[witness.phi])
            checker = CandidateChecker(world, arm, ik, scene.settings.approach, holders=task.arms)
            sample = int(np.abs(ik.phi - witness.phi).argmin())
            found = checker.check(tools[cell], witness.q, sample, witness.opening)
            assert found.reason == Reason.FEASIBLE


@settings(max_examples=12)
@given(st.integers(0, 10_000))
def test_no_cell_is_missed_that_a_sample_shows_feasible(seed):
    scene = Scene.from_content(random_scene(seed))
    auto, dense = covered(scene)
    assert_none_missed(auto, dense)
    assert_witnesses(scene.with_settings(redundancy="auto"), auto)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=4)
@given(seed=st.integers(0, 10_000))
def test_no_cell_of_scenes_of_other_kinds_is_missed(kind, tmp_path_factory, seed):
    scene = Scene.from_content(scene_of_kind(kind, seed, tmp_path_factory.mktemp(kind)))
    auto, dense = covered(scene)
    assert_none_missed(auto, dense)
    assert_witnesses(scene.with_settings(redundancy="auto"), auto)


@pytest.mark.parametrize("seed", [511, 516, 524])
def test_narrow_windows_are_found(seed):
    # Free between two branches that end in the same root, far from both (516), and between two values at
    # which the retreat is blocked (524).
    auto, dense = covered(Scene.from_content(random_scene(seed)))
    assert dense.feasible.any()
    assert_none_missed(auto, dense)


@pytest.mark.parametrize("seed", range(2))
def test_arms_of_six_joints_on_a_torso_have_the_same_map(seed):
    scene = Scene.from_content(random_torso_scene(seed))
    auto, dense = covered(scene)
    assert np.array_equal(auto.feasible, dense.feasible)


def test_an_arm_of_seven_joints_on_a_torso_keeps_its_witnesses():
    scene = Scene.load("tiago_dual_tray").with_settings(heights=6, angles=12, redundancy="auto")
    with open_world(scene) as world:
        m = MapMaker(world).map("left")
    arm = scene.arm("left")
    base = solver_for(arm, scene.settings.samples).phi
    assert np.array_equal(m.phi[: len(base)], base)
    tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object)
    assert m.feasible.any()
    for index in np.argwhere(m.feasible):
        witness = m.witness(Cell(*index.tolist()))
        assert witness is not None
        assert np.allclose(arm.tool_pose(witness.q), tools[tuple(index)], atol=1e-6)


@cache
def small_map() -> FeasibilityMap:
    return create_map(load_small("log_iiwa_and_panda").with_settings(redundancy="auto"), arm="panda")


def test_more_is_found_than_at_samples_and_it_says_what_it_rests_on():
    sampled = create_map(load_small("log_iiwa_and_panda", redundancy=32), arm="panda")
    m = small_map()
    assert (sampled.feasible <= m.feasible).all()
    assert m.feasible.sum() > sampled.feasible.sum()
    said = {m.rests_on(Cell(*index)) for index in np.ndindex(m.reason.shape)}
    assert {"its witness", "a proof"} <= said
    assert m.resolution >= 1e-4
    assert sampled.resolution == 0.0
    assert not (m.proven & m.feasible).any()


def test_it_can_be_cancelled_while_the_redundancy_is_searched(monkeypatch):
    scene = load_small("log_iiwa_and_panda").with_settings(heights=4, angles=120, redundancy="auto")
    search, numbers = redundancy_search.cover, []

    def counted(*args):
        numbers.append(len(args[8].cells))
        return search(*args)

    def cancel(share: float) -> None:
        if numbers:
            raise Cancelled

    monkeypatch.setattr(redundancy_search, "cover", counted)
    with open_world(scene) as world:
        maker = MapMaker(world)
        with pytest.raises(Cancelled):
            maker.map("panda", progress=cancel)
        assert len(numbers) == 1
        assert numbers[0] <= 16  # not all cells of a row
        after = maker.map("panda")
    assert sum(numbers) > 30
    fresh = create_map(scene, arm="panda")
    assert np.array_equal(after.reason, fresh.reason)
    assert np.array_equal(after.proven, fresh.proven)


def test_what_it_rests_on_is_saved(tmp_path):
    m = small_map()
    m.save(tmp_path / "map.npz")
    loaded = FeasibilityMap.load(tmp_path / "map.npz")
    assert np.array_equal(loaded.proven, m.proven)
    assert loaded.resolution == m.resolution
    assert np.array_equal(m.shift(m.manifold.dtheta).proven, np.roll(m.proven, -1, axis=2))


def test_an_explanation_has_the_witness_of_the_map():
    scene = load_small("log_iiwa_and_panda").with_settings(redundancy="auto")
    m = small_map()
    index = np.argwhere(m.feasible & (m.sample >= scene.settings.samples))[0]
    with open_world(scene) as world:
        explanation = MapMaker(world).explain("panda", None, Cell(*index.tolist()))
    assert explanation.reason == Reason.FEASIBLE


def test_an_explanation_says_what_the_map_rests_on():
    scene = Scene.load("bottle_on_table").with_settings(heights=6, angles=12)
    m = create_map(scene)
    searched = ~m.feasible & ~m.proven
    cells = [np.argwhere(which)[0].tolist() for which in (m.feasible, searched, m.proven)]
    with open_world(scene) as world:
        found = [MapMaker(world).explain(None, None, Cell(*cell)) for cell in cells]
    assert [e.rests_on for e in found] == [m.rests_on(Cell(*cell)) for cell in cells]
    assert len({e.rests_on for e in found}) == 3
    assert f"\nrests on {found[1].rests_on}" in str(found[1])
    with open_world(scene.with_settings(redundancy=6)) as world:
        sampled = MapMaker(world).explain(None, None, Cell(*cells[1]))
    assert sampled.rests_on == "6 redundancy samples"


@pytest.mark.parametrize("redundancy", ["auto", 6])
def test_nothing_is_left_open_where_bodies_collide_whatever_the_arm_does(redundancy):
    scene = Scene.load("bottle_on_table").with_settings(heights=6, angles=12, redundancy=redundancy)
    task = scene.task()
    inside = replace(task, T_world_object=scene.arm().robot.T_world_base @ translation([0, 0, 0.05]))
    with open_world(scene) as world:
        m = MapMaker(world).map(None, inside)
    assert not m.feasible.any()
    assert m.proven.all()


def test_scenes_search_all_of_the_redundancy_unless_they_say_otherwise():
    """Of the shipped ones, all but that whose arm of five joints is sampled; and Algorithm 1 has a number."""
    content = Scene.load("bottle_on_table").content
    content["map"] = {"heights": 6, "angles": 12}
    scene = Scene.from_content(content)
    assert scene.settings.redundancy == MapSettings().redundancy == "auto"
    assert create_map(scene).resolution > 0
    plain = create_map(scene, method="reference")
    assert (len(plain.phi), plain.resolution) == (AUTO_SAMPLES, 0.0)
    assert len(create_map(scene.with_settings(redundancy=5), method="reference").phi) == 5
    asked = {name: Scene.load(name).settings.redundancy for name in SHIPPED}
    assert {name for name, redundancy in asked.items() if redundancy != "auto"} == {"so101_jar"}


def test_other_words_are_refused():
    with pytest.raises(SceneError, match="redundancy"):
        load_small("soda_can").with_settings(redundancy="all")


def test_pybullet_is_asked_seldom_where_a_link_touches_a_body_all_along(monkeypatch):
    check, asked = CandidateChecker.check, []

    def counted(*args):
        found = check(*args)
        asked.append(found.reason)
        return found

    monkeypatch.setattr(CandidateChecker, "check", counted)
    scene = Scene.load("pick_pour_place")
    few = create_map(scene)
    count = len(asked)
    monkeypatch.setattr(redundancy_search, "MOST_OVERLAPPING", 10**6)
    assert np.array_equal(few.feasible, create_map(scene).feasible)
    assert 0 < 4 * count < len(asked) - count
