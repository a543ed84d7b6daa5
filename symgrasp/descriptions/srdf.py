"""What the semantic description of a robot (SRDF) says.

These are links that may touch, states to park it in, and which joints and links are arms and hands.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from symgrasp.descriptions.xacro_file import is_xacro
from symgrasp.descriptions.xml_file import read_xml
from symgrasp.errors import UrdfError

__all__ = ["EndEffector", "Group", "Srdf", "find_srdf", "misnamed_srdf", "read_srdf", "srdf_text"]


@dataclass(frozen=True)
class Group:
    """A group of an SRDF.

    Attributes:
        joints: joints that it names.
        links: links that it names, each with the joint that it hangs on.
        chains: first and last link of its chains, whose joints are those between them.
        groups: groups that it is made of.
    """

    joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    chains: tuple[tuple[str, str], ...] = ()
    groups: tuple[str, ...] = ()


@dataclass(frozen=True)
class EndEffector:
    """A hand.

    Attributes:
        name: its name.
        parent_link: the link that it is on.
        group: the group of its links and joints.
        parent_group: the group of the arm that it is on; empty where none is named.
    """

    name: str
    parent_link: str
    group: str
    parent_group: str


@dataclass(frozen=True)
class Srdf:
    """The parts of an SRDF that count here.

    Attributes:
        path: the file.
        disabled: pairs of links whose collisions are not checked.
        states: name → joint → value (rad or m), the groups of one name joined.
        groups: name → group.
        end_effectors: the hands.
    """

    path: Path
    disabled: frozenset[frozenset[str]]
    states: Mapping[str, Mapping[str, float]]
    groups: Mapping[str, Group] = field(default_factory=dict)
    end_effectors: tuple[EndEffector, ...] = ()


def find_srdf(urdf: Path) -> Path | None:
    """Return the SRDF that belongs to a URDF.

    It is the one of the same stem in the URDF's folder or in ``../srdf``, or else the only one there, unless
    that names another robot: see `misnamed_srdf`.
    """
    path = _beside(urdf)
    return None if path is None or (not _same_stem(path, urdf) and _other_name(path, urdf)) else path


def misnamed_srdf(urdf: Path) -> str:
    """Return in words how the SRDF beside a URDF names another robot than it; nothing where it does not.

    Names are compared as they stand in the files, but for case. What a xacro file leaves open fits any.
    """
    path = _beside(urdf)
    names = None if path is None else _other_name(path, urdf)
    if path is None or names is None:
        return ""
    differ = f"it describes robot {names[0]!r}, and {urdf.name} is robot {names[1]!r}"
    return f"{differ}; srdf: {path.name} in the scene reads it" if not _same_stem(path, urdf) else differ


def _same_stem(srdf: Path, urdf: Path) -> bool:
    return srdf.stem == urdf.stem.removesuffix(".urdf")  # also of .urdf.xacro


def _other_name(srdf: Path, urdf: Path) -> tuple[str, str] | None:
    """Return the names of the robots of an SRDF and of a URDF where they differ."""
    names = _robot_name(srdf, "name"), _robot_name(urdf, "name") or _robot_name(urdf, "model")
    stated = [name.casefold() for name in names if name and "$" not in name]
    return (names[0], names[1]) if len(set(stated)) == 2 else None


def _robot_name(path: Path, attribute: str) -> str:
    """Return the name of the robot of a file; nothing where none can be read."""
    try:
        return read_xml(path, "URDF").get(attribute, "")
    except UrdfError:
        return ""


def _beside(urdf: Path) -> Path | None:
    """Return the SRDF of the same stem as a URDF, or else the only one beside it."""
    folders = (urdf.parent, urdf.parent.parent / "srdf")
    for folder in folders:
        if (path := folder / f"{urdf.stem.removesuffix('.urdf')}.srdf").is_file():  # also of .urdf.xacro
            return path
    found = [path for folder in folders for path in folder.glob("*.srdf")]
    return found[0] if len(found) == 1 else None


def read_srdf(path: Path) -> Srdf:
    """Read an SRDF; links and joints that a URDF does not have are no error.

    Raises:
        UrdfError: it is no SRDF, or a joint of a state has no number.
    """
    root = read_xml(path, "SRDF")
    if is_xacro(path, root):
        raise UrdfError(path, "srdf", "a xacro file", f"a plain SRDF: xacro {path.name} > {path.stem}")
    if root.tag != "robot":
        raise UrdfError(path, "srdf", f"<{root.tag}>", "<robot>, as in an SRDF")
    disabled = {
        frozenset((pair.get("link1", ""), pair.get("link2", "")))
        for pair in root.iterfind("disable_collisions")
    }
    states: dict[str, dict[str, float]] = {}
    for state in root.iterfind("group_state"):
        values = states.setdefault(state.get("name", ""), {})
        for joint in state.iterfind("joint"):
            if len(numbers := joint.get("value", "").split()) != 1:
                continue  # a joint of several values, such as a floating base, which no arm has
            where = f"group_state {state.get('name')}: {joint.get('name')}"
            try:
                value = float(numbers[0])
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise UrdfError(path, where, numbers[0], "a number")
            values[joint.get("name", "")] = value
    groups = {group.get("name", ""): _group(group) for group in root.iterfind("group")}
    effectors = [
        EndEffector(*(e.get(key, "") for key in ("name", "parent_link", "group", "parent_group")))
        for e in root.iterfind("end_effector")
    ]
    return Srdf(path, frozenset(disabled), states, groups, tuple(effectors))


def _group(group: ET.Element) -> Group:
    joints, links, groups = (
        tuple(part.get("name", "") for part in group.iterfind(tag)) for tag in ("joint", "link", "group")
    )
    chains = [(chain.get("base_link", ""), chain.get("tip_link", "")) for chain in group.iterfind("chain")]
    return Group(joints, links, tuple(chains), groups)


def srdf_text(srdf: Srdf) -> bytes:
    """Return links that may touch and states of an SRDF as the text of a file."""
    root = ET.Element("robot", name=srdf.path.stem)
    for pair in sorted(sorted(pair) for pair in srdf.disabled):
        ET.SubElement(root, "disable_collisions", link1=pair[0], link2=pair[-1])
    for name, state in srdf.states.items():
        group = ET.SubElement(root, "group_state", name=name)
        for joint, value in state.items():
            ET.SubElement(group, "joint", name=joint, value=repr(value))
    return ET.tostring(root)
