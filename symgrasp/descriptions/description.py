"""The description of a robot as a URDF, whatever format its file has."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from symgrasp.descriptions.mjcf import read_mjcf
from symgrasp.descriptions.srdf import Srdf
from symgrasp.descriptions.xacro_file import expand_xacro, is_xacro
from symgrasp.descriptions.xml_file import read_xml
from symgrasp.errors import UrdfError

__all__ = ["Description", "read_description"]


class Description(NamedTuple):
    """What the file of a robot says.

    Attributes:
        urdf: the tree of a URDF; references in it are relative to the folder of the file.
        made: whether the file is of another format, and the URDF was made of it.
        srdf: what else the file says, as an SRDF would; None where its format knows no such thing.
    """

    urdf: ET.Element
    made: bool
    srdf: Srdf | None = None


def read_description(
    path: Path, xacro_args: Mapping[str, str] | None = None, inside: Path | None = None
) -> Description:
    """Read the file of a robot: a URDF, a xacro file, which is expanded, or MJCF, which is converted.

    Args:
        path: the file.
        xacro_args: values of the arguments of a xacro file.
        inside: the folder that alone a file from elsewhere may read from; None for the user's own.

    Raises:
        UrdfError: it cannot be read, is of another format, or lacks what a robot needs.
    """
    root = read_xml(path, "URDF")
    made = is_xacro(path, root)
    if made:
        root = expand_xacro(path, xacro_args or {}, inside)
    elif xacro_args:
        raise UrdfError(path, "xacro_args", sorted(xacro_args), "a xacro file, which takes arguments")
    srdf = None
    if root.tag == "mujoco":
        made, (root, srdf) = True, read_mjcf(path, root, inside)
    if root.tag == "sdf":
        raise UrdfError(path, "urdf", "an SDF file of Gazebo", "a URDF; convert the file first")
    if root.tag != "robot" or root.find("link") is None:
        found = f"<{root.tag}> without links" if root.tag == "robot" else f"<{root.tag}>"
        raise UrdfError(path, "urdf", found, "<robot> with links, as in a URDF")
    return Description(root, made, srdf)
