"""What the semantic description of a robot (SRDF) says: links that may touch, and states to park it in."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from symgrasp.errors import UrdfError
from symgrasp.robot.xacro_file import is_xacro
from symgrasp.robot.xml_file import read_xml

__all__ = ["Srdf", "find_srdf", "read_srdf", "srdf_text"]


@dataclass(frozen=True)
class Srdf:
    """The parts of an SRDF that count here.

    Attributes:
        path: the file.
        disabled: pairs of links whose collisions are not checked.
        states: name → joint → value (rad or m), the groups of one name joined.
    """

    path: Path
    disabled: frozenset[frozenset[str]]
    states: Mapping[str, Mapping[str, float]]


def find_srdf(urdf: Path) -> Path | None:
    """Return the SRDF that belongs to a URDF.

    It is the one of the same stem in the URDF's folder or in ``../srdf``, or else the only one there.
    """
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
    return Srdf(path, frozenset(disabled), states)


def srdf_text(srdf: Srdf) -> bytes:
    """Return an SRDF as the text of a file, which `read_srdf` reads as the same."""
    root = ET.Element("robot", name=srdf.path.stem)
    for pair in sorted(sorted(pair) for pair in srdf.disabled):
        ET.SubElement(root, "disable_collisions", link1=pair[0], link2=pair[-1])
    for name, state in srdf.states.items():
        group = ET.SubElement(root, "group_state", name=name)
        for joint, value in state.items():
            ET.SubElement(group, "joint", name=joint, value=repr(value))
    return ET.tostring(root)
