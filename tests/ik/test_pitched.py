"""Arms of five joints: where their hands are by the URDF alone, and what a search of no closed form finds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from symgrasp.bench.arms.ik import random_configurations, recall, sampled_solver
from symgrasp.bench.arms.numerical import reach
from symgrasp.errors import UrdfError
from symgrasp.ik import ArmIK, CompiledIK, GridSolvers, PitchedIK, solver_for
from symgrasp.ik.arm_ik import Lock
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.poses import from_position_rpy, inverse, translation
from symgrasp.robot.assembly import Frame, Mount
from symgrasp.robot.hand import HANDS, Hand
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import AZIMUTH, PITCH, Arm, Robot

URDF = Path(__file__).parent.parent / "data" / "five_joints.urdf"

GRID = Manifold(Profile([[0.0, 0.025], [0.2, 0.025], [0.3, 0.04], [0.6, 0.04]]), 6, 12)

OFFSETS = {"on the axis": (0.0, 0.0, 0.2), "beside it": (0.0, 0.008, 0.2), "across": (0.008, 0.0, 0.2)}
"""Where the tool is from the end of the arm: on the axis of its last joint, beside it in the direction that
the fingers close in, or across."""

HAND = replace(
    HANDS["wsg50"],
    links=(),
    touch_links=(),
    joints={},
    tool=None,
    urdf=None,
    finger_depth=0.035,
    palm_width=0.0,
)


def arm_with(name: str, hand: Hand = HAND) -> Arm:
    """Return an arm with a hand that has no links."""
    model = RobotModel(URDF, (Mount(Frame("flange", OFFSETS[name]), None, "tool"),))
    return Arm("arm", Robot("arm", model, np.eye(4), model.default_values()), "tool", hand)


def tool_by_urdf(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return the pose (4, 4) of the tool link, by the forward kinematics of the whole URDF."""
    return arm.robot.model.forward(arm.robot_values(q))[arm.robot.model.link_index("tool")]


@pytest.mark.parametrize("name", OFFSETS)
@pytest.mark.parametrize("roll", [0, 1])
@pytest.mark.parametrize("row", [1, 4])
def test_the_fingers_stay_on_both_sides_of_the_object(name, roll, row):
    """Whatever the pitch, the points of the object that are furthest apart across are where they are without.

    In row 4 the hand stands off the object's axis, which is thicker there than the fingers are deep.
    """
    shift = 0.004
    hand = replace(HAND, shift=((0.0, shift), (0.2, shift)))
    standoff, radius = (0.0, 0.025) if row == 1 else (0.005, 0.04)
    arm = arm_with(name, hand).grasping(GRID, row, roll)
    axes = arm.P
    arm = arm.pitching((shift, standoff), (-1.2, 1.2), 0.2)
    np.testing.assert_allclose(arm.P, axes)  # those that the grasp asks for itself
    at = arm.hand.tool_poses(GRID, np.eye(4))[roll, row, 0]  # in the frame of the object
    way = 1.0 if roll == 0 else -1.0
    for q in random_configurations(arm, 20, 0):
        T_tool_object = inverse(tool_by_urdf(arm, q)) @ arm.tool_pose(q) @ inverse(at)
        axis = T_tool_object[:3, 2]
        assert axis == pytest.approx(way * np.array([np.cos(q[PITCH]), 0.0, -np.sin(q[PITCH])]), abs=1e-9)
        middle = T_tool_object @ [0, 0, GRID.h[row], 1]
        assert middle[:3] == pytest.approx([0, shift, standoff], abs=1e-9)
        azimuth = GRID.theta[0] - way * q[AZIMUTH]
        for side in (-1, 1):
            across = azimuth + side * np.pi / 2
            point = T_tool_object @ [radius * np.cos(across), radius * np.sin(across), GRID.h[row], 1]
            assert point[:3] == pytest.approx([0, shift + side * way * radius, standoff], abs=1e-9)


@pytest.mark.parametrize("name", OFFSETS)
def test_recall(name):
    """Random configurations are found, in the middle of a cell and at the value that is sampled."""
    arm = arm_with(name).pitching((0.0, 0.01), (-1.2, 1.2), 0.1)
    ik = solver_for(arm, 4)
    assert isinstance(ik, PitchedIK)
    assert ik.complete
    q = random_configurations(arm, 300, 0)
    assert recall(sampled_solver(ik), q) >= 299
    q[:, AZIMUTH] = 0.0
    middle = ik.parts[0][0]
    assert middle.locked == AZIMUTH
    assert recall(middle, q) == 300


@pytest.mark.parametrize("name", ["on the axis", "beside it"])
def test_nothing_within_a_cell_is_missed_at_the_value_of_a_sample(name):
    """What a search from many starts finds is found at its own value, and found poses are reached."""
    arm, rng = arm_with(name), np.random.default_rng(0)
    solvers = GridSolvers(arm, GRID, lambda own: solver_for(own, 8))
    found = missed = 0
    for k in range(30):
        lying = from_position_rpy(rng.uniform([0.3, -0.2, 0.0], [0.5, 0.2, 0.4]), rng.uniform(-1.6, 1.6, 3))
        T_object = lying @ translation([0.0, 0.0, -0.3])
        roll, row, column = k % 2, 1 + k % 4, k % GRID.angles
        T = arm.hand.tool_poses(GRID, T_object)[roll, row, column]
        ik = solvers.at(row, roll)
        own = ik.arm
        for q in ik.solve(T).q:
            assert np.allclose(own.tool_pose(q), T, atol=2e-6)
            assert abs(q[AZIMUTH]) <= 0.5 * GRID.dtheta
        if (q := reach(own, T, rng)) is not None:
            found += 1
            sampled = sampled_solver(ik)
            assert sampled.locked is not None
            missed += not sampled.at(q[[sampled.locked]]).solve(T).inside.any()
    assert found > 2
    assert missed == 0


