"""Importing PyBullet without its printed output, and converting URDFs and poses to and from it."""

from __future__ import annotations

import ctypes
import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from symgrasp.errors import UrdfError
from symgrasp.files import temporary_folder
from symgrasp.meshes import read_mesh
from symgrasp.poses import Array, from_position_quat, quat_wxyz, wxyz_to_xyzw, xyzw_to_wxyz
from symgrasp.robot.model import RobotModel


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
        UrdfError: PyBullet cannot load it, or a link has fewer shapes there.
        MeshError: a mesh is unusable.
    """
    for link in model.colliding_links():
        model.hulls(link)  # PyBullet takes a damaged mesh for an empty one
    with temporary_folder() as folder:
        file = folder / "model.urdf"
        file.write_bytes(_with_stl_meshes(model, folder))
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
    for i, link in enumerate(link_names(client, body)):
        shapes = pybullet.getCollisionShapeData(body, i - 1, physicsClientId=client)
        expected = len(model.shapes(link))
        if len(shapes) < expected:
            found = f"{len(shapes)} shapes in PyBullet"
            raise UrdfError(model.path, f"link {link}: collision", found, f"{expected}, as in the URDF")
    return body


def _with_stl_meshes(model: RobotModel, folder: Path) -> bytes:
    """Return the URDF for PyBullet, with copies in a folder of the meshes that it might read otherwise.

    It reads binary STL and OBJ as this library does, and takes each group of an OBJ as a hull of its own.
    """
    root = ET.fromstring(model.collision_urdf())
    for k, mesh in enumerate(root.iter("mesh")):
        path = Path(mesh.get("filename", ""))
        if path.suffix.lower() != ".obj":
            copy = folder / f"{k}.stl"
            read_mesh(path, f"{model.path.name}: collision", upright=False).export(copy)
            mesh.set("filename", str(copy))
    return ET.tostring(root)


def link_names(client: int, body: int) -> list[str]:
    """Return the names of the links -1 (the base), 0, 1, … of a body, in this order."""
    joints = range(pybullet.getNumJoints(body, client))
    base = pybullet.getBodyInfo(body, client)[0].decode()
    return [base, *(pybullet.getJointInfo(body, j, client)[12].decode() for j in joints)]
