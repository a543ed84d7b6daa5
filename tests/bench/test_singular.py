"""What `symgrasp bench singular` counts."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.bench.arms.ik import bare_arm
from symgrasp.bench.arms.singular import NEAR_ZERO, configuration_sets, measure, reached, summary
from symgrasp.ik import ArmIK, solver_for
from symgrasp.robot.catalogue import CATALOGUE

UR5 = next(robot for robot in CATALOGUE if robot.name == "ur5")


@pytest.fixture(scope="module")
def ik() -> ArmIK:
    solver = solver_for(bare_arm(UR5, UR5.arms[0]), 1)
    assert isinstance(solver, ArmIK)
    return solver


def test_the_sets_are_inside_the_limits_and_what_their_names_say(ik):
    arm, sets = ik.arm, dict(configuration_sets(ik.arm, 30, 5, 0))
    assert all(((q >= arm.lower) & (q <= arm.upper)).all() for q in sets.values())
    for most in NEAR_ZERO:
        assert (np.abs(sets[f"one within {most:g}"]).min(axis=1) <= most).all()
    assert ((sets["several at 0"] == 0.0).sum(axis=1) > 1).mean() > 0.5
    at_limit = (sets["one at a limit"] == arm.lower) | (sets["one at a limit"] == arm.upper)
    assert at_limit.any(axis=1).all()
    assert {len(q) for q in sets.values()} == {30, 60}


def test_a_pose_outside_the_limits_is_not_reached(ik):
    arm = ik.arm
    q = np.tile(arm.upper, (3, 1)) * 0.3
    assert reached(ik, q).all()
    kept = arm.upper.copy(), arm.lower.copy()
    arm.lower, arm.upper = q[0] + 0.1, q[0] + 0.2
    try:
        narrower = solver_for(arm, 1)
        assert isinstance(narrower, ArmIK)
        assert not reached(narrower, q).any()
    finally:
        arm.upper, arm.lower = kept


def test_a_row_and_the_summary(ik):
    row = measure(UR5, UR5.arms[0], 50)
    assert row.name == "ur5"
    assert row.line().startswith("ur5 ")
    lines = list(summary([row, row]))
    assert lines[0] == "random: 100 of 100 reached inside the limits, 100.0000 %"
    assert len(lines) == len(row.counts)
