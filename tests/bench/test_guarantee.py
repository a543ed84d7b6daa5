"""What maps miss is counted, and apart where they say that it is proven: on maps that are made wrong."""

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.bench.maps.guarantee import REFUTED, _arms, _measured, _random, _refuted, summary
from symgrasp.bench.maps.random_scenes import KINDS, random_scene, scene_of_kind
from symgrasp.engine.checks import HIT_BAND
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.ik import solver_for
from symgrasp.poses import inverse, translation
from symgrasp.reason import Reason
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import some
from tests.ik.eaik import EaikIK


def small() -> Scene:
    return Scene.load("log_iiwa_and_panda").with_settings(heights=4, angles=8)


def test_a_map_of_all_of_the_redundancy_misses_nothing():
    scene = small()
    found = _measured(scene, next(iter(scene.tasks.values())), "panda")
    assert found.feasible > 0 and found.proven > 0
    assert (found.missed, found.missed_proven, found.refuted, found.refuted_proven) == (0, 0, 0, 0)
    assert "of the proven 0 of" in found.line()
    missed = replace(found, missed=3, random=True, ratio=2.5)
    shipped, random, *others = summary([found, missed, replace(missed, ratio=4.5)])
    assert "auto misses 0;" in shipped
    assert f"2 maps with {2 * found.feasible} feasible cells" in random
    assert "auto misses 6;" in random
    assert "median time × 3.50" in random
    assert not others


def test_other_libraries_are_asked_without_margin_and_retreat():
    pytest.importorskip("coal")
    scene = small().with_settings(margin=0.01, approach=0.05)
    found = _measured(scene, next(iter(scene.tasks.values())), "panda")
    assert found.tried + found.tried_proven > 0
    assert (found.refuted, found.refuted_proven) == (0, 0)


def test_random_scenes_are_of_every_kind_with_arms_of_seven_joints(tmp_path):
    scene = small()
    found = list(_random(2 * (len(KINDS) + 2), [(scene, *own) for own in _arms(scene)], tmp_path))
    names = [own.name.split("_")[0] for own, _, _ in found]
    assert names == [scene.name.split("_")[0], "random", *KINDS] * 2
    assert {task.name for own, task, _ in found if own is scene} == {"random 0", f"random {len(KINDS) + 2}"}
    for own, task, name in found:
        assert name in task.arms
        assert len(own.arm(name).joint_names) == 7


def test_cells_that_are_falsely_infeasible_are_refuted():
    pytest.importorskip("coal")
    scene = small()
    task = next(iter(scene.tasks.values()))
    m = create_map(scene.with_settings(redundancy="auto"), arm="panda")
    assert _refuted(scene, task, "panda", m)[::2] == (0, 0)
    reason = np.where(m.feasible, Reason.SCENE_COLLISION, Reason.HAND_TOO_SMALL).astype(np.uint8)
    wrong = replace(m, reason=reason, proven=np.zeros_like(m.proven))
    assert _refuted(scene, task, "panda", wrong) == (REFUTED, REFUTED, 0, 0)
    assert _refuted(scene, task, "panda", replace(wrong, proven=m.feasible)) == (0, 0, REFUTED, REFUTED)


def test_a_rounded_hand_that_just_touches_a_mesh_refutes_no_cell():
    # Coal has the hand without its rounding of 1 mm: 0.97 mm from the bowl, which it touches by 0.03 mm.
    brute = pytest.importorskip("symgrasp.bench.maps.brute")
    scene = Scene.load("pick_pour_place").with_settings(heights=8, angles=16)
    place = translation([0.4212612292191334, -0.1925591721155413, -0.04327858471825968])
    task, arm, cell = Task("place", ("panda",), place), scene.arm("panda"), (0, 3, 12)
    grid = scene.manifold
    T = (inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(grid, place))[cell]
    opening, ik = arm.hand.opening(float(grid.profile.radius(grid.h[cell[1]]))), solver_for(arm, 64)
    with open_world(scene) as world:
        pinocchio = brute.BruteForce(world, arm, ik, place)
        assert pinocchio.feasible(T, opening)  # as long as it is not told to keep the rounding
        pinocchio.keep(0.0)
        assert not pinocchio.feasible(T, opening)
        world.set_object(place)
        checker = CandidateChecker(world, arm, ik, 0.0, holders=task.arms)
        depths = [c.collision.depth for c in checker.candidates(T, opening) if c.collision]
        assert min(depths) == pytest.approx(3e-5, abs=1e-6)


@pytest.mark.parametrize("first", some(1, range(0, 100, 20)))
def test_no_infeasible_cell_of_random_scenes_is_free_for_other_libraries(first, tmp_path):
    """By EAIK's configurations at 256 samples, and Pinocchio and Coal, in 100 scenes of every kind."""
    brute = pytest.importorskip("symgrasp.bench.maps.brute")
    kinds = ("", *KINDS)
    tried = reached = asked = 0
    for seed in range(first, first + 20):
        kind = kinds[seed % len(kinds)]
        content = scene_of_kind(kind, seed, tmp_path) if kind else random_scene(seed)
        plain = Scene.from_content(content)
        scene = plain.with_settings(redundancy="auto", margin=0.0, approach=0.0)
        task, rng = scene.task(), np.random.default_rng(seed)
        arm = scene.arm(task.arms[0])
        tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(scene.manifold, task.T_world_object)
        with open_world(scene) as world:
            m = MapMaker(world).map()
            ik = EaikIK(arm, 256)
            assert ik.knows_arm
            others = brute.BruteForce(world, arm, ik, task.T_world_object)
            others.keep(HIT_BAND)
            infeasible = rng.permutation(np.argwhere(~m.feasible & (m.reason >= Reason.UNREACHABLE)))[:3]
            for cell in map(tuple, infeasible.tolist()):
                tried += 1
                why = f"{content['name']}, {cell}: {m.why(cell)}, by {m.rests_on(cell)}"
                assert not others.feasible(tools[cell], float(m.opening[cell[1]])), why
            for cell in map(tuple, rng.permutation(np.argwhere(m.feasible))[:1].tolist()):
                asked += 1
                reached += others.feasible(tools[cell], float(m.opening[cell[1]]))
    assert tried > 30
    assert reached > 0.7 * asked > 3  # what is free between samples alone is not met
