"""Motions along windows: the hand stays, by Pinocchio; every state is free, by the checks of Algorithm 1."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.errors import InputError, SymgraspError
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.self_motion import self_motion
from symgrasp.ik import CompiledIK, solver_for
from symgrasp.poses import inverse, pose_error
from symgrasp.reason import Reason
from symgrasp.world import open_world
from tests.conftest import load_small

pinocchio = pytest.importorskip("pinocchio")

STEP = 0.02


@pytest.mark.parametrize(("name", "task"), [("pick_pour_place", "pour"), ("log_iiwa_and_panda", "lift")])
def test_the_hand_stays_and_every_state_is_free(name, task):
    scene = load_small(name, 6, 12).with_settings(redundancy="auto")
    m = create_map(scene, task=task)
    arm = scene.arm(m.arm)
    model = pinocchio.buildModelFromUrdf(str(arm.robot.model.path))
    data, frame = model.createData(), model.getFrameId(arm.tool)
    tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object)
    tried, ik = 0, solver_for(arm, 1)
    assert isinstance(ik, CompiledIK)
    with open_world(scene) as world:
        for other in scene.robots:
            world.park(other)
        world.set_object(m.T_world_object)
        checker = CandidateChecker(world, arm, ik, 0.0, holders=scene.task(task).arms)
        for cell in map(tuple, np.argwhere(m.feasible)[:: m.feasible.sum() // 4].tolist()):
            for window in m.windows(cell):
                q = self_motion(m, cell, window, STEP)
                phi = q[:, ik.locked]
                np.testing.assert_allclose(phi[[0, -1]], [window.low, window.high], atol=1e-9)
                assert (np.diff(phi) > 0).all() or len({*phi}) == 1
                assert np.diff(phi).max() <= STEP + 1e-9
                assert (q >= arm.lower - 1e-9).all() and (q <= arm.upper + 1e-9).all()
                assert np.abs(np.diff(q, axis=0)).max() < 1.0  # no joint jumps, nor to another branch
                for row in q:
                    values = pinocchio.neutral(model)
                    for joint, value in zip(arm.joint_names, row, strict=True):
                        values[model.joints[model.getJointId(joint)].idx_q] = value
                    pinocchio.framesForwardKinematics(model, data, values)
                    assert max(pose_error(data.oMf[frame].homogeneous, tools[cell])) < 1e-6
                for row in q[1:-1]:
                    opening = float(m.opening[cell[1]])
                    assert checker.check(tools[cell], row, window.branch, opening).reason is Reason.FEASIBLE
                tried += len(q) > 5
    assert tried > 5


def test_an_arm_on_a_torso_moves_at_the_value_of_its_witness():
    scene = load_small("pr2_handover", 6, 12)
    m = create_map(scene)
    arm = scene.arm(m.arm)
    cell = tuple(np.argwhere(m.feasible)[0].tolist())
    window = max(m.windows(cell), key=lambda w: w.width)
    q = self_motion(m, cell, window)
    count = len(arm.robot.torso.joint_names) if arm.robot.torso else 0
    tools = arm.hand.tool_poses(m.manifold, m.T_world_object)[cell]
    for row in q:
        whole = np.concatenate([m.q[cell][:count], row])
        assert max(pose_error(arm.world_tool_pose(whole), tools)) < 1e-6


def test_what_is_no_motion_is_refused():
    m = create_map(load_small("pick_pour_place", 6, 12), task="pour")
    cell = tuple(np.argwhere(m.feasible)[0].tolist())
    window = m.windows(cell)[0]
    for step in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="a positive number"):
            self_motion(m, cell, window, step)
    with pytest.raises(SymgraspError, match="is not one of the cell"):
        self_motion(m, cell, window._replace(branch=99))
    with pytest.raises(SymgraspError, match="need the scene of the map"):
        self_motion(replace(m, shown_in=None), cell, window)
