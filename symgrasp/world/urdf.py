"""The URDF that PyBullet loads for a robot: what can collide, as the library has read it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from symgrasp.errors import UrdfError
from symgrasp.poses import Array, rpy
from symgrasp.robot.joint import Joint
from symgrasp.robot.model import RobotModel

__all__ = ["collision_urdf"]

MOST_JOINTS = 128
"""PyBullet leaves further joints of a robot where they are, without a word."""

LARGEST_HULL = 8.0
"""Largest extent (m) of a hull. PyBullet makes hulls whose corners lie up to a 9000th of it too far inside,
which the margin of a millimetre covers that it keeps around them (`symgrasp.world.shapes.MARGIN`)."""


def collision_urdf(model: RobotModel, folder: Path) -> bytes:
    """Return a URDF of all that collides, and write the meshes that it refers to.

    Boxes and spheres are as they are; of every other shape there are the hulls that `RobotModel.hulls` has.
    Links without shapes are left out unless a joint moves them and something with a shape hangs on them.

    Args:
        model: the robot.
        folder: the meshes are written there.

    Raises:
        UrdfError: too many joints move its shapes, or a shape is too large.
        MeshError: a mesh is unusable.
    """
    joints = list(_colliding_tree(model))
    moving = sum(joint.source >= 0 for joint in joints)
    if moving > MOST_JOINTS:
        expected = f"at most {MOST_JOINTS}, as many as PyBullet sets; make the others fixed"
        raise UrdfError(model.path, "joints", f"{moving} that move links with shapes", expected)
    robot = ET.Element("robot", name="robot")
    for k, name in enumerate((model.root, *(model.link_names[joint.child] for joint in joints))):
        link = ET.SubElement(robot, "link", name=name)
        inertial = ET.SubElement(link, "inertial")  # not heeded, but demanded
        ET.SubElement(inertial, "mass", value="1")
        ET.SubElement(inertial, "inertia", ixx="1", ixy="0", ixz="0", iyy="1", iyz="0", izz="1")
        _add_shapes(link, model, name, folder / str(k))
    for joint in joints:
        element = ET.SubElement(robot, "joint", name=joint.name, type=joint.kind)
        ET.SubElement(element, "parent", link=model.link_names[joint.parent])
        ET.SubElement(element, "child", link=model.link_names[joint.child])
        _add_origin(element, joint.origin)
        if joint.source >= 0:
            ET.SubElement(element, "axis", xyz=_text(joint.axis))
            ET.SubElement(element, "limit", lower="0", upper="0", effort="0", velocity="0")  # not heeded
    ET.indent(robot)  # PyBullet reads some kilobytes of each line
    return ET.tostring(robot)


def _colliding_tree(model: RobotModel) -> Iterator[Joint]:
    """Yield the joints to the links that are needed, each from the nearest needed link above it."""
    needed = {model.link_index(link) for link in model.colliding_links()}
    for joint in reversed(model.joints):
        if joint.child in needed:
            needed.add(joint.parent)
    anchors = {0: (0, np.eye(4))}  # link → the link that it is fixed to, and its pose there
    for joint in model.joints:
        if joint.child in needed:
            parent, pose = anchors[joint.parent]
            joint = replace(joint, parent=parent, origin=pose @ joint.origin)
            if joint.source >= 0 or model.has_shape(model.link_names[joint.child]):
                yield joint
                anchors[joint.child] = joint.child, np.eye(4)
            else:
                anchors[joint.child] = parent, joint.origin


def _add_shapes(link: ET.Element, model: RobotModel, name: str, prefix: Path) -> None:
    """Add the shapes of a link, and write its hulls to files whose paths begin with a prefix."""
    for k, (shape, hulls) in enumerate(zip(model.shapes(name), model.shape_hulls(name), strict=True)):
        if shape.kind == "box":
            _add_shape(link, shape.pose, "box", size=_text(shape.size))
        elif shape.kind == "sphere":
            _add_shape(link, shape.pose, "sphere", radius=_text(shape.size))
        else:
            for i, points in enumerate(hulls):
                largest = float(np.ptp(points, axis=0).max())
                if largest > LARGEST_HULL:
                    field = f"link {name}: {shape.path.name if shape.path else shape.kind}"
                    raise UrdfError(model.path, field, f"{largest:.3g} m", f"at most {LARGEST_HULL:g} m")
                file = prefix.with_name(f"{prefix.name}-{k}-{i}.stl")
                file.write_bytes(_stl(points))
                _add_shape(link, np.eye(4), "mesh", filename=str(file))


def _add_shape(link: ET.Element, pose: Array, tag: str, **sizes: str) -> None:
    collision = ET.SubElement(link, "collision")
    _add_origin(collision, pose)
    ET.SubElement(ET.SubElement(collision, "geometry"), tag, sizes)


def _stl(points: Array) -> bytes:
    """Return a binary STL file with corners at points (n, 3): PyBullet takes the hull of what it holds."""
    corners = np.resize(points, (-(-len(points) // 3) * 3, 3))  # begins again at the end
    fields = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    triangles = np.zeros(len(corners) // 3, fields)
    triangles["corners"] = corners.reshape(-1, 3, 3)
    return bytes(80) + len(triangles).to_bytes(4, "little") + triangles.tobytes()


def _add_origin(element: ET.Element, pose: Array) -> None:
    ET.SubElement(element, "origin", xyz=_text(pose[:3, 3]), rpy=_text(rpy(pose)))


def _text(numbers: Array | Sequence[float]) -> str:
    return " ".join(map(repr, np.asarray(numbers, dtype=float).tolist()))
