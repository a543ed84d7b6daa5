"""What a URDF says of its links and joints, as far as robots need it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array, from_position_rpy

__all__ = ["Inertial", "Limit", "Mimic", "UrdfJoint", "UrdfLink", "UrdfRobot", "UrdfShape", "read_urdf"]

SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
"""Shapes → the attributes that hold their sizes."""

ROUNDED_ANGLE = 1e-9
"""An angle (rad) closer than this to a multiple of a right angle is that multiple, written with ten digits or
more: as 1.57079632679, which is 5e-12 rad off. At stretched elbows, where configurations depend on the square
root of such an error, closed forms would be off by some 1e-3 rad."""


class UrdfShape(NamedTuple):
    """A collision shape of a link.

    Attributes:
        kind: box, cylinder, sphere or mesh.
        size: box: full sizes (3,); cylinder: radius, length; sphere: radius; mesh: factors for x, y and z.
        path: the file of a mesh, otherwise None.
        origin: pose (4, 4) in the link frame.
    """

    kind: str
    size: tuple[float, ...]
    path: Path | None
    origin: Array


class Inertial(NamedTuple):
    """The mass (kg) of a link, and the frame (4, 4) of its centre in the link frame."""

    mass: float
    origin: Array


class UrdfLink(NamedTuple):
    """A link: its name, its collision shapes, and what it weighs if the file says so."""

    name: str
    collisions: tuple[UrdfShape, ...]
    inertial: Inertial | None


class Limit(NamedTuple):
    """Limits of a joint (rad or m) and its largest speed, None where they are not stated."""

    lower: float | None
    upper: float | None
    velocity: float | None


class Mimic(NamedTuple):
    """The joint that another one follows, by ``multiplier · value + offset``."""

    joint: str
    multiplier: float
    offset: float


class UrdfJoint(NamedTuple):
    """A joint.

    Attributes:
        name: its name.
        type: as the file has it; empty where it has none.
        parent: name of the link that carries it.
        child: name of the link that it carries.
        origin: pose (4, 4) of the joint in the parent's frame, at zero.
        axis: (3,) direction that it turns about or moves along, of any length.
        limit: None where there is none.
        mimic: None unless it follows another joint.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Array
    axis: Array
    limit: Limit | None
    mimic: Mimic | None


class UrdfRobot(NamedTuple):
    """A robot: its name, links and joints in the order of the file."""

    name: str
    links: tuple[UrdfLink, ...]
    joints: tuple[UrdfJoint, ...]


def read_urdf(robot: ET.Element) -> UrdfRobot:
    """Read the links and joints of a URDF.

    yourdfpy does the same, but brings half a second of imports for the scenes that it draws.

    Args:
        robot: the root element.

    Raises:
        KeyError: an attribute or an element is missing.
        ValueError: a number cannot be read, or a shape is of an unknown kind.
    """
    links, joints = map(_link, robot.findall("link")), map(_joint, robot.findall("joint"))
    return UrdfRobot(_named(robot, "name"), tuple(links), tuple(joints))


def _link(element: ET.Element) -> UrdfLink:
    inertial, mass = element.find("inertial"), element.find("inertial/mass")
    if inertial is None or mass is None:
        weight = None
    else:
        weight = Inertial(float(mass.get("value", 0.0)), _origin(inertial))
    return UrdfLink(_named(element, "name"), tuple(map(_shape, element.findall("collision"))), weight)


def _shape(element: ET.Element) -> UrdfShape:
    shape = element.find("geometry/*")
    if shape is None:
        raise ValueError("a collision without a geometry")
    path = None
    if shape.tag in SIZES:
        sizes = [size for key in SIZES[shape.tag] for size in _numbers(_named(shape, key))]
    elif shape.tag == "mesh":
        sizes = (_numbers(shape.get("scale", "")) or [1.0]) * 3
        path = Path(_named(shape, "filename"))
    else:
        raise ValueError(f"a collision with a geometry <{shape.tag}>")
    return UrdfShape(shape.tag, tuple(sizes[:3]), path, _origin(element))


def _joint(element: ET.Element) -> UrdfJoint:
    axis, limit, mimic = (element.find(tag) for tag in ("axis", "limit", "mimic"))
    return UrdfJoint(
        _named(element, "name"),
        element.get("type", ""),
        _named(_part(element, "parent"), "link"),
        _named(_part(element, "child"), "link"),
        _origin(element),
        np.array([1.0, 0.0, 0.0] if axis is None else _numbers(axis.get("xyz", "1 0 0"))),
        None if limit is None else Limit(*(_number(limit.get(key)) for key in Limit._fields)),
        None
        if mimic is None
        else Mimic(
            _named(mimic, "joint"), float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0))
        ),
    )


def _origin(element: ET.Element) -> Array:
    """Return the pose (4, 4) that the origin of an element states, the identity if it has none.

    Angles that are right but for the rounding of their digits are right.
    """
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    angles = np.array(_numbers(origin.get("rpy", "0 0 0")))
    right = 0.5 * np.pi * np.round(angles / (0.5 * np.pi))
    angles = np.where(np.abs(angles - right) < ROUNDED_ANGLE, right, angles)
    return from_position_rpy(_numbers(origin.get("xyz", "0 0 0")), angles)


def _part(element: ET.Element, tag: str) -> ET.Element:
    found = element.find(tag)
    if found is None:
        raise KeyError(f"<{tag}> of {element.tag} {element.get('name')}")
    return found


def _named(element: ET.Element, key: str) -> str:
    value = element.get(key)
    if value is None:
        raise KeyError(f"{key} of <{element.tag}>")
    return value


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _number(text: str | None) -> float | None:
    return None if text is None else float(text)
