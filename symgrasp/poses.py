"""Batched rigid poses as homogeneous matrices, shape (..., 4, 4), metres and radians.

``T_a_b`` maps coordinates of frame b into frame a. Quaternions are wxyz; PyBullet's xyzw
exists only behind `wxyz_to_xyzw` and `xyzw_to_wxyz`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    """Assemble poses from positions (..., 3) and wxyz quaternions (..., 4) of any length.

    Raises:
        ValueError: a quaternion is zero.
    """
    quat = np.asarray(quat, dtype=float)
    w, x, y, z = np.moveaxis(quat, -1, 0)
    length = np.sqrt(x * x + y * y + z * z + w * w)
    if (length == 0.0).any():
        raise ValueError("a quaternion of length zero")
    return from_rotation(_rotation(w / length, x / length, y / length, z / length), position)


def from_position_rpy(position: ArrayLike, rpy: ArrayLike) -> Array:
    """Assemble a pose from a position (3,) and URDF roll, pitch, yaw (3,) in radians."""
    half = np.asarray(rpy, dtype=float) / 2.0
    (a, b, c), (d, e, f) = np.cos(half), np.sin(half)  # of roll, pitch, yaw
    w, x, y, z = b * a, b * d, e * a, -e * d  # roll, then pitch
    return from_rotation(_rotation(c * w - f * z, c * x - f * y, c * y + f * x, c * z + f * w), position)


def _rotation(w: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Array:
    """Return the rotation matrices (..., 3, 3) of unit quaternions; every part has the batch shape.

    The sums are those of `scipy.spatial.transform.Rotation`, whose import takes longer than most maps.
    """
    w, x, y, z = (np.asarray(part, dtype=float) for part in (w, x, y, z))
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    xy, zw, xz, yw, yz, xw = x * y, z * w, x * z, y * w, y * z, x * w
    rows = [
        [xx - yy - zz + ww, 2 * (xy - zw), 2 * (xz + yw)],
        [2 * (xy + zw), -xx + yy - zz + ww, 2 * (yz - xw)],
        [2 * (xz - yw), 2 * (yz + xw), -xx - yy + zz + ww],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rpy(pose: ArrayLike) -> Array:
    """Return the URDF roll, pitch, yaw (3,) in radians of a pose (4, 4); no yaw at a pitch of ±π/2."""
    R = np.asarray(pose, dtype=float)[:3, :3]
    level = np.hypot(R[0, 0], R[1, 0])
    pitch = np.arctan2(-R[2, 0], level)
    if level < 1e-9:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def quat_wxyz(pose: ArrayLike) -> Array:
    """Return the wxyz quaternions (..., 4) of poses, with w >= 0.

    Whichever of its four parts is largest is taken from the diagonal, which loses the fewest digits
    (Shepperd, "Quaternion from rotation matrix", 1978).
    """
    R = np.asarray(pose, dtype=float)[..., :3, :3]
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    xy, xz, yz = R[..., 1, 0] + R[..., 0, 1], R[..., 2, 0] + R[..., 0, 2], R[..., 2, 1] + R[..., 1, 2]
    xw, yw, zw = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    trace = xx + yy + zz
    # Four times each quaternion's part w, x, y or z, times the quaternion (wxyz).
    multiples = np.stack(
        [
            np.stack([1.0 + trace, xw, yw, zw], axis=-1),
            np.stack([xw, 1.0 - trace + 2 * xx, xy, xz], axis=-1),
            np.stack([yw, xy, 1.0 - trace + 2 * yy, yz], axis=-1),
            np.stack([zw, xz, yz, 1.0 - trace + 2 * zz], axis=-1),
        ],
        axis=-2,
    )
    largest = np.stack([trace, xx, yy, zz], axis=-1).argmax(axis=-1)
    quat = np.take_along_axis(multiples, largest[..., None, None], axis=-2)[..., 0, :]
    w, x, y, z = np.moveaxis(quat, -1, 0)
    quat = quat / np.sqrt(x * x + y * y + z * z + w * w)[..., None]
    # Of the two quaternions of a rotation, that whose first part other than zero is positive.
    first = np.take_along_axis(quat, (quat != 0.0).argmax(axis=-1)[..., None], axis=-1)
    return np.where(first < 0.0, -quat, quat)


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
