"""The compiled closed form against EAIK, against forward kinematics, and one sample against all."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.ik import CompiledIK
from symgrasp.poses import from_position_quat, pose_error, rotation_about
from symgrasp.robot.limits import LIMIT_TOLERANCE
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from tests.conftest import load_small
from tests.ik.eaik import EaikIK
from tests.ik.redundancy import solve_at
from tests.ik.synthetic import distance, samples, synthetic

ARMS = (
    "panda",
    "iiwa",
    "backwards",
    "six",
    "pr2",
    "ur5",
    "ur5_backwards",
    "skew",
    "seven",
    "offset_ends",
    "offset_ends_backwards",
    "offset_skew",
)


def arm_of(scene: Scene, name: str) -> Arm:
    return scene.arm(name)


@pytest.mark.filterwarnings("error")
def test_joints_that_turn_without_end():
    """They have no limits to be outside of; the others keep theirs, silently."""
    x, y, z = np.eye(3)
    arm = synthetic(
        [z, y, y, x, y, x], [[0, 0, 0.3], [0, 0, 0], [0.4, 0, 0], [0.35, 0, 0.03], *[[0, 0, 0]] * 3]
    )
    endless = [0, 3, 5]
    arm.lower[endless], arm.upper[endless] = -np.inf, np.inf
    solver = CompiledIK(arm, 1)
    pose = from_position_quat([0.5, 0.1, 0.4], [0.5, 0.5, 0.5, 0.5])
    found = solver.solve(pose)
    assert len(found.q)
    inside = (found.q >= arm.lower) & (found.q <= arm.upper)
    assert np.array_equal(found.inside, inside.all(axis=1))


@pytest.fixture(scope="module")
def arms() -> dict[str, Arm]:
    scene = load_small("log_iiwa_and_panda")
    ur5 = np.array([
        [0, 0, 0.089], [0, 0.136, 0], [0.425, -0.12, 0], [0.392, 0, 0], [0, 0.093, 0], [0, 0, -0.095],
        [0, 0.082, 0],
    ])  # fmt: skip
    offset = np.array([
        [0, 0, 0.09], [0.05, 0.1, 0], [0.42, 0, 0], [0.39, 0, 0], [0, 0.1, 0], [0.05, 0, -0.09], [0, 0.08, 0],
    ])  # fmt: skip
    R0 = rotation_about(np.array([0.6, 0.0, 0.8]), 1.1)
    x, y, z = np.eye(3)
    return {
        "panda": scene.arm("panda"),
        "iiwa": scene.arm("iiwa"),
        # A wrist whose axes meet, an elbow with offsets, a shoulder of two skewed axes, on a turntable.
        "backwards": synthetic(
            [z, z + 0.3 * x, y, y, x, y, x + 0.2 * z],
            [[0, 0, 0.2], [0.1, 0, 0.1], [0, 0, 0], [0.4, 0, 0.05], [0.3, 0, 0], [0, 0, 0], [0, 0, 0],
             [0.1, 0.05, 0]],
            R0,
        ),
        "six": synthetic(
            [z, y, y, x, y, x],
            [[0, 0, 0.3], [0, 0, 0], [0.4, 0, 0], [0.35, 0, 0.03], [0, 0, 0], [0, 0, 0], [0.1, 0, 0]],
            R0,
        ),
        # PR2's arm: EAIK knows it with the third joint locked as well, but pan and lift do not meet.
        "pr2": synthetic(
            [z, y, x, y, x, y, x],
            [[0, 0, 0], [0.1, 0, 0], [0, 0, 0], [0.4, 0, 0], [0, 0, 0], [0.32, 0, 0], [0, 0, 0],
             [0.18, 0, 0]],
        ),
        # Three parallel axes, then two that meet; the same from its other end.
        "ur5": synthetic([z, y, y, y, -z, y], ur5, R0),
        "ur5_backwards": synthetic([-y, z, -y, -y, -y, -z], -ur5[::-1], R0),
        # A leaning base, an elbow that turns the other way, a wrist whose axes are not perpendicular.
        "skew": synthetic([z + 0.3 * y, y, -y, y, x + 0.3 * z, z + 0.4 * y], [
            [0, 0, 0.2], [0, 0.1, 0], [0.4, 0.1, 0], [0.3, 0, 0.1], [0, 0.1, 0], [0, 0, 0], [0.1, 0, 0]
        ]),
        # Three parallel axes; neither the first two meet nor the last two. The same from its other end.
        "offset_ends": synthetic([z, y, y, y, z, y], offset, R0),
        "offset_ends_backwards": synthetic([-y, -z, -y, -y, -y, -z], -offset[::-1], R0),
        # The same of "skew".
        "offset_skew": synthetic([z + 0.3 * y, y, -y, y, x + 0.3 * z, z + 0.4 * y], [
            [0, 0, 0.2], [0.05, 0.1, 0], [0.4, 0.1, 0], [0.3, 0, 0.1], [0, 0.1, 0], [0, 0.08, 0.02],
            [0.1, 0, 0],
        ]),
        # A UR5 on a turntable: its first joint is locked.
        "seven": synthetic([z, z + 0.3 * x, y, y, y, -z, y], [[0.1, 0, 0.2], *ur5], R0),
    }  # fmt: skip


def test_the_lock_is_chosen_so_that_the_compiled_closed_form_applies(arms):
    assert EaikIK(arms["pr2"], 1).locked == 0  # its first choices fit EAIK alone
    assert all(CompiledIK(arms[name], 1).complete for name in ARMS)


@pytest.mark.parametrize("name", ARMS)
def test_same_branches_as_eaik(name, arms):
    arm = arms[name]
    general, ik = EaikIK(arm, 4), CompiledIK(arm, 4)
    assert ik.locked == general.locked
    np.testing.assert_array_equal(ik.phi, general.phi)
    total = 0
    for T in arm.tool_pose(samples(arm, 250, 0)):
        theirs, ours = general.solve(T), ik.solve(T)
        for one, other in ((theirs, ours), (ours, theirs)):
            for q, sample, inside in zip(one.q, one.sample, one.inside, strict=True):
                same = other.sample == sample
                gaps = distance(other.q[same], q)
                assert gaps.min(initial=np.inf) < 1e-6
                assert other.inside[same][gaps.argmin()] == inside
        total += len(ours.q)
    assert total > 500


@pytest.mark.parametrize("name", ARMS)
def test_recall(name, arms):
    """The branches at q's own locked value contain q; an elbow all but straight blurs its neighbours."""
    arm = arms[name]
    ik = CompiledIK(arm, 1)
    gaps = []
    for q in samples(arm, 3000, 1):
        phi = 0.0 if ik.locked is None else float(q[ik.locked])
        gaps.append(distance(solve_at(ik, arm.tool_pose(q), phi).q, q).min(initial=np.inf))
    assert np.max(gaps) < 1e-3
    assert np.count_nonzero(np.array(gaps) > 1e-6) <= 3