def test_samples_mean_the_same_in_every_row():
    """Those outside of what a row allows are left out, and the others keep their numbers."""
    arm = arm_with("on the axis")
    wide, narrow = (
        solver_for(arm.pitching((0.0, 0.0), limits, 0.1), 9) for limits in ((-1.7, 1.7), (-0.5, 0.9))
    )
    assert isinstance(wide, PitchedIK)
    assert isinstance(narrow, PitchedIK)
    np.testing.assert_array_equal(wide.phi, narrow.phi)
    numbers = narrow.parts[1][1]
    assert 0 < len(numbers) < 9
    q = arm.lower + 0.4 * (arm.upper - arm.lower)
    for sample in numbers:
        q[PITCH], q[AZIMUTH] = wide.phi[sample], 0.05
        T = narrow.arm.tool_pose(q)
        assert set(narrow.solve(T).sample) <= {0, *numbers}
        for ik in (wide, narrow):
            alone = ik.solve_sample(T, int(sample))
            assert (alone.sample == sample).all()
            assert np.abs(alone.q - q).max(axis=1).min() < 1e-6
    with pytest.raises(ValueError, match="outside of the limits"):
        narrow.solve_sample(np.eye(4), 1)


@pytest.mark.parametrize("name", OFFSETS)
def test_steep_pitches_are_sampled_too(name):
    """Near ±90° the last two axes are nearly parallel; at 90° they are, and only a search finds anything."""
    arm = arm_with(name).pitching((0.0, 0.0), (-1.7, 1.7), 0.1)
    ik = solver_for(arm, 64)
    assert isinstance(ik, PitchedIK)
    assert len(ik.parts) == 2
    sampled, numbers = ik.parts[1]
    assert len(numbers) == 62  # the samples that are inside the limits
    assert sampled.family.startswith("closed form")
    rng = np.random.default_rng(0)
    configurations = rng.uniform(arm.lower, arm.upper, (len(numbers), arm.dof))
    for k, q in enumerate(configurations):
        q[PITCH] = sampled.phi[k]
        found = sampled.solve_sample(arm.tool_pose(q), k).q
        assert np.abs(found - q).max(axis=1).min() < 1e-5
    upright = sampled.at(np.array([0.2, 0.5, np.pi / 2]))
    assert not upright.complete
    configurations[:, PITCH] = np.pi / 2
    found = sum(len(upright.solve_sample(arm.tool_pose(q), 2).q) > 0 for q in configurations)
    assert found >= 60 if upright.family.startswith("search") else found == 0


def test_only_azimuths_beyond_the_cell_are_out_of_reach():
    """A pitch beyond its limits is a joint limit."""
    arm = arm_with("on the axis")
    q = np.array([0.1, 0.5, -0.3, 0.4, 0.2, 0.6, 0.05])
    T = arm.tool_pose(q)
    within = lambda pitch, azimuth: solver_for(arm.pitching((0.0, 0.0), (-pitch, pitch), azimuth), 1)  # noqa: E731
    sampled = sampled_solver(within(1.0, 0.1)).at(q[[PITCH]])
    assert sampled.solve(T).inside.any()
    assert not len(sampled_solver(within(1.0, 0.04)).at(q[[PITCH]]).solve(T).q)
    q[AZIMUTH] = 0.0
    outside = within(0.5, 0.1).solve(arm.tool_pose(q))
    known = np.abs(outside.q - q).max(axis=1) < 1e-6
    assert known.any()
    assert not outside.inside[known].any()


def test_fewer_joints_are_refused():
    model = RobotModel(URDF, (Mount(Frame("flange", OFFSETS["on the axis"]), None, "tool"),))
    robot = Robot("arm", model, np.eye(4), model.default_values())
    with pytest.raises(UrdfError, match="5 to 7 revolute joints, not 3; fewer set the position of the hand"):
        Arm("arm", robot, "tool", HAND, frozenset({"pan", "lift"}))


def test_six_joints_are_as_they_were():
    """Nothing but five joints is pitched."""
    model = RobotModel(URDF.with_name("three_parallel.urdf"))
    arm = Arm("arm", Robot("arm", model, np.eye(4), model.default_values()), "flange", HAND)
    assert not arm.pitched
    assert arm.grasping(GRID, 0, 0) is arm
    assert isinstance(solver_for(arm, 1), ArmIK)


@pytest.mark.parametrize("beside", [1e-2, 1e-3, 1e-4])
def test_beside_the_pitch_at_which_axes_are_parallel(beside):
    """Straight above or below an object the azimuth of a hand does what the last joint does."""
    arm = arm_with("across")
    solver = CompiledIK(arm, 1, lock=Lock(PITCH, np.zeros(1)))
    q = random_configurations(arm, 300, 0)
    q[:, PITCH] = np.sign(q[:, PITCH]) * np.pi / 2 + np.sign(q[:, 0]) * beside
    assert recall(solver, q) == len(q)
