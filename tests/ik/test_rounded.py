"""Arms whose URDF rounds its angles: the closed form of axes where they are meant to be, ended by Newton."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import ssik
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik import CompiledIK
from symgrasp.ik.branches import branch_count, branches_at, new_memory
from symgrasp.poses import pose_error, rotation_about
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.robot.hand import Hand
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot
from tests.ik.redundancy import solve_at
from tests.ik.rounding import rounded
from tests.ik.synthetic import distance, synthetic

compiled_branches_at = njit(**ENTRY)(branches_at)

X, Y, Z = np.eye(3)
ARMS = {
    # PR2's axes, a Panda's with its elbow, a UR5's, and those of a 6-joint arm whose wrist is spherical.
    "pr2": synthetic(
        [Z, Y, X, Y, X, Y, X],
        [[0, 0, 0], [0.1, 0, 0], [0, 0, 0], [0.4, 0, 0], [0, 0, 0], [0.32, 0, 0], [0, 0, 0], [0.18, 0, 0]],
    ),
    "panda": synthetic(
        [Z, Y, Z, -Y, Z, -Y, -Z],
        [[0, 0, 0.33], [0, 0, 0], [0, 0, 0.32], [0.08, 0, 0], [-0.08, 0, 0.38], [0, 0, 0], [0.09, 0, 0],
         [0, 0, -0.2]],
    ),
    "ur5": synthetic(
        [Z, Y, Y, Y, -Z, Y],
        [[0, 0, 0.089], [0, 0.136, 0], [0.425, -0.12, 0], [0.392, 0, 0], [0, 0.093, 0], [0, 0, -0.095],
         [0, 0.082, 0]],
    ),
    # A leaning base, an elbow that turns the other way, a wrist whose axes are not perpendicular.
    "skew": synthetic(
        [Z + 0.3 * Y, Y, -Y, Y, X + 0.3 * Z, Z + 0.4 * Y],
        [[0, 0, 0.2], [0, 0.1, 0], [0.4, 0.1, 0], [0.3, 0, 0.1], [0, 0.1, 0], [0, 0, 0], [0.1, 0, 0]],
    ),
    "six": synthetic(
        [Z, Y, Y, X, Y, X],
        [[0, 0, 0.3], [0, 0, 0], [0.4, 0, 0], [0.35, 0, 0.03], [0, 0, 0], [0, 0, 0], [0.1, 0, 0]],
    ),
}  # fmt: skip


def least_singular_value(arm: Arm, q: np.ndarray, locked: int | None) -> float:
    """How far the free joints are from a singular pose."""
    rotation, position, twists = np.eye(3), arm.P[0], []
    for k, axis in enumerate(arm.H):
        turned = rotation @ axis
        twists.append(np.concatenate([np.cross(turned, -position), turned]))
        rotation = rotation @ rotation_about(axis, q[k])
        position = position + rotation @ arm.P[k + 1]
    J = np.array(twists)
    J[:, :3] += np.cross(J[:, 3:], position)
    return float(np.linalg.svd(J if locked is None else np.delete(J, locked, axis=0))[1][-1])


def found(ik: CompiledIK, q: np.ndarray) -> bool:
    """Whether a solution is there, as exactly as one that misses the pose by 1e-8 (m, rad) can be.

    Beside singular poses joints move by much more than the tool does.
    """
    phi = 0.0 if ik.locked is None else float(q[ik.locked])
    solutions = solve_at(ik, ik.arm.tool_pose(q), phi)
    away = distance(solutions.q[solutions.inside], q).min(initial=np.inf)
    return bool(away < 1e-5 or away < 1e-8 / least_singular_value(ik.arm, q, ik.locked))


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(list(ARMS)), st.integers(4, 6), st.integers(0, 2**32 - 1))
def test_recall(name, digits, seed):
    """Every random configuration is found, but for those that rounding makes singular."""
    rng = np.random.default_rng(seed)
    arm = rounded(ARMS[name], digits, rng)
    ik = CompiledIK(arm, 1)
    for q in rng.uniform(arm.lower, arm.upper, (40, arm.dof)):
        assert found(ik, q) or least_singular_value(arm, q, ik.locked) < 100 * 10.0**-digits


@settings(deadline=None, max_examples=20)
@given(st.sampled_from(list(ARMS)), st.integers(3, 6), st.integers(0, 2**32 - 1))
def test_every_solution_reaches_the_pose(name, digits, seed):
    rng = np.random.default_rng(seed)
    arm = rounded(ARMS[name], digits, rng)
    ik = CompiledIK(arm, 4)
    for T in arm.tool_pose(rng.uniform(arm.lower, arm.upper, (20, arm.dof))):
        solutions = ik.solve(T)
        position, rotation = pose_error(arm.tool_pose(solutions.q), T)
        # Axes that meet within 1e-8 m count as exact, and are off by about that.
        most = 2e-9 if ik.chain.joint[9] else 1e-7
        assert max(position.max(initial=0.0), rotation.max(initial=0.0)) < most
        within = (solutions.q >= arm.lower) & (solutions.q <= arm.upper)
        np.testing.assert_array_equal(within.all(axis=1), solutions.inside)
        if ik.locked is not None:
            np.testing.assert_allclose(solutions.q[:, ik.locked], ik.phi[solutions.sample], atol=1e-12)


@pytest.mark.parametrize("name", ARMS)
def test_the_same_poses_are_in_reach_as_of_the_exact_arm(name):
    """But for those within the rounding of the limit of the reach, of which there is hardly any."""
    rng = np.random.default_rng(0)
    exact = ARMS[name]
    arm = rounded(exact, 6, rng)
    one, other = CompiledIK(exact, 4), CompiledIK(arm, 4)
    assert one.locked == other.locked
    differ = reached = 0
    # Half of the poses are of arms with joints beyond their limits, and half of those further out.
    for q in rng.uniform(1.5 * exact.lower, 1.5 * exact.upper, (300, exact.dof)):
        T = exact.tool_pose(q)
        T[:3, 3] *= rng.uniform(0.8, 1.4)
        a, b = one.solve(T), other.solve(T)
        reached += len(a.q) > 0
        differ += (len(a.q) > 0, a.inside.any()) != (len(b.q) > 0, b.inside.any())
    assert 60 < reached < 295
    assert differ <= 1


@pytest.mark.parametrize("name", ARMS)
def test_at_the_limit_of_the_reach(name):
    """A straight arm, moved back by less than the rounding and by a little more: both branches are there."""
    rng = np.random.default_rng(1)
    arm = rounded(ARMS[name], 6, rng)
    ik = CompiledIK(arm, 1)
    elbow = {"pr2": 3, "panda": 3, "ur5": 2, "skew": 2, "six": 2}[name]
    for bend in (1e-4, 1e-3, 1e-2):
        hits = 0
        for q in rng.uniform(-1.5, 1.5, (30, arm.dof)):
            q[elbow] = bend * rng.choice([-1, 1])
            T = arm.tool_pose(q)
            solutions = solve_at(ik, T, 0.0 if ik.locked is None else float(q[ik.locked]))
            hits += len(solutions.q) > 0
        assert hits == 30


@pytest.mark.parametrize("name", ARMS)
def test_an_answer_does_not_depend_on_what_is_left_out(name):
    """Branches outside the limits are left out early; those that remain are the same, bit for bit."""
    rng = np.random.default_rng(2)
    arm = rounded(ARMS[name], 4, rng)
    arm.lower, arm.upper = np.full(arm.dof, -1.8), np.full(arm.dof, 1.8)
    ik = CompiledIK(arm, 1)
    shape = (branch_count(ik.chain), arm.dof)
    for T in arm.tool_pose(rng.uniform(-1.9, 1.9, (300, arm.dof))):
        answers = []
        for inside_only in (False, True):
            q, exists, inside = (
                np.empty(shape),
                np.empty(shape[0], dtype=bool),
                np.empty(shape[0], dtype=bool),
            )
            compiled_branches_at(ik.chain, 0, T, inside_only, q, exists, inside, new_memory(arm.dof))
            answers.append((q[inside], inside))
        np.testing.assert_array_equal(answers[0][1], answers[1][1])
        np.testing.assert_array_equal(answers[0][0], answers[1][0])


def test_xarm7_against_ssik():
    """Its URDF gives a quarter turn as 1.5708."""
    robot = next(robot for robot in CATALOGUE if robot.name == "xarm7")
    path = resolve(robot.urdf, Path())
    assert path
    model = RobotModel(path)
    bare = Hand("bare", (), (), {}, 0.0, 0.1, 0.0, 0.01)
    arm = Arm("xarm7", Robot("xarm7", model, np.eye(4), model.default_values()), "link_eef", bare)
    ik = CompiledIK(arm, 1)
    other = ssik.Manipulator.from_urdf(path, base="link_base", ee="link_eef")
    assert not ik.complete  # near a singular pose it may miss one
    rng = np.random.default_rng(3)
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    for q in rng.uniform(lower, upper, (30, arm.dof)):
        assert found(ik, q)
    for q in rng.uniform(lower, upper, (3, arm.dof)):
        T = arm.tool_pose(q)
        theirs = np.array([solution.q for solution in other.solve(T)])
        assert len(theirs) > 20
        at = ik.at(theirs[:, ik.locked])
        for k, q_theirs in enumerate(theirs):
            assert distance(at.solve_sample(T, k).q, q_theirs).min(initial=np.inf) < 1e-4


def gen3(offset: float) -> Arm:
    """Return a Kinova Gen3, of which three axes of the wrist miss each other by an offset (m)."""
    return synthetic(
        [-Z, Y, -Z, Y, -Z, Y, -Z],
        [[0, 0, 0.15643], [0, -0.005375, 0.12838], [0, -0.006375, 0.21038], [0, -0.006375, 0.21038],
         [0, -0.006375, 0.20843], [0, -offset, 0.10593], [0, -offset, 0.10593], [0, 0, 0.061525]],
    )  # fmt: skip


def test_what_rounding_explains():
    """Real offsets of the size that angles of two decimals leave, but between axes that are not rounded."""
    assert CompiledIK(gen3(0.0), 1).family == "closed form, spherical triple"
    assert CompiledIK(gen3(5e-6), 1).family == "closed form, spherical triple, rounded axes"
    assert CompiledIK(gen3(0.00017505), 1).family == "search, two axes that meet"


def test_recall_with_offsets_of_less_than_a_millimetre():
    arm, lost = gen3(0.00017505), 0
    ik = CompiledIK(arm, 1)
    for q in np.random.default_rng(4).uniform(arm.lower, arm.upper, (1000, 7)):
        lost += not found(ik, q)
    assert lost <= 1


def test_axes_that_only_angles_of_two_decimals_explain():
    """Where nothing meets but for them, the closed form of what is meant still serves."""
    P = ARMS["ur5"].P.copy()
    P[[1, 5], 0] += 1e-4
    arm = synthetic(ARMS["ur5"].H, P)
    ik = CompiledIK(arm, 1)
    assert ik.family == "closed form, three parallel axes, rounded axes"
    q = np.random.default_rng(5).uniform(arm.lower, arm.upper, (300, 6))
    assert sum(found(ik, row) for row in q) > 290
