"""The closed form against forward kinematics, against random configurations, and against ssik."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import ssik

from symgrasp.errors import UrdfError
from symgrasp.poses import from_position_quat, pose_error
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot
from tests.conftest import load_small
from tests.ik.eaik import EaikIK
from tests.ik.redundancy import solve_at
from tests.robot.test_robot import KUKA


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_small("soda_can").arm()


@pytest.fixture(scope="module")
def kuka() -> Arm:
    model = RobotModel(KUKA)
    hand = load_small("soda_can").arm().hand
    bare = replace(hand, links=(), touch_links=(), joints={})
    return Arm("kuka", Robot("kuka", model, np.eye(4), model.default_values()), "lbr_iiwa_link_7", bare)


def distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Largest joint difference modulo full turns."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


@pytest.mark.parametrize("name", ["arm", "kuka"])
def test_recall(name, request):
    """The branches at q's own locked value contain q, for every one of thousands of q."""
    arm: Arm = request.getfixturevalue(name)
    ik = EaikIK(arm, 1)
    assert ik.locked is not None
    q = np.random.default_rng(0).uniform(arm.lower, arm.upper, (3000, arm.dof))
    worst = max(
        distance(solve_at(ik, arm.tool_pose(row), row[ik.locked]).q, row).min(initial=np.inf) for row in q
    )
    assert worst < 1e-5


def test_every_solution_reaches_the_pose(arm):
    ik = EaikIK(arm, 16)
    rng = np.random.default_rng(1)
    checked = 0
    for _ in range(200):
        T = from_position_quat(rng.uniform([-0.8, -0.8, 0], [0.8, 0.8, 1]), rng.normal(size=4))
        solutions = ik.solve(T)
        position, rotation = pose_error(arm.tool_pose(solutions.q), T)
        assert (position <= 1e-6).all()
        assert (rotation <= 1e-6).all()
        np.testing.assert_allclose(solutions.q[:, ik.locked], ik.phi[solutions.sample], atol=1e-12)
        within = (solutions.q >= arm.lower) & (solutions.q <= arm.upper)
        np.testing.assert_array_equal(within.all(axis=1), solutions.inside)
        assert (np.diff(solutions.sample) >= 0).all()
        checked += len(solutions.q)
    assert checked > 2000


def test_redundancy_samples_are_centres_of_equal_parts(arm):
    ik = EaikIK(arm, 4)
    lower, upper = arm.lower[ik.locked], arm.upper[ik.locked]
    np.testing.assert_allclose(ik.phi, lower + (upper - lower) * np.array([1, 3, 5, 7]) / 8)


def test_one_sample_is_the_same_as_its_part_of_all(arm):
    ik = EaikIK(arm, 8)
    T = arm.tool_pose([0.1, -0.5, 0.2, -2.0, 0.3, 1.5, 0.4])
    every = ik.solve(T)
    for k in range(8):
        np.testing.assert_array_equal(ik.solve_sample(T, k).q, every.q[every.sample == k])


def test_ssik_agrees_on_reachability(arm):
    """What either solver reaches the other reaches too, at the value of the locked joint it used."""
    other = ssik.Manipulator.from_urdf(arm.robot.model.path, base="panda_link0", ee=arm.tool)
    ik = EaikIK(arm, 64)
    rng = np.random.default_rng(2)
    reached = missed = 0
    for _ in range(150):
        T = from_position_quat(rng.uniform([-0.9, -0.9, -0.2], [0.9, 0.9, 1.1]), rng.normal(size=4))
        theirs = [np.asarray(s.q) for s in other.solve(T)]
        ours = ik.solve(T)
        for q in theirs:
            mine = solve_at(ik, T, float(q[ik.locked]))
            assert distance(mine.q[mine.inside], q).min(initial=np.inf) < 1e-4
        for q in ours.q[ours.inside]:
            np.testing.assert_allclose(other.fk(q), T, atol=1e-6)
        if ours.inside.any() and not theirs:
            # They sample the redundancy on a grid of their own; ask again near our answer.
            q = ours.q[ours.inside][0]
            assert other.solve(T, q_seed=q, allow_refinement=True), q
        reached += bool(ours.inside.any())
        missed += not theirs and not ours.inside.any()
    assert reached > 20
    assert missed > 20


def test_an_arm_of_which_no_axes_meet(kuka):
    skewed = object.__new__(Arm)
    skewed.__dict__.update(kuka.__dict__)
    rng = np.random.default_rng(3)
    H = rng.normal(size=(7, 3))
    skewed.H = H / np.linalg.norm(H, axis=1, keepdims=True)
    skewed.P = rng.normal(size=(8, 3))
    with pytest.raises(UrdfError, match="meet in a point"):
        EaikIK(skewed, 4)
