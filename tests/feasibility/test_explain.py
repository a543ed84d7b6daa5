"""The explanation of a cell agrees with both ways of computing its map, with the URDF and with PyBullet."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from symgrasp.cli.main import main
from symgrasp.errors import Cancelled
from symgrasp.feasibility.cell import CLEARANCE_LIMIT, Cell
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.explain import Explanation, RetreatFailure
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.poses import inverse, translation
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.conftest import PLAIN, load_small
from tests.ik.eaik import EaikIK

COLLISIONS = (
    Reason.SELF_COLLISION, Reason.OBJECT_COLLISION, Reason.SCENE_COLLISION, Reason.ROBOT_COLLISION,
)  # fmt: skip


def some_cells(m: FeasibilityMap, each: int = 3) -> list[Cell]:
    """A few cells of every reason."""
    rng = np.random.default_rng(0)
    found = []
    for reason in np.unique(m.reason):
        cells = np.argwhere(m.reason == reason)
        found += [Cell(*map(int, cell)) for cell in rng.permutation(cells)[:each]]
    return found


@pytest.mark.parametrize("approach", [0.0, 0.1])
@pytest.mark.parametrize("name", PLAIN)
def test_the_best_candidate_is_the_reason_of_both_maps(name, approach):
    scene = load_small(name, 6, 12, 6).with_settings(approach=approach)
    task = list(scene.tasks.values())[-1]
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        for arm in task.arms:
            reference = maker.map(arm, task, method="reference")
            exact = maker.map(arm, task)
            for cell in some_cells(reference):
                found = maker.explain(arm, task, cell)
                assert found.reason == reference.reason[cell]
                agrees_with_exact(found, exact, cell)
                assert_consistent(found, world, scene.arm(arm))


def test_rests_on_what_the_map_says_where_some_values_of_a_torso_need_no_search():
    scene = load_small("talos_bottle", 6, 12).with_settings(redundancy="auto")
    task = list(scene.tasks.values())[-1]
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        m = maker.map(None, task)
        assert m.resolution
        for cell in some_cells(m):
            found = maker.explain(None, task, cell)
            assert found.rests_on == m.rests_on(cell)
            if m.reason[cell] not in COLLISIONS:
                assert found.reason == m.reason[cell]


def agrees_with_exact(found: Explanation, exact: FeasibilityMap, cell: Cell) -> None:
    """Among collisions the engine may name another stage, but what it names is in the list."""
    reason = Reason(int(exact.reason[cell]))
    if reason not in COLLISIONS:
        assert found.reason == reason
        return
    assert found.reason in (*COLLISIONS, Reason.APPROACH_BLOCKED)
    names = {exact.bodies[k] for k in exact.pair[cell]}
    pairs = [{str(c.a), str(c.b)} for v in found.candidates for c in v.collisions if c.reason == reason]
    assert names in pairs


def assert_consistent(found: Explanation, world: BulletWorld, arm: Arm) -> None:
    """What is said of a candidate is so, asked of URDF and PyBullet anew; the order is best first."""
    T_base_tool = inverse(arm.robot.T_world_base) @ found.T_world_tool
    reasons = [v.reason for v in found.candidates]
    assert reasons == sorted(reasons, reverse=True)
    approach = world.scene.settings.approach
    joints = arm.robot.model.joint_names
    for v in found.candidates:
        assert np.allclose(arm.tool_pose(v.q), T_base_tool, atol=1e-6)
        for joint in v.violations:
            k = joints.index(joint.joint)
            lower, upper = arm.robot.model.lower[k], arm.robot.model.upper[k]
            assert joint.limit in (lower, upper)
            assert not lower <= joint.value <= upper
            assert joint.excess == pytest.approx(max(lower - joint.value, joint.value - upper))
        assert bool(v.violations) == (v.reason == Reason.JOINT_LIMITS)
        assert (v.clearance is not None) == (v.reason == Reason.FEASIBLE)
        retreated = T_base_tool @ translation([0, 0, -v.retreat])
        if v.reason in COLLISIONS:
            assert v.retreat == 0
            assert v.reason == v.collisions[0].reason == min(c.reason for c in v.collisions)
        elif v.reason == Reason.APPROACH_BLOCKED:
            assert 0 < v.retreat <= approach
            assert bool(v.collisions) == (v.failure is None)
        if v.collisions:
            assert np.allclose(arm.tool_pose(v.ended), retreated, atol=1e-6)
    kinds = dict.fromkeys(v.reason for v in found.candidates)
    for reason in kinds:  # one of each is enough
        ask_pybullet(next(v for v in found.candidates if v.reason == reason), world, arm, found)


def ask_pybullet(v, world: BulletWorld, arm: Arm, found: Explanation) -> None:
    with world.preserving_state():
        world.margin = world.scene.settings.margin
        world.set_arms([(arm, v.ended, found.opening)])
        world.set_object(explained_pose(world))
        first = world.first_collision(arm)
        if v.reason == Reason.JOINT_LIMITS or v.failure:
            return
        if v.collisions:
            assert first == v.collisions[0]
            parked = world.collisions([arm])  # what stands still counts there as well
            names = {(frozenset((c.a, c.b)), c.reason, c.depth) for c in parked}
            assert {(frozenset((c.a, c.b)), c.reason, c.depth) for c in v.collisions} <= names
        else:
            assert first is None
            world.set_arms([(arm, v.q, found.opening)])
            assert v.clearance == world.clearance(arm, CLEARANCE_LIMIT)


def explained_pose(world: BulletWorld) -> np.ndarray:
    """The tests above explain the last task."""
    return list(world.scene.tasks.values())[-1].T_world_object


def test_candidates_are_those_of_eaik():
    scene = load_small("bottle_on_table", 6, 12, 6)
    arm = scene.arm()
    ik = EaikIK(arm, 6)
    unreachable = 0
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        for cell in some_cells(maker.map()):
            found = maker.explain(None, None, cell)
            if found.reason < Reason.UNREACHABLE:
                assert not found.candidates
                assert found.unreachable == 0
                continue
            solutions = ik.solve(inverse(arm.robot.T_world_base) @ found.T_world_tool)
            assert len(found.candidates) >= solutions.inside.sum()
            for q, sample in zip(
                solutions.q[solutions.inside], solutions.sample[solutions.inside], strict=True
            ):
                gap = [np.abs(v.q - q).max() for v in found.candidates if v.sample == sample]
                assert min(gap) < 1e-5
            assert found.unreachable == 6 - len(set(solutions.sample.tolist()))
            unreachable += found.unreachable
    assert unreachable > 0


def test_retreats_end_for_every_cause():
    """Into an obstacle, out of reach and limits, and where only another branch goes on."""
    scene = load_small("bottle_on_table", 8, 24, 6).with_settings(approach=0.3)
    causes = set()
    ik, T_base_world = EaikIK(scene.arm(), 6), inverse(scene.arm().robot.T_world_base)
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        m = maker.map(method="reference")
        for index in np.argwhere(m.reason == Reason.APPROACH_BLOCKED)[::3]:
            found = maker.explain(None, None, Cell(*map(int, index)))
            for v in found.candidates:
                if v.reason == Reason.APPROACH_BLOCKED:
                    causes.add(v.failure)
                    T = T_base_world @ found.T_world_tool @ translation([0, 0, -v.retreat])
                    inside = ik.solve_sample(T, v.sample).inside
                    if v.failure:
                        expected = RetreatFailure.REACH if not len(inside) else RetreatFailure.LIMITS
                        assert v.failure == (RetreatFailure.BRANCH if inside.any() else expected)
                    assert "after" in v.why
    assert causes == {None, *RetreatFailure} - {RetreatFailure.NOT_FOUND}  # a closed form finds all


def test_the_world_stays_as_it_was():
    scene = load_small("log_two_robots", 4, 8, 4)
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        cell = Cell(*map(int, np.argwhere(maker.map().feasible)[0]))
        left, right = scene.arm("left"), scene.arm("right")
        T = translation([0, 0, 0.05]) @ scene.task().T_world_object
        world.set_arms([(left, left.home + 0.1, 0.03), (right, right.home - 0.1, 0.02)])
        world.set_object(T)
        world.margin = 0.123
        before = [c for arm in (left, right) for c in world.pairs_within(arm, 0.3)]

        def stop(share: float) -> None:
            raise Cancelled

        maker.explain("left", None, cell)
        with pytest.raises(Cancelled):
            maker.explain("left", None, cell, progress=stop)
        assert world.margin == 0.123
        assert [c for arm in (left, right) for c in world.pairs_within(arm, 0.3)] == before


def test_a_cell_of_another_grid_and_task():
    """The task need not be the scene's, the grid neither; progress ends at one."""
    scene = load_small("bottle_on_table", 6, 12, 4)
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        task = replace(scene.task(), T_world_object=translation([0.45, 0.1, 0.0]))
        grid = scene.manifold.shift(0.1)[0]
        m = maker.map(None, task, manifold=grid)
        shares: list[float] = []
        for cell in some_cells(m, 1):
            found = maker.explain(None, task, cell, manifold=grid, progress=shares.append)
            agrees_with_exact(found, m, cell)
        assert shares[-1] == 1.0


