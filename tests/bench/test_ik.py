"""The bench of the inverse kinematics counts what is found, and says what it could not measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.bench.arms import ik
from symgrasp.ik import CompiledIK
from symgrasp.robot.catalogue import CATALOGUE

ROBOTS = {robot.name: robot for robot in CATALOGUE}


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("panda", "closed form, spherical triple"),
        ("xarm7", "closed form, spherical triple, rounded axes"),
        ("ur5", "closed form, three parallel axes"),
    ],
)
def test_every_configuration_of_a_closed_form_is_found(name, family):
    robot = ROBOTS[name]
    row = ik.measure(robot, robot.arms[0], 200)
    assert (row.found, row.poses, row.family, row.problem) == (200, 200, family, "")
    assert row.microseconds > 0
    assert "100.000 %" in row.line()


def test_what_is_not_found_is_not_counted(monkeypatch):
    """A solver that loses half of the branches."""
    robot = ROBOTS["panda"]
    solve_sample = CompiledIK.solve_sample

    def forgetful(self, T, sample):
        found = solve_sample(self, T, sample)
        return type(found)(*(part[found.branch >= 4] for part in found))

    monkeypatch.setattr(CompiledIK, "solve_sample", forgetful)
    row = ik.measure(robot, robot.arms[0], 100)
    assert 20 < row.found < 95


def test_the_solver_at_other_samples():
    arm = ik.bare_arm(ROBOTS["pr2"], ROBOTS["pr2"].arms[0])
    solver = CompiledIK(arm, 4)
    T = arm.tool_pose(ik.random_configurations(arm, 1, 0)[0])
    again = solver.at(solver.phi[2:3])
    for one, other in zip(again.solve(T)[:1], solver.solve_sample(T, 2)[:1], strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(solver.phi) == 4


@pytest.mark.parametrize(
    ("name", "seed", "which", "count"),
    [("tiago_pro", 0, 463, 20000), ("tiago_pro", 0, 17693, 20000), ("iiwa", 0, 5514, 20000)],
)
def test_beside_singular_poses(name, seed, which, count):
    """Of many random configurations, those beside which others of the same pose all but coincide."""
    arm = ik.bare_arm(ROBOTS[name], ROBOTS[name].arms[0])
    q = ik.random_configurations(arm, count, seed)[[which]]
    assert ik.recall(CompiledIK(arm, 1), q) == 1


def test_redundancy_samples_are_distinct():
    """Joints of xArm7 turn twice around: values a full turn apart would be the same to all others."""
    arm = ik.bare_arm(ROBOTS["xarm7"], ROBOTS["xarm7"].arms[0])
    solver = CompiledIK(arm, 16)
    assert arm.upper[solver.locked] - arm.lower[solver.locked] > 4 * np.pi - 1e-3
    steps = np.diff(np.append(solver.phi, solver.phi[0] + 2 * np.pi))
    np.testing.assert_allclose(steps, np.pi / 8)
    q = ik.random_configurations(arm, 1, 0)[0]
    q[solver.locked] = solver.phi[3]
    q[[0, 2]] = 4.0, -4.5  # more than half a turn
    assert ((q > arm.lower) & (q < arm.upper)).all()
    found = solver.solve_sample(arm.tool_pose(q), 3)
    apart = (found.q - q + np.pi) % (2 * np.pi) - np.pi
    same = np.abs(apart).max(axis=1) < 1e-6
    assert found.inside[same].all()
    assert np.abs(found.q[same][0]).max() <= np.pi + 1e-9  # where the limits are furthest away


def test_problems_are_rows():
    robot = ROBOTS["panda"]
    absent = replace(robot, urdf="package://no_such_package/robot.urdf")
    assert "pip install pybullet" in ik.measure(absent, robot.arms[0], 1).line()
    so101 = ROBOTS["so101"]
    shorter = replace(so101.arms[0], joints=("shoulder_pan", "elbow_flex"))
    line = ik.measure(so101, shorter, 1).line()
    assert "5 to 7 revolute joints, not 3; fewer set the position of the hand, but not the direction" in line
