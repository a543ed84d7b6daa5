"""PyBullet itself, loaded without a word, and what it needs to be told about URDFs and poses."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from symgrasp.errors import UrdfError
from symgrasp.poses import Array, from_position_quat, quat_wxyz, wxyz_to_xyzw, xyzw_to_wxyz
from symgrasp.robot.model import RobotModel


@contextmanager
def _silenced() -> Iterator[None]:
    """Send what C code prints, on either stream, to nowhere."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    saved = [(stream, os.dup(stream)) for stream in (1, 2)]
    try:
        with Path(os.devnull).open("w") as null:
            for stream, _ in saved:
                os.dup2(null.fileno(), stream)
        yield
    finally:
        flush(None)
        for stream, copy in saved:
            os.dup2(copy, stream)
            os.close(copy)


with _silenced():  # it prints its build time
    import pybullet

__all__ = ["link_names", "load_urdf", "pose_of", "pybullet", "xyzw"]


def pose_of(position: Sequence[float], xyzw: Sequence[float]) -> Array:
    """Return the pose (4, 4) that PyBullet tells as a position and a quaternion."""
    return from_position_quat(position, xyzw_to_wxyz(xyzw))


def xyzw(pose: Array) -> list[float]:
    """Return the orientation of a pose (4, 4) as PyBullet takes it."""
    return wxyz_to_xyzw(quat_wxyz(pose)).tolist()


def load_urdf(client: int, model: RobotModel, pose: Array) -> int:
    """Load the collision shapes of a URDF, and see that every one of them arrived."""
    with tempfile.NamedTemporaryFile(suffix=".urdf") as file:
        file.write(model.collision_urdf())
        file.flush()
        try:
            body = pybullet.loadURDF(
                file.name,
                basePosition=pose[:3, 3].tolist(),
                baseOrientation=xyzw(pose),
                useFixedBase=True,
                physicsClientId=client,
            )
        except pybullet.error as error:
            raise UrdfError(model.path, "urdf", str(error), "a URDF that PyBullet can load") from error
    for i, link in enumerate(link_names(client, body)):
        shapes = pybullet.getCollisionShapeData(body, i - 1, physicsClientId=client)
        if model.has_shape(link) and not shapes:
            raise UrdfError(model.path, f"link {link}: collision", None, "a shape that PyBullet can load")
    return body


def link_names(client: int, body: int) -> list[str]:
    """Return the names of the links -1, 0, 1, … of a body."""
    joints = range(pybullet.getNumJoints(body, client))
    base = pybullet.getBodyInfo(body, client)[0].decode()
    return [base, *(pybullet.getJointInfo(body, j, client)[12].decode() for j in joints)]
