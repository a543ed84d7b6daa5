import numpy as np
import pytest

from symgrasp.bench.arms.ik import bare_arm
from symgrasp.ik import CompiledIK
from symgrasp.ik.at_phi import geometry_at, locked_joint
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.scene.scene import Scene


@pytest.mark.parametrize(
    ("scene", "name"),
    [("soda_can", "panda"), ("log_iiwa_and_panda", "iiwa"), ("tiago_dual_tray", "left")],
)
def test_the_geometry_at_any_redundancy_is_that_of_a_sample_there(scene, name):
    arm = Scene.load(scene).arm(name)
    ik = CompiledIK(arm if arm.robot.torso is None else arm.at(0), 3)
    locked = locked_joint(ik)
    assert locked is not None
    values = np.random.default_rng(0).uniform(locked.lower, locked.upper, 20)
    for phi, expected in zip(values, ik.at(values).chain.geometry, strict=True):
        row = np.empty(len(expected))
        geometry_at(locked, phi, row)
        # Angles may differ by a turn: sine and cosine follow them.
        assert np.allclose(np.exp(1j * row), np.exp(1j * expected), atol=1e-9)
        assert np.allclose(row[:42], expected[:42], atol=1e-9)


@pytest.mark.parametrize("name", ["baxter", "alex", "tiago_pro"])
def test_the_geometry_of_arms_with_a_pair_that_the_locked_joint_turns(name):
    """Also at values at which the axes of the pair are parallel, and beside them."""
    robot = next(robot for robot in CATALOGUE if robot.name == name)
    arm = bare_arm(robot, robot.arms[0])
    ik = CompiledIK(arm, 3)
    locked = locked_joint(ik)
    assert locked is not None and ik.locked != arm.dof - 1
    values = np.random.default_rng(0).uniform(locked.lower, locked.upper, 200)
    values[:4] = 0.0, 1e-9, -1e-7, 0.5 * np.pi
    for phi, expected in zip(values, ik.at(values).chain.geometry, strict=True):
        row = np.empty(len(expected))
        geometry_at(locked, phi, row)
        far = np.abs(expected) > 1.0  # where axes are almost parallel
        assert np.allclose(row[~far], expected[~far], atol=1e-9, equal_nan=True)
        assert np.allclose(row[far], expected[far], rtol=1e-6)
