"""Parsing the XML of robot files within bounds."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from pathlib import Path

from symgrasp.errors import UrdfError
from symgrasp.files import read_file

__all__ = ["LARGEST_XML", "parse_xml", "read_xml"]

LARGEST_XML = 5_000_000
"""Largest URDF, SRDF, xacro or MJCF file (bytes) that is read, and the largest URDF that is made of one."""

MOST_ELEMENTS, DEEPEST = 100_000, 50
"""Most XML elements of such a file, and how deep they may be nested."""


def read_xml(path: Path, kind: str) -> ET.Element:
    """Read an XML file.

    Args:
        path: the file.
        kind: what it should be, such as URDF, for error messages.

    Raises:
        UrdfError: it cannot be read, is too large, or is no XML.
    """
    try:
        return parse_xml(read_file(path, LARGEST_XML))
    except OSError as error:
        raise UrdfError(path, kind.lower(), str(path), f"a readable {kind} file") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UrdfError(path, kind.lower(), str(error), f"a valid {kind} document") from error


def parse_xml(content: bytes) -> ET.Element:
    """Parse XML; raise ValueError as soon as it has too many elements or nests them too deeply."""
    root, depth = None, 0
    events = ET.iterparse(io.BytesIO(content), ("start", "end"))
    for count, (event, element) in enumerate(events):
        root = element if root is None else root
        depth += 1 if event == "start" else -1
        if depth > DEEPEST:
            raise ValueError(f"elements nested more than {DEEPEST} deep")
        if count > 2 * MOST_ELEMENTS:
            raise ValueError(f"more than {MOST_ELEMENTS:,} elements")
    assert root is not None  # else the parser raises
    return root
