"""Poses are reached inside the limits at singular poses too, and where joints stand at limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symgrasp.bench.arms.ik import bare_arm, sampled_solver
from symgrasp.bench.arms.singular import configuration_sets, reached
from symgrasp.compiling import ENTRY, njit
from symgrasp.errors import InputError
from symgrasp.ik import ArmIK, CompiledIK, solver_for
from symgrasp.ik.branches import branch_count, branches_at, new_memory
from symgrasp.poses import pose_error, rotation_about
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE
from tests.ik.redundancy import solve_at
from tests.ik.synthetic import samples

pinocchio = pytest.importorskip("pinocchio")
compiled_branches_at = njit(**ENTRY)(branches_at)

RANDOM, EACH = 200, 25

COINCIDING = {
    "gen3": [
        (-2.130289, 0, 0, 0, 0, -0.968157, -2.904427),  # straight: eight solutions are one
        (0, 1.493666, 0, 0, 0.189997, -1.282914, 0),
        (1.01911096, -0.1693124, 0, 0, 1.49208772, -1.32608859, -2.37094687),
    ],
    "alex": [
        (0.57381949, 0.0579081, -1.07171673, 0, -1.23878784, -1.53431261, -2.59528114),  # of another turn
        (-2.65529475, 2.37532398, -0.63816389, 0, 0, -1.3769415, 0),
        (-1.659281, 2.231349, 0.569853, -2.278379, 0.423059, 0, 2.49752),  # joints 5 and 7 share a turn
    ],
    "tiago_pro": [
        (2.582539, -1.852228, -1.250499, 0, 0.259778, -1.47114, 0),
        (0, -1.962264, 0, 0, 0, -1.542185, 0),
    ],
    "talos": [  # the elbow nearly straight: rounding puts a joint 6e-4 beyond its limit
        (-0.2944493040640319, 0.06761125495410407, 2.425970940336729, -4.852514633338589e-07,
         -1.503337039099702, 1.1057436881170941, 0.0032119816643603194),
    ],
    "pr2": [  # less so, with a joint at its limit: 1e-9 beyond
        (-0.3808995064810917, 1.3588764992196132, -0.8, -0.000987337796957366,
         2.902554148125944, -0.6178229980228949, 2.1544740156717914),
    ],
    "romeo": [
        (1.552876895770156, 0.0006669341903336456, -2.0944, -0.0071830319791563735,
         -1.5984286714935592, 0.4020327231743382, -0.4046264196865378),
        (1.7203767970586796, 0.8102502915039309, -2.0944, -0.00041813462683037983,
         -2.3489611119353766, 0.32001155921584595, -0.6084351328412974),
    ],
}  # fmt: skip
"""Configurations at which several solutions coincide, or nearly, or any value of a joint does."""


def solver_of(name: str) -> ArmIK:
    robot = next(robot for robot in CATALOGUE if robot.name == name)
    try:
        return sampled_solver(solver_for(bare_arm(robot, robot.arms[0]), 1))
    except InputError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("name", [robot.name for robot in CATALOGUE])
def test_every_pose_is_reached_inside_the_limits(name):
    """Of random joints, with each about zero or several at zero, and with each at its limits."""
    ik = solver_of(name)
    for kind, q in configuration_sets(ik.arm, RANDOM, EACH, 1):
        lost = q[~reached(ik, q)]
        assert not len(lost), f"{kind}: {len(lost)} of {len(q)} lost, the first {lost[0].tolist()}"


@pytest.mark.parametrize("name", COINCIDING)
def test_poses_where_solutions_coincide(name):
    """They are reached inside the limits, by the kinematics of Pinocchio."""
    ik = solver_of(name)
    model, data, tool, place = pinocchio_arm(name, ik)
    for q in COINCIDING[name]:
        full = place(np.array(q, dtype=float))
        pinocchio.framesForwardKinematics(model, data, full)
        target = data.oMf[tool].homogeneous.copy()
        T = ik.arm.tool_pose(np.array(q, dtype=float))
        found = solve_at(ik, T, float(q[ik.locked]))
        inside = found.q[found.inside]
        assert len(inside), q
        for other in inside:
            assert ((other >= ik.arm.lower) & (other <= ik.arm.upper)).all()
            pinocchio.framesForwardKinematics(model, data, place(other))
            np.testing.assert_allclose(data.oMf[tool].homogeneous, target, atol=1e-6)


def pinocchio_arm(name: str, ik: ArmIK):
    """Return a robot in Pinocchio, its data, the frame of the tool, and how joint values are put in."""
    robot = next(robot for robot in CATALOGUE if robot.name == name)
    path = resolve(robot.urdf, Path())
    assert path
    model = pinocchio.buildModelFromUrdf(str(path))

    def place(q: np.ndarray) -> np.ndarray:
        full = pinocchio.neutral(model)
        for joint, value in zip(ik.arm.joint_names, q, strict=True):
            at = model.joints[model.getJointId(joint)]
            full[at.idx_q : at.idx_q + at.nq] = value if at.nq == 1 else (np.cos(value), np.sin(value))
        return full

    return model, model.createData(), model.getFrameId(robot.arms[0].tool), place


@pytest.mark.parametrize("elbow", [1e-6, 1e-9, 0.0])
def test_a_straight_elbow_by_the_kinematics_of_pinocchio(elbow):
    ik = solver_of("iiwa")
    arm, robot = ik.arm, next(robot for robot in CATALOGUE if robot.name == "iiwa")
    path = resolve(robot.urdf, Path())
    assert path
    model = pinocchio.buildModelFromUrdf(str(path))
    data, tool = model.createData(), model.getFrameId(robot.arms[0].tool)
    chance = np.random.default_rng(3)
    for row in samples(arm, 50, 2):
        row[[1, 3, 5]] = np.where(chance.random(3) < 0.5, chance.uniform(-elbow, elbow, 3), row[[1, 3, 5]])
        pinocchio.framesForwardKinematics(model, data, row)
        T = data.oMf[tool].homogeneous
        found = solve_at(ik, T, float(row[ik.locked]))
        assert found.inside.any()
        for q in found.q[found.inside]:
            assert ((q >= arm.lower) & (q <= arm.upper)).all()
            pinocchio.framesForwardKinematics(model, data, q)
            np.testing.assert_allclose(data.oMf[tool].homogeneous, T, atol=1e-6)


def test_all_of_a_family_is_listed_of_an_arm_without_redundancy():
    """Whichever angle joint 6 has, which shares a turn with joints 2, 3 and 4, a configuration is near it."""
    ik = solver_of("ur5")
    q = np.array([3.056229498575579, -1.208625756800063, 1.837573042928109, -2.343996598569206, 0.0, 0.0])
    T = ik.arm.tool_pose(q)
    found = ik.solve(T)
    assert found.inside.all()
    position, rotation = pose_error(ik.arm.tool_pose(found.q), T)
    assert max(position.max(), rotation.max()) < 1e-6
    of_family = found.q[np.abs(found.q[:, 4]) < 1e-6]
    elbow_up = of_family[of_family[:, 2] > 0]
    angles = np.sort(np.mod(elbow_up[:, 5], 2 * np.pi))
    assert np.diff(angles, append=angles[0] + 2 * np.pi).max() < np.radians(12)


@pytest.mark.parametrize("off", [1e-10, -1e-10, 5e-10, -5e-10])
@pytest.mark.parametrize("name", ["z1", "j2s6", "xarm6"])
def test_a_joint_at_a_limit_whose_pose_is_rounded(name, off):
    """Each joint at each limit: the pose turned by what maps round it by is reached inside the limits."""
    ik = solver_of(name)
    arm = ik.arm
    kind, rows = list(configuration_sets(arm, 1, 5, 5))[-1]
    assert kind == "one at a limit"
    turn = np.eye(4)
    turn[:3, :3] = rotation_about(np.array([0.0, 0.6, 0.8]), off)
    for q in rows:
        T = arm.tool_pose(q) @ turn
        found = ik.solve(T)
        inside = found.q[found.inside]
        assert len(inside), q.tolist()
        assert ((inside >= arm.lower) & (inside <= arm.upper)).all()
        position, rotation = pose_error(arm.tool_pose(inside), T)
        assert max(position.max(), rotation.max()) < 1e-6


@pytest.mark.parametrize("name", ["pr2", "romeo", "ur5", "z1", "xarm7", "tiago_pro", "alex"])
def test_an_answer_does_not_depend_on_what_is_left_out(name):
    """Bit for bit, with branches outside the limits left out early or not, at singular poses."""
    ik = solver_of(name)
    assert isinstance(ik, CompiledIK)
    for _, q in configuration_sets(ik.arm, 1, 10, 3):
        at = ik if ik.locked is None else ik.at(q[:, ik.locked])
        for k, T in enumerate(ik.arm.tool_pose(q)):
            every, early = (rows_inside(at, 0 if ik.locked is None else k, T, only) for only in (False, True))
            np.testing.assert_array_equal(early[0], every[0])
            np.testing.assert_array_equal(early[1], every[1])


def rows_inside(ik: CompiledIK, k: int, T: np.ndarray, inside_only: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the configurations inside the limits at a sample, and which branches they are."""
    count = branch_count(ik.chain)
    q, exists, inside = (
        np.empty((count, ik.arm.dof)),
        np.empty(count, dtype=bool),
        np.empty(count, dtype=bool),
    )
    T = np.ascontiguousarray(T)
    compiled_branches_at(ik.chain, k, T, inside_only, q, exists, inside, new_memory(ik.arm.dof))
    return q[inside], np.flatnonzero(inside)