@pytest.mark.parametrize("name", ARMS)
def test_recall_at_limits(name, arms):
    """Rounding puts half of what stands at a limit outside; it counts as inside, and is moved onto the limit.

    Joints that an elbow all but straight blurs by more than the tolerance are an exception.
    """
    arm = arms[name]
    ik = CompiledIK(arm, 1)
    chance = np.random.default_rng(5)
    moved, lost = 0, 0
    for q in samples(arm, 300, 6):
        limit = np.where(chance.random(arm.dof) < 0.5, arm.lower, arm.upper)
        q = np.where(chance.random(arm.dof) < 0.3, limit, q)
        q = np.where(np.abs(q) < 1e-3, arm.lower / 2, q)  # at zero the Panda's elbow lets two joints trade
        phi = 0.0 if ik.locked is None else float(q[ik.locked])
        free = np.arange(arm.dof) != ik.locked
        beyond = np.sign(q) * 0.1 * LIMIT_TOLERANCE * ((q == limit) & free)
        for pose in (arm.tool_pose(q), arm.tool_pose(q + beyond)):
            found = solve_at(ik, pose, phi)
            here = found.q[found.inside]
            lost += np.abs(here - q).max(axis=1).min(initial=np.inf) > 1e-6
            assert np.all((here >= arm.lower) & (here <= arm.upper))
            moved += int(np.any((here == arm.lower) | (here == arm.upper), axis=1).sum())
    assert moved > 200
    assert lost <= 3