def test_on_the_command_line(capsys):
    scene = Scene.load("bottle_on_table")
    grid, arm = scene.manifold, scene.arm()
    with BulletWorld(scene) as world:
        m = MapMaker(world).map()
    for reason in (Reason.FEASIBLE, Reason.JOINT_LIMITS, Reason.SCENE_COLLISION, Reason.SURFACE_TOO_STEEP):
        roll, row, column = np.argwhere(m.reason == reason)[0]
        where = ["--h", str(grid.h[row]), "--theta", str(math.degrees(grid.theta[column]))]
        assert main(["explain", "bottle_on_table", *where, "--roll", str(180 * roll)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith(f"bottle_on_table: pick with {arm.name}, the cell at h = ")
        if reason != Reason.SCENE_COLLISION:  # among collisions the stage may be another
            assert lines[0].endswith(reason.label)
        if reason > Reason.UNREACHABLE:
            rests = [line for line in lines if line.startswith("that none is feasible rests on ")]
            assert len(rests) == (reason != Reason.FEASIBLE)
            assert len(lines) == 2 + len(rests) + int(lines[1].split()[0])
        else:
            assert "the hand rules the cell out" in lines[1]
    assert main(["explain", "bottle_on_table", "--h", "3", "--theta", "0"]) == 2
    assert "expected within [0, 0.3] m" in capsys.readouterr().err
