"""Batched rigid poses as homogeneous matrices, shape (..., 4, 4), metres and radians.

``T_a_b`` maps coordinates of frame b into frame a. Quaternions are wxyz; PyBullet's xyzw
exists only behind `wxyz_to_xyzw` and `xyzw_to_wxyz`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

__all__ = [
    "Array",
    "axis_frame",
    "from_position_quat",
    "from_position_rpy",
    "from_rotation",
    "inverse",
    "pose_error",
    "quat_wxyz",
    "rotation_about",
    "rotation_z",
    "rpy",
    "spin",
    "translation",
    "wxyz_to_xyzw",
    "xyzw_to_wxyz",
]

Array = NDArray[np.float64]

FLIP_HEIGHT = -0.55
"""z component of an axis below which `axis_frame` is built from the opposite axis: about 123° from upright,
an inclination that tasks seldom have."""


def from_rotation(rotation: ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Assemble poses from rotation matrices (..., 3, 3) and positions (..., 3)."""
    rotation = np.asarray(rotation, dtype=float)
    position = np.asarray(position, dtype=float)
    batch = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1])
    pose = np.zeros((*batch, 4, 4))
    pose[..., :3, :3] = rotation
    pose[..., :3, 3] = position
    pose[..., 3, 3] = 1.0
    return pose


def translation(offset: ArrayLike) -> Array:
    """Return translations (..., 4, 4) by ``offset`` (..., 3) (m)."""
    return from_rotation(np.eye(3), offset)


def rotation_about(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Return rotation matrices (..., 3, 3) about a unit ``axis`` (3,) by ``angle`` (...)."""
    x, y, z = np.asarray(axis, dtype=float)
    angle = np.asarray(angle, dtype=float)[..., None, None]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


def rotation_z(angle: ArrayLike) -> Array:
    """Return rotations (..., 4, 4) about z by ``angle`` (...): Rz of equation 3."""
    return from_rotation(rotation_about((0.0, 0.0, 1.0), angle))


def from_position_quat(position: ArrayLike, quat: ArrayLike) -> Array:
    """Assemble poses from positions (..., 3) and wxyz quaternions (..., 4) of any length."""
    rotation = Rotation.from_quat(np.asarray(quat, dtype=float), scalar_first=True)
    return from_rotation(rotation.as_matrix(), position)


def from_position_rpy(position: ArrayLike, rpy: ArrayLike) -> Array:
    """Assemble a pose from a position (3,) and URDF roll, pitch, yaw (3,) in radians."""
    return from_rotation(Rotation.from_euler("xyz", np.asarray(rpy, dtype=float)).as_matrix(), position)


def rpy(pose: ArrayLike) -> Array:
    """Return the URDF roll, pitch, yaw (3,) in radians of a pose (4, 4); no yaw at a pitch of ±π/2."""
    R = np.asarray(pose, dtype=float)[:3, :3]
    level = np.hypot(R[0, 0], R[1, 0])
    pitch = np.arctan2(-R[2, 0], level)
    if level < 1e-9:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def quat_wxyz(pose: ArrayLike) -> Array:
    """Return the wxyz quaternions (..., 4) of poses, with w >= 0."""
    pose = np.asarray(pose, dtype=float)
    return Rotation.from_matrix(pose[..., :3, :3]).as_quat(canonical=True, scalar_first=True)


def wxyz_to_xyzw(quat: ArrayLike) -> Array:
    """Reorder quaternions (..., 4) for PyBullet."""
    return np.roll(np.asarray(quat, dtype=float), -1, axis=-1)


def xyzw_to_wxyz(quat: ArrayLike) -> Array:
    """Reorder quaternions (..., 4) from PyBullet."""
    return np.roll(np.asarray(quat, dtype=float), 1, axis=-1)


def inverse(pose: ArrayLike) -> Array:
    """Invert rigid poses (..., 4, 4)."""
    pose = np.asarray(pose, dtype=float)
    transposed = np.swapaxes(pose[..., :3, :3], -1, -2)
    return from_rotation(transposed, -np.einsum("...ij,...j->...i", transposed, pose[..., :3, 3]))


def pose_error(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Return distance (m) and rotation angle (rad) between poses, each of the batch shape.

    The angle comes from the skew part of the relative rotation, which keeps its precision
    near zero where the arc cosine of the trace has none.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    relative = np.swapaxes(a[..., :3, :3], -1, -2) @ b[..., :3, :3]
    skew = np.stack(
        [
            relative[..., 2, 1] - relative[..., 1, 2],
            relative[..., 0, 2] - relative[..., 2, 0],
            relative[..., 1, 0] - relative[..., 0, 1],
        ],
        axis=-1,
    )
    sine = 0.5 * np.linalg.norm(skew, axis=-1)
    cosine = 0.5 * (np.trace(relative, axis1=-2, axis2=-1) - 1.0)
    return np.linalg.norm(a[..., :3, 3] - b[..., :3, 3], axis=-1), np.arctan2(sine, cosine)


def axis_frame(pose: ArrayLike) -> Array:
    """Return the pose (4, 4) with the same origin and z axis, its x axis determined by these alone.

    So an object turned about its axis of symmetry has bit for bit the same axis frame. The rotation
    is the shortest one from the world's z. For an axis below `FLIP_HEIGHT` it is that of the opposite
    axis after a half turn about x, which keeps it well conditioned; between the two cases it jumps.
    """
    pose = np.asarray(pose, dtype=float)
    axis = pose[:3, 2] + 0.0  # + 0.0 turns -0.0 into 0.0
    up = axis[2] >= FLIP_HEIGHT
    x, y, z = axis if up else -axis
    s = 1.0 / (1.0 + z)
    rotation = np.array([[1 - x * x * s, -x * y * s, x], [-x * y * s, 1 - y * y * s, y], [-x, -y, z]])
    return from_rotation(rotation if up else rotation @ np.diag([1.0, -1.0, -1.0]), pose[:3, 3])


def spin(pose: ArrayLike) -> float:
    """Return the angle α (rad) for which ``pose = axis_frame(pose) · Rz(α)``."""
    pose = np.asarray(pose, dtype=float)
    x = axis_frame(pose)[:3, :3].T @ pose[:3, 0]
    return float(np.arctan2(x[1], x[0]))