@pytest.mark.parametrize("name", ARMS)
def test_what_is_beyond_a_limit_by_more_than_rounding_is_outside(name, arms):
    arm = arms[name]
    ik = CompiledIK(arm, 1)
    for k, q in enumerate(samples(arm, 100, 7)):
        j = [j for j in range(arm.dof) if j != ik.locked][k % (arm.dof - (ik.locked is not None))]
        q[j] = arm.upper[j] + 1e-6
        phi = 0.0 if ik.locked is None else float(q[ik.locked])
        found = solve_at(ik, arm.tool_pose(q), phi)
        assert not found.inside[distance(found.q, q) < 1e-7].any()


@pytest.mark.parametrize("name", ARMS)
def test_every_solution_reaches_the_pose(name, arms):
    arm = arms[name]
    ik = CompiledIK(arm, 8)
    poses = arm.tool_pose(samples(arm, 400, 2))
    found = [ik.solve(T) for T in poses]
    q, inside = np.concatenate([s.q for s in found]), np.concatenate([s.inside for s in found])
    assert len(q) > 1000
    reached = np.repeat(poses, [len(s.q) for s in found], axis=0)
    position, rotation = pose_error(arm.tool_pose(q), reached)
    assert position.max() < 1e-9
    assert rotation.max() < 1e-9
    np.testing.assert_array_equal(((q >= arm.lower) & (q <= arm.upper)).all(axis=-1), inside)


@pytest.mark.parametrize("name", ARMS)
def test_an_answer_does_not_depend_on_what_else_is_asked(name, arms):
    """Bit for bit: at all samples, at one, and of poses in another order."""
    arm = arms[name]
    ik = CompiledIK(arm, 5)
    poses = arm.tool_pose(samples(arm, 60, 3))
    every = [ik.solve(T) for T in poses]
    for k in np.random.default_rng(4).permutation(len(poses)):
        again = ik.solve(poses[k])
        for one, other in zip(again, every[k], strict=True):
            np.testing.assert_array_equal(one, other)
        for sample in range(len(ik.phi)):
            part, own = ik.solve_sample(poses[k], sample), again.sample == sample
            np.testing.assert_array_equal(part.q, again.q[own])
            np.testing.assert_array_equal(part.branch, again.branch[own])
            np.testing.assert_array_equal(part.inside, again.inside[own])


@pytest.mark.parametrize("name", ["panda", "iiwa"])
def test_out_of_reach(name, arms):
    ik = CompiledIK(arms[name], 8)
    general = EaikIK(arms[name], 8)
    rng = np.random.default_rng(5)
    empty = 0
    for _ in range(300):
        T = from_position_quat(rng.uniform([-1.4, -1.4, -0.8], [1.4, 1.4, 1.6]), rng.normal(size=4))
        ours, theirs = ik.solve(T), general.solve(T)
        assert len(ours.q) == len(theirs.q)
        empty += not len(ours.q)
    assert 30 < empty < 270


def test_aligned_axes_of_the_triple(arms):
    """With the shoulder straight, joints 1 and 3 share their work; some split of it is found."""
    arm = arms["panda"]
    ik = CompiledIK(arm, 1)
    for q in samples(arm, 100, 6):
        q[1] = 0.0
        T = arm.tool_pose(q)
        found = solve_at(ik, T, float(q[6]))
        assert (np.abs(found.q[:, [3, 4, 5]] - q[[3, 4, 5]]).max(axis=1) < 1e-5).any()
        position, _ = pose_error(arm.tool_pose(found.q), T)
        assert position.max() < 1e-6
