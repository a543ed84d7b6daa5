"""Importing PyBullet without its printed output, and converting URDFs and poses to and from it."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from symgrasp.errors import UrdfError
from symgrasp.files import temporary_folder
from symgrasp.poses import Array, from_position_quat, quat_wxyz, wxyz_to_xyzw, xyzw_to_wxyz
from symgrasp.robot.model import RobotModel
from symgrasp.world.urdf import collision_urdf


@contextmanager
def _silenced() -> Iterator[None]:
    """Discard what C code prints to standard output and standard error."""
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


with _silenced():  # PyBullet prints its build time when it is imported
    import pybullet

__all__ = ["link_names", "load_urdf", "pose_of", "pybullet", "xyzw"]


def pose_of(position: Sequence[float], xyzw: Sequence[float]) -> Array:
    """Return the pose (4, 4) of a position (3,) and an xyzw quaternion (4,), as PyBullet has them."""
    return from_position_quat(position, xyzw_to_wxyz(xyzw))


def xyzw(pose: Array) -> list[float]:
    """Return the orientation of a pose (4, 4) as an xyzw quaternion (4,), as PyBullet takes it."""
    return wxyz_to_xyzw(quat_wxyz(pose)).tolist()


def load_urdf(client: int, model: RobotModel, pose: Array) -> int:
    """Load the collision shapes of a URDF with a fixed base.

    Args:
        client: PyBullet's id of the physics client.
        model: the URDF.
        pose: pose (4, 4) of the root link in the world.

    Returns:
        PyBullet's body id.

    Raises:
        UrdfError: PyBullet cannot load it, or a link has other shapes there.
        MeshError: a mesh is unusable.
    """
    with temporary_folder() as folder:
        file = folder / "model.urdf"
        file.write_bytes(collision_urdf(model, folder))
        try:
            body = pybullet.loadURDF(
                str(file),
                basePosition=pose[:3, 3].tolist(),
                baseOrientation=xyzw(pose),
                useFixedBase=True,
                physicsClientId=client,
            )
        except pybullet.error as error:
            raise UrdfError(model.path, "urdf", str(error), "a URDF that PyBullet can load") from error
    expected = {link: len(hulls) for link in model.colliding_links() if (hulls := model.hulls(link))}
    links = enumerate(link_names(client, body), start=-1)
    found = {link: len(pybullet.getCollisionShapeData(body, i, physicsClientId=client)) for i, link in links}
    for link, count in expected.items():
        if found.get(link) != count:
            value = f"{found.get(link, 0)} shapes in PyBullet"
            raise UrdfError(model.path, f"link {link}: collision", value, f"{count}, as in the URDF")
    return body


def link_names(client: int, body: int) -> list[str]:
    """Return the names of the links -1 (the base), 0, 1, … of a body, in this order."""
    joints = range(pybullet.getNumJoints(body, client))
    base = pybullet.getBodyInfo(body, client)[0].decode()
    return [base, *(pybullet.getJointInfo(body, j, client)[12].decode() for j in joints)]
