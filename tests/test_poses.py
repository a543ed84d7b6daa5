from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from symgrasp import poses
from tests.strategies import angles
from tests.strategies import poses as random_poses


@given(random_poses())
def test_inverse_undoes(T):
    np.testing.assert_allclose(poses.inverse(T) @ T, np.eye(4), atol=1e-12)


@given(random_poses())
def test_quaternion_round_trip_and_order(T):
    quat = poses.quat_wxyz(T)
    np.testing.assert_allclose(poses.from_position_quat(T[:3, 3], quat), T, atol=1e-12)
    np.testing.assert_allclose(
        Rotation.from_quat(poses.wxyz_to_xyzw(quat)).as_matrix(), T[:3, :3], atol=1e-12
    )
    np.testing.assert_array_equal(poses.xyzw_to_wxyz(poses.wxyz_to_xyzw(quat)), quat)


@given(random_poses(), st.tuples(angles, angles, angles), st.floats(0.1, 10))
def test_rotations_agree_with_scipy(T, turns, length):
    quat = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(poses.quat_wxyz(T), quat, atol=1e-15)
    np.testing.assert_allclose(
        poses.from_position_quat([1, 2, 3], length * quat)[:3, :3], T[:3, :3], atol=1e-12
    )
    expected = Rotation.from_euler("xyz", turns).as_matrix()
    np.testing.assert_allclose(poses.from_position_rpy([1, 2, 3], turns)[:3, :3], expected, atol=1e-15)


@pytest.mark.parametrize(
    "quat", [(0, 0, 0, 1), (0, 0, 1, 0), (0, 1, 0, 0), (0, 0.6, -0.8, 0), (0.5, -0.5, 0.5, -0.5)]
)
def test_quaternions_of_half_and_third_turns(quat):
    R = Rotation.from_quat(quat, scalar_first=True).as_matrix()
    np.testing.assert_allclose(poses.quat_wxyz(poses.from_rotation([R, R])), [quat, quat], atol=1e-15)


def test_a_quaternion_of_no_length_is_refused():
    with pytest.raises(ValueError, match="length zero"):
        poses.from_position_quat(np.zeros((2, 3)), [[1, 0, 0, 0], [0, 0, 0, 0]])


@given(random_poses())
def test_roll_pitch_yaw_round_trip(T):
    np.testing.assert_allclose(poses.from_position_rpy(T[:3, 3], poses.rpy(T)), T, atol=1e-9)


@given(random_poses(), angles)
def test_axis_frame_and_spin_rebuild_the_pose(T, delta):
    frame = poses.axis_frame(T)
    np.testing.assert_allclose(frame @ poses.rotation_z(poses.spin(T)), T, atol=1e-9)
    np.testing.assert_allclose(frame[:3, :3].T @ frame[:3, :3], np.eye(3), atol=1e-12)
    assert np.array_equal(poses.axis_frame(T @ poses.rotation_z(delta)), frame)


@pytest.mark.parametrize("axis", [(0, 0, -1.0), (0, 0, 1.0), (1.0, 0, 0), (1e-7, 0, -1), (1e-4, -1e-5, -1)])
def test_axis_frame_at_the_poles(axis):
    axis = np.array(axis) / np.linalg.norm(axis)
    T = poses.from_rotation(Rotation.align_vectors([axis], [[0, 0, 1]])[0].as_matrix(), [1, 2, 3])
    np.testing.assert_allclose(poses.axis_frame(T) @ poses.rotation_z(poses.spin(T)), T, atol=1e-12)
    frame = poses.axis_frame(T)
    np.testing.assert_allclose(frame[:3, 2], axis, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frame[:3, :3]), 1.0)


@given(random_poses(), random_poses())
def test_pose_error_agrees_with_scipy(a, b):
    distance, angle = poses.pose_error(a, b)
    expected = (Rotation.from_matrix(a[:3, :3]).inv() * Rotation.from_matrix(b[:3, :3])).magnitude()
    assert distance == pytest.approx(np.linalg.norm(a[:3, 3] - b[:3, 3]))
    assert angle == pytest.approx(expected, abs=1e-7)


@given(angles)
def test_rotation_about_agrees_with_scipy(angle):
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    np.testing.assert_allclose(
        poses.rotation_about(axis, angle), Rotation.from_rotvec(axis * angle).as_matrix(), atol=1e-12
    )


def test_batches_keep_their_shape():
    angle = np.linspace(0, 1, 6).reshape(2, 3)
    batch = poses.rotation_z(angle)
    assert batch.shape == (2, 3, 4, 4)
    assert poses.inverse(batch).shape == (2, 3, 4, 4)
    assert poses.pose_error(batch, np.eye(4))[1] == pytest.approx(angle)


def test_rpy_follows_the_urdf_convention():
    T = poses.from_position_rpy([0, 0, 0], [0.1, 0.2, 0.3])
    about = [
        poses.rotation_about(axis, angle) for axis, angle in zip(np.eye(3), (0.1, 0.2, 0.3), strict=True)
    ]
    np.testing.assert_allclose(T[:3, :3], about[2] @ about[1] @ about[0], atol=1e-12)
