"""Expanding xacro files, with the ``xacro`` package from PyPI, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from symgrasp.descriptions.xml_file import parse_xml
from symgrasp.errors import UrdfError, one_of
from symgrasp.references import VARIABLE

__all__ = ["expand_xacro", "is_xacro"]

NAMESPACES = ("wiki.ros.org/xacro}", "ros.org/wiki/xacro}")
"""In the tags of elements that xacro expands."""

CPU_SECONDS = 10
"""Most CPU time (s) of an expansion; large robots take a second."""

MEMORY = 1_000_000_000
"""Most memory (bytes) of the process that expands."""

LONGEST = 60.0
"""Time (s) after which an expansion is given up, however busy the machine is."""

SEARCHED = (VARIABLE, "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Environment variables that say where packages are; an expansion that is confined knows no others."""


def is_xacro(path: Path, root: ET.Element) -> bool:
    """Return whether a file is to be expanded: by its name, or by its elements."""
    return path.suffix == ".xacro" or any(name in e.tag for e in root.iter() for name in NAMESPACES)


def expand_xacro(path: Path, args: Mapping[str, str], inside: Path | None = None) -> ET.Element:
    """Return what a xacro file expands to.

    ``$(find package)`` is the folder of a package as `symgrasp.references` seeks it.

    Args:
        path: the file.
        args: values of its arguments.
        inside: the folder that alone may be read, and no environment variable be known; None for a file
            of the user's own.

    Raises:
        UrdfError: xacro is not installed; or the file cannot be expanded, lacks an argument or a package,
            does not know one of the arguments, or reads what it may not.
    """
    if find_spec("xacro") is None:
        expected = f"pip install 'symgrasp[xacro]', or a plain URDF: xacro {path.name} > {_plain_name(path)}"
        raise UrdfError(path, "urdf", "a xacro file", expected)
    request = {
        "path": str(path.resolve()), "args": dict(args), "inside": inside and str(inside.resolve()),
        "seconds": CPU_SECONDS, "memory": MEMORY,
    }  # fmt: skip
    answer = _run(path, json.dumps(request), confined=inside is not None)
    if "urdf" not in answer:
        raise UrdfError(path, answer["field"], answer["value"], answer["expected"])
    for name in args:
        if name not in answer["declared"]:
            raise UrdfError(path, "xacro_args", name, one_of(answer["declared"], name))
    try:
        return parse_xml(answer["urdf"].encode())
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UrdfError(path, "xacro", str(error), "one that expands to valid XML") from error


def _run(path: Path, request: str, confined: bool) -> dict[str, str]:
    """Return the answer of the process that expands; see `symgrasp.descriptions.xacro_process`."""
    environment = os.environ
    if confined:
        environment = {name: os.environ[name] for name in SEARCHED if name in os.environ}
    folders = os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path)
    command = [sys.executable, "-P", "-X", "utf8", "-m", "symgrasp.descriptions.xacro_process"]
    try:
        done = subprocess.run(
            command, input=request, capture_output=True, text=True, encoding="utf-8", timeout=LONGEST,
            cwd=path.resolve().parent, env={**environment, "PYTHONPATH": folders}, check=False,
        )  # fmt: skip
        return json.loads(done.stdout)
    except (subprocess.TimeoutExpired, ValueError) as error:  # it was stopped before it could answer
        expected = f"a file that expands within {CPU_SECONDS} s and {MEMORY / 1e9:g} GB of memory"
        raise UrdfError(path, "xacro", "no answer", expected) from error


def _plain_name(path: Path) -> str:
    return f"{path.name.partition('.')[0]}.urdf"
