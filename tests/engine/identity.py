"""What it means that two ways of computing a map agree, as PyBullet says of both."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import GridSolvers
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.ik.eaik import independent_solver

TOLERANCE = 1e-6

DEPTH_TOLERANCE = 5e-4
"""PyBullet's depths (m) are that far off at times."""


def assert_same(exact: FeasibilityMap, reference: FeasibilityMap) -> None:
    """The feasible cells are identical, and so are the reasons up to OUT_OF_BALANCE."""
    assert np.array_equal(exact.feasible, reference.feasible)
    early = (reference.reason <= Reason.OUT_OF_BALANCE) | (exact.reason <= Reason.OUT_OF_BALANCE)
    assert np.array_equal(exact.reason[early], reference.reason[early])


def assert_true(
    world: BulletWorld, scene: Scene, arm: Arm, m: FeasibilityMap, cells: Iterable[np.ndarray] | None = None
) -> None:
    """Every witness is free, with the clearance it promises; every collision is true of a candidate.

    Args:
        world: a world of the scene.
        scene: the scene.
        arm: the map's arm.
        m: the map.
        cells: the cells to check; all of them if None.
    """
    samples = scene.settings.samples
    solvers = GridSolvers(arm, m.manifold, lambda own: independent_solver(own, samples))
    (holders,) = [task.arms for task in scene.tasks.values() if task.name == m.task]
    tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object)
    world.margin = scene.settings.margin
    world.set_arms(())
    world.set_object(m.T_world_object)
    for index in np.argwhere(m.reason >= Reason.SELF_COLLISION) if cells is None else cells:
        cell = Cell(*index)
        ik = solvers.at(cell.row, cell.roll)
        checker = CandidateChecker(world, ik.arm, ik, scene.settings.approach, holders=holders)
        if m.feasible[cell]:
            _check_witness(world, checker, m, cell, tools[cell])
        else:
            _check_collision(world, checker, m, cell, tools[cell])


def _check_witness(
    world: BulletWorld,
    checker: CandidateChecker,
    m: FeasibilityMap,
    cell: Cell,
    T_base_tool: np.ndarray,
) -> None:
    arm, witness = checker.arm, m.witness(cell)
    assert witness is not None
    assert (arm.lower <= witness.q).all()
    assert (witness.q <= arm.upper).all()
    assert np.allclose(arm.tool_pose(witness.q), T_base_tool, atol=TOLERANCE)
    result = checker.check(T_base_tool, witness.q, witness.sample, witness.opening)
    assert result.reason == Reason.FEASIBLE
    world.set_arm(arm, witness.q, witness.opening)
    assert 0 <= witness.clearance <= world.clearance(arm, 0.1) + TOLERANCE


def _check_collision(
    world: BulletWorld,
    checker: CandidateChecker,
    m: FeasibilityMap,
    cell: Cell,
    T_base_tool: np.ndarray,
) -> None:
    """Some candidate comes to the collision that the map names."""
    arm = checker.arm
    reason, opening = Reason(int(m.reason[cell])), float(m.opening[cell.row])
    solutions = checker.ik.solve(T_base_tool)
    inside = np.flatnonzero(solutions.inside)
    if reason == Reason.APPROACH_BLOCKED:
        reasons = (
            checker.check(T_base_tool, solutions.q[k], int(solutions.sample[k]), opening).reason
            for k in inside
        )
        assert reason in reasons
        return
    names = {m.bodies[k] for k in m.pair[cell]}
    for k in inside:
        world.set_arm(arm, solutions.q[k], opening)
        for c in world.collisions([arm]):
            if (
                c.reason == reason
                and {str(c.a), str(c.b)} == names
                and c.depth >= m.depth[cell] - DEPTH_TOLERANCE
            ):
                return
    raise AssertionError(f"no candidate of {cell} comes to this: {m.why(cell)}")
