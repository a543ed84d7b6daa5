"""One URDF out of several: hands mounted on a robot's links, and tool frames that no file names."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symgrasp.errors import UrdfError, one_of
from symgrasp.files import resolve
from symgrasp.poses import Array, from_position_quat, rpy

__all__ = ["Frame", "Mount", "assemble"]


@dataclass(frozen=True)
class Frame:
    """A pose fixed to a link.

    Attributes:
        link: the link.
        position: where the frame's origin is in the link (m).
        quat_wxyz: how it is turned.
    """

    link: str
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quat_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def matrix(self) -> Array:
        """Return the frame's pose (4, 4) in its link."""
        return from_position_quat(self.position, self.quat_wxyz)

    @property
    def is_link(self) -> bool:
        """Whether the frame is the link's own."""
        return np.allclose(self.matrix(), np.eye(4), atol=1e-12)


@dataclass(frozen=True)
class Mount:
    """What is fixed to a link of a robot.

    Attributes:
        frame: where.
        urdf: the file whose root link is put there, or None for a link without a body.
        name: name of that link, or what all names of the file are prefixed with.
    """

    frame: Frame
    urdf: Path | None
    name: str


def assemble(path: Path, mounts: Sequence[Mount] = ()) -> bytes:
    """Return a URDF with everything that is mounted on it, and every mesh as an absolute path.

    Args:
        path: the URDF file.
        mounts: what to add, in order; a later one may stand on an earlier one.

    Raises:
        UrdfError: a file is not a URDF, refers to a mesh that does not exist, has no link of the
            name that something is to be mounted on, or two things would have the same name.
    """
    robot = _read(path)
    for mount in mounts:
        _add(robot, path, mount)
    return ET.tostring(robot)


def _read(path: Path) -> ET.Element:
    try:
        robot = ET.parse(path).getroot()
    except OSError as error:
        raise UrdfError(path, "urdf", str(path), "a readable URDF file") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UrdfError(path, "urdf", str(error), "a valid URDF document") from error
    for tag in ("link", "joint"):
        _no_repeats(path, f"{tag} name", _names(robot, tag))
    _no_repeats(path, "child link of joints", [c.get("link", "") for c in robot.iterfind("joint/child")])
    for link in robot.iter("link"):
        for mesh in link.iter("mesh"):
            reference = mesh.get("filename", "")
            file = resolve(reference, path.parent)
            if file is None:
                raise UrdfError(path, f"link {link.get('name')}", reference, "an existing mesh file")
            mesh.set("filename", str(file.resolve()))
    return robot


def _no_repeats(path: Path, field: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise UrdfError(path, field, name, "a name that is not used twice")


def _names(robot: ET.Element, tag: str) -> list[str]:
    return [element.get("name", "") for element in robot.findall(tag)]


def _add(robot: ET.Element, path: Path, mount: Mount) -> None:
    links = _names(robot, "link")
    if mount.frame.link not in links:
        raise UrdfError(path, "mount: link", mount.frame.link, one_of(links, mount.frame.link))
    if mount.urdf is None:
        added = ET.Element("robot")
        ET.SubElement(added, "link", name=mount.name)
    else:
        added = _read(mount.urdf)
        for element, key in _references(added):
            element.set(key, mount.name + element.get(key, ""))
    for tag in ("link", "joint"):
        for name in set(_names(added, tag)) & set(_names(robot, tag)):
            raise UrdfError(mount.urdf or path, f"mount: {tag}", name, "a name that is not used twice")
    children = {child.get("link") for child in added.iterfind("joint/child")}
    roots = [name for name in _names(added, "link") if name not in children]
    if len(roots) != 1:
        raise UrdfError(mount.urdf or path, "urdf", f"{len(roots)} root links {roots}", "one root link")
    for material in added.iter("material"):  # the same name may mean another colour here
        material.set("name", f"{roots[0]}/{material.get('name', '')}")
    robot.extend(added)
    joint = ET.SubElement(robot, "joint", name=f"{roots[0]}_mount", type="fixed")
    ET.SubElement(joint, "parent", link=mount.frame.link)
    ET.SubElement(joint, "child", link=roots[0])
    pose = mount.frame.matrix()
    text = {"xyz": pose[:3, 3], "rpy": rpy(pose)}
    ET.SubElement(joint, "origin", {key: " ".join(map(repr, v.tolist())) for key, v in text.items()})


def _references(robot: ET.Element) -> Iterator[tuple[ET.Element, str]]:
    """Yield every element and attribute that holds the name of a link or joint."""
    places = (
        ("link", "name"),
        ("joint", "name"),
        ("joint/parent", "link"),
        ("joint/child", "link"),
        ("joint/mimic", "joint"),
    )
    for path, key in places:
        for element in robot.iterfind(path):
            yield element, key
