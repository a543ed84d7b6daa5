"""Joining URDF files: hands mounted on links of a robot, and tool frames added as links."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symgrasp.descriptions.description import read_description
from symgrasp.errors import UrdfError, one_of
from symgrasp.meshes import read_up
from symgrasp.poses import Array, from_position_quat, from_position_rpy, rpy
from symgrasp.references import resolve, sought

__all__ = ["Frame", "Mount", "assemble"]

MOST_LINKS = 5000
"""Most links of a URDF file, and most joints."""

NUMBERS = {
    "origin": {"xyz": (3,), "rpy": (3,)},
    "axis": {"xyz": (3,)},
    "box": {"size": (3,)},
    "cylinder": {"radius": (1,), "length": (1,)},
    "sphere": {"radius": (1,)},
    "mesh": {"scale": (1, 3)},
    "limit": {"lower": (1,), "upper": (1,)},
    "mimic": {"multiplier": (1,), "offset": (1,)},
}
"""Elements of links and joints → their attributes that hold numbers, and how many."""

SHAPES = ("box", "cylinder", "sphere", "mesh")
"""Geometries that a link may have."""


@dataclass(frozen=True)
class Frame:
    """A coordinate frame fixed to a link.

    Attributes:
        link: name of the link.
        position: origin (3,) of the frame in the link frame (m).
        quat_wxyz: orientation (4,) of the frame in the link frame.
    """

    link: str
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quat_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def matrix(self) -> Array:
        """Return the pose (4, 4) of the frame in its link frame."""
        return from_position_quat(self.position, self.quat_wxyz)

    @property
    def is_link(self) -> bool:
        """Whether the frame coincides with the link frame."""
        return np.allclose(self.matrix(), np.eye(4), atol=1e-12)


@dataclass(frozen=True)
class Mount:
    """Something to be fixed to a link of a robot: the contents of another URDF, or an empty link.

    Attributes:
        frame: where on the robot it is fixed.
        urdf: the file whose root link is fixed there; None for an empty link, such as a tool frame.
        name: the name of the empty link, or the prefix of all link and joint names of the file.
    """

    frame: Frame
    urdf: Path | None
    name: str


def assemble(
    path: Path,
    mounts: Sequence[Mount] = (),
    robot: ET.Element | None = None,
    *,
    follow_up_axis: bool = False,
) -> bytes:
    """Return the text of a URDF with the mounts added and every mesh reference made an absolute path.

    Args:
        path: the file of the robot.
        mounts: what to add, in order; a later one may be fixed to an earlier one.
        robot: what `read_description` made of the file, which is changed; it is read unless given.
        follow_up_axis: whether COLLADA meshes of the robot are turned so that the axis which they state as up
            is z; their origins are changed.

    Raises:
        UrdfError: a file is not a URDF, refers to a mesh that does not exist, lacks the link that
            something is to be mounted on, or two links or joints would have the same name.
        MeshError: a COLLADA mesh that is to be turned cannot be read.
    """
    robot = _checked(path, read_description(path).urdf if robot is None else robot)
    if follow_up_axis:
        for link in robot.iter("link"):
            _turn_up(link)
    for mount in mounts:
        _add(robot, path, mount)
    return ET.tostring(robot)


def _checked(path: Path, robot: ET.Element) -> ET.Element:
    """Check names, numbers and shapes of a URDF, make its mesh references absolute, and return it."""
    for tag in ("link", "joint"):
        names = _names(robot, tag)
        if len(names) > MOST_LINKS:
            raise UrdfError(path, f"{tag}s", f"{len(names):,} of them", f"at most {MOST_LINKS:,} of them")
        _no_repeats(path, f"{tag} name", names)
    _no_repeats(path, "child link of joints", [c.get("link", "") for c in robot.iterfind("joint/child")])
    for element in robot.iterfind("joint"):
        _check_numbers(path, f"joint {element.get('name')}", element)
    for link in robot.iter("link"):
        _check_numbers(path, f"link {link.get('name')}", link)
        _check_shapes(path, link)
        for mesh in link.iter("mesh"):
            reference = mesh.get("filename", "")
            file = resolve(reference, path.parent)
            if file is None:
                expected = sought(reference, path.parent, "mesh")
                raise UrdfError(path, f"link {link.get('name')}", reference, expected)
            mesh.set("filename", str(file.resolve()))
    return robot


def _turn_up(link: ET.Element) -> None:
    """Change the origins of the meshes of a link so that what their files state as up is z."""
    for part in [*link.iterfind("collision"), *link.iterfind("visual")]:
        for mesh in part.iterfind("geometry/mesh"):
            turn = read_up(Path(mesh.get("filename", "")), f"link {link.get('name')}")
            origin = part.find("origin")
            origin = ET.SubElement(part, "origin") if origin is None else origin
            stated = [[float(n) for n in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy")]
            pose = from_position_rpy(*stated) @ turn
            origin.attrib.update(_origin(pose))
            scale = np.broadcast_to([float(n) for n in mesh.get("scale", "1").split()], 3)
            scale = np.abs(turn[:3, :3].T) @ scale  # of the axes of the file, before they are turned
            mesh.set("scale", _text(scale))


def _no_repeats(path: Path, field: str, names: Sequence[str]) -> None:
    """Raise UrdfError if a name occurs twice."""
    for name, count in Counter(names).items():
        if count > 1:
            raise UrdfError(path, field, name, "a name that is not used twice")


def _check_numbers(path: Path, field: str, part: ET.Element) -> None:
    """Raise UrdfError if a number in a link or a joint cannot be read."""
    for element in part.iter():
        for key, counts in NUMBERS.get(element.tag, {}).items():
            words = element.get(key)
            if words is None:
                continue
            try:
                complete = len([float(word) for word in words.split()]) in counts
            except ValueError:
                complete = False
            if not complete:
                expected = " or ".join("a number" if n == 1 else f"{n} numbers" for n in counts)
                raise UrdfError(path, f"{field}: {element.tag}: {key}", words, expected)


def _check_shapes(path: Path, link: ET.Element) -> None:
    """Raise UrdfError if a link has a collision shape of an unknown kind; drop those only seen."""
    for part in [*link.findall("collision"), *link.findall("visual")]:
        unknown = [shape.tag for shape in part.iterfind("geometry/*") if shape.tag not in SHAPES]
        if unknown and part.tag == "collision":
            raise UrdfError(path, f"link {link.get('name')}: collision", unknown[0], one_of(SHAPES))
        if unknown:
            link.remove(part)


def _names(robot: ET.Element, tag: str) -> list[str]:
    return [element.get("name", "") for element in robot.findall(tag)]


def _add(robot: ET.Element, path: Path, mount: Mount) -> None:
    """Add a mount and the fixed joint that holds it to the element tree of a robot."""
    links = _names(robot, "link")
    if mount.frame.link not in links:
        raise UrdfError(path, "mount: link", mount.frame.link, one_of(links, mount.frame.link))
    if mount.urdf is None:
        added = ET.Element("robot")
        ET.SubElement(added, "link", name=mount.name)
    else:
        added = _checked(mount.urdf, read_description(mount.urdf).urdf)
        for element, key in _references(added):
            element.set(key, mount.name + element.get(key, ""))
    for tag in ("link", "joint"):
        for name in set(_names(added, tag)) & set(_names(robot, tag)):
            raise UrdfError(mount.urdf or path, f"mount: {tag}", name, "a name that is not used twice")
    children = {child.get("link") for child in added.iterfind("joint/child")}
    roots = [name for name in _names(added, "link") if name not in children]
    if len(roots) != 1:
        raise UrdfError(mount.urdf or path, "urdf", f"{len(roots)} root links {roots}", "one root link")
    for material in added.iter("material"):  # materials of the same name may differ between files
        material.set("name", f"{roots[0]}/{material.get('name', '')}")
    robot.extend(added)
    joint = ET.SubElement(robot, "joint", name=f"{roots[0]}_mount", type="fixed")
    ET.SubElement(joint, "parent", link=mount.frame.link)
    ET.SubElement(joint, "child", link=roots[0])
    pose = mount.frame.matrix()
    ET.SubElement(joint, "origin", _origin(pose))


def _origin(pose: Array) -> dict[str, str]:
    """Return the attributes of the origin that is a pose (4, 4)."""
    return {"xyz": _text(pose[:3, 3]), "rpy": _text(rpy(pose))}


def _text(numbers: Array) -> str:
    return " ".join(map(repr, numbers.tolist()))


def _references(robot: ET.Element) -> Iterator[tuple[ET.Element, str]]:
    """Yield every element and attribute that holds the name of a link or joint."""
    name_attributes = (
        ("link", "name"),
        ("joint", "name"),
        ("joint/parent", "link"),
        ("joint/child", "link"),
        ("joint/mimic", "joint"),
    )
    for path, key in name_attributes:
        for element in robot.iterfind(path):
            yield element, key
