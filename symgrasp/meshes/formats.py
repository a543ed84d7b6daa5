"""What a mesh file says of itself: how many triangles it has, in which unit, and which way is up.

The parser that reads the triangles afterwards leaves out what it does not understand without a word. So
what it returns is compared with the counts from here, which come from the text and the headers alone; they
are known before anything large is made of the file. Every function raises an exception where the file is
damaged or holds what the parser gets wrong.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from symgrasp.meshes.declared import BOM, Declared
from symgrasp.meshes.lists import is_binary_stl, obj, off, ply, stl
from symgrasp.meshes.placed import dae, glb

__all__ = ["FORMATS", "ending_of_content"]


def ending_of_content(content: bytes) -> str | None:
    """Return the file ending that fits the content of a mesh file, or None."""
    if content.startswith(b"glTF"):
        return ".glb"
    if re.match(rb"ply\s", content):
        return ".ply"
    if re.match(rb"\s*(#[^\n]*\n\s*)*(ST)?C?N?4?n?OFF\b", content):
        return ".off"
    # Some binary STL files begin with "solid" as well, so their length is what tells.
    if is_binary_stl(content):
        return ".stl"
    text = content.removeprefix(BOM)
    if re.match(rb"(?i)\s*solid\b", text) and re.search(rb"(?i)\bfacet\b|\bendsolid\b", text):
        return ".stl"
    if re.match(rb"\s*<", text) and b"<COLLADA" in text[:10_000]:
        return ".dae"
    if re.search(rb"^\s*v\s+[-+.\dnN]", text, re.MULTILINE):
        return ".obj"
    return None


FORMATS: Mapping[str, Callable[[bytes], Declared]] = {
    ".dae": dae,
    ".glb": glb,
    ".obj": obj,
    ".off": off,
    ".ply": ply,
    ".stl": stl,
}
"""File ending → what reads the declarations of that format; these are all formats that are read."""
