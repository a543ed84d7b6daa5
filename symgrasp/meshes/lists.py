"""Mesh files that list their triangles: STL, OBJ, OFF and PLY."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symgrasp.meshes.declared import BOM, Declared

__all__ = ["is_binary_stl", "obj", "off", "ply", "stl"]

# -- STL ----------------------------------------------------------------------------------------

NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
FACET = re.compile(
    rb"[ \t]*facet\b[^\n]*\s+outer[ \t]+loop"
    rb"(?:\s*\n\s*vertex[ \t]+" + rb"[ \t]+".join([NUMBER] * 3) + rb"[ \t]*(?=[\r\n])){3}"
    rb"\s+endloop\s+endfacet\b",
    re.IGNORECASE,
)
"""One triangle of an STL file in text form."""


def is_binary_stl(content: bytes) -> bool:
    """Whether a file is STL in binary form: as long as its number of triangles makes it."""
    return len(content) >= 84 and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")


def stl(content: bytes) -> Declared:
    """Read STL, in text or binary form."""
    if is_binary_stl(content):
        return Declared(content, int.from_bytes(content[80:84], "little"))
    # A solid may have any name, also one that looks like what follows.
    text = re.sub(rb"(?im)^[ \t]*(end)?solid\b.*$", rb"\1solid", content.removeprefix(BOM))
    if len(re.findall(rb"(?im)^solid", text)) != len(re.findall(rb"(?im)^endsolid", text)):
        raise ValueError("the end is missing")
    starts = [m.start() for m in re.finditer(rb"(?im)^[ \t]*facet\b", text)]
    for start in starts:
        if not FACET.match(text, start):
            raise ValueError(f"line {_line(text, start)}: no complete triangle with finite coordinates")
    return Declared(text, len(starts))


def _line(text: bytes, position: int) -> int:
    return text.count(b"\n", 0, position) + 1


# -- OBJ ----------------------------------------------------------------------------------------


def obj(content: bytes) -> Declared:
    """Read OBJ; polygons become triangles, and vertices that are counted from the end from the beginning."""
    counts = {"v": 0, "vt": 0, "vn": 0}
    lines: list[str] = []
    triangles = 0
    text = content.removeprefix(BOM).decode("latin-1").replace("\r\n", "\n").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split()
        key = words[0] if words else ""
        if key in counts or key == "f":
            words = line.partition("#")[0].split()
        if key == "f":
            try:
                corners = [_corner(word, counts) for word in words[1:]]
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
            triangles += max(len(corners) - 2, 0)  # with two corners it is an edge
            lines += [f"f {corners[0]} {a} {b}" for a, b in pairwise(corners[1:])]
        elif key in counts:
            counts[key] += 1
            if key == "v":
                _check_numbers(words[1:4], number)
            lines.append(" ".join(words))
        elif key in ("curv", "curv2", "surf"):
            raise ValueError(f"line {number}: a free-form surface")
        else:
            lines.append(line.strip())
    return Declared("\n".join(lines).encode("latin-1"), triangles)


def _corner(word: str, counts: Mapping[str, int]) -> str:
    """Return a corner of a face, such as 3/-1/4, with all its indices counted from the beginning.

    Raises:
        ValueError: it refers to nothing above it.
    """
    if "-" not in word and not word.startswith("0"):
        return word
    indices = []
    for text, count in zip(word.split("/"), counts.values(), strict=False):
        index = int(text or 1)
        if index < 0:
            index += count + 1
        if index < 1:
            raise ValueError(f"no vertex {word}")
        indices.append(str(index) if text else "")
    return "/".join(indices)


def _check_numbers(words: Sequence[str], line: int) -> None:
    """Raise ValueError unless a vertex has three numbers."""
    try:
        complete = len([float(word) for word in words]) == 3
    except ValueError:
        complete = False
    if not complete:
        raise ValueError(f"line {line}: no vertex of three numbers")


# -- OFF ----------------------------------------------------------------------------------------


def off(content: bytes) -> Declared:
    """Read OFF; polygons become triangles."""
    text = re.sub(r"#[^\n]*", "", content.removeprefix(BOM).decode("latin-1"))
    head, _, rest = text.partition("OFF")
    if head.strip() not in ("", "C", "N", "CN", "ST", "STC", "STN", "STCN"):
        raise ValueError(f"coordinates of the kind {head.strip()}OFF")
    rows = [row for row in rest.split("\n") if row.strip()]
    vertices, faces = (int(word) for word in rows[0].split()[:2])
    lines = rows[1 : 1 + vertices]
    polygons = [row.split() for row in rows[1 + vertices : 1 + vertices + faces]]
    if min(vertices, faces) < 0 or len(lines) + len(polygons) < vertices + faces:
        raise ValueError(f"{len(rows) - 1} lines for {vertices} vertices and {faces} faces")
    triangles = []
    for size, *corners in polygons:
        if not 3 <= int(size) <= len(corners):
            raise ValueError(f"a face of {size} corners: {' '.join(corners)[:40]}")
        fan = corners[1 : int(size)]
        triangles += [f"3 {corners[0]} {a} {b}" for a, b in pairwise(fan)]
    lines = ["OFF", f"{vertices} {len(triangles)} 0", *lines, *triangles]
    return Declared("\n".join(lines).encode("latin-1"), len(triangles))


# -- PLY ----------------------------------------------------------------------------------------

PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


class _Element(NamedTuple):
    """A kind of rows in a PLY file.

    Attributes:
        name: vertex, face or another.
        rows: their number.
        properties: name → its type, or of a list the types of its length and its values.
    """

    name: str
    rows: int
    properties: dict[str, tuple[str, ...]]


def ply(content: bytes) -> Declared:
    """Read PLY, in text or binary form."""
    head, _, body = content.partition(b"end_header")
    body = body.partition(b"\n")[2]
    elements: list[_Element] = []
    order = None
    for words in (line.split() for line in head.decode("latin-1").splitlines()):
        if words[:1] == ["format"]:
            order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[words[1]]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), {}))
        elif words[:1] == ["property"]:
            types = words[2:-1] if words[1] == "list" else words[1:-1]
            elements[-1].properties[words[-1]] = tuple(PLY_TYPES[word] for word in types)
    names = [element.name for element in elements]
    if "tristrips" in names or len(set(names)) < len(names):
        raise ValueError(f"elements {', '.join(names)}")
    counts = _ply_text(body, elements) if order == "" else _ply_binary(body, elements, order or "<")
    if len(counts) and counts.min() < 3:
        raise ValueError(f"a face of {counts.min()} corners")
    return Declared(content, int((counts - 2).sum()))


def _ply_text(body: bytes, elements: Sequence[_Element]) -> np.ndarray:
    """Return the number of corners (n,) of every face of a PLY file in text form."""
    rows = body.rstrip().split(b"\n")
    faces: list[int] = []
    for element in elements:
        own, rows = rows[: element.rows], rows[element.rows :]
        if len(own) < element.rows:
            raise ValueError(f"{len(own)} of {element.rows} rows for {element.name}")
        for words in (row.split() for row in own):
            at = 0
            for name, types in element.properties.items():
                size = int(words[at]) if len(types) == 2 else 1
                at += len(types) - 1 + size
                if element.name == "face" and name in CORNERS:
                    faces.append(size)
            if len(words) != at:
                raise ValueError(f"a row of {len(words)} numbers in place of {at} for {element.name}")
    return np.array(faces)


CORNERS = ("vertex_indices", "vertex_index")
"""What the list of the corners of a face is called in PLY."""


def _ply_binary(body: bytes, elements: Sequence[_Element], order: str) -> np.ndarray:
    """Return the number of corners (n,) of every face of a binary PLY file, where all have equally many."""
    faces = np.zeros(0, dtype=int)
    offset = 0
    for element in elements:
        if not element.rows:
            continue
        fields: list[tuple[str, str] | tuple[str, str, int]] = []
        for name, types in element.properties.items():
            if len(types) == 2:
                at = offset + np.dtype(fields).itemsize
                fields.append((f"length of {name}", order + types[0]))
                size = int(np.frombuffer(body, order + types[0], 1, at)[0])
                fields.append((name, order + types[1], size))
            else:
                fields.append((name, order + types[0]))
        rows = np.frombuffer(body, np.dtype(fields), element.rows, offset)
        offset += rows.nbytes
        lengths = [name for name in rows.dtype.names or () if name.startswith("length of ")]
        if any((rows[name] != rows[name][0]).any() for name in lengths):
            raise ValueError("polygons of different numbers of corners in a binary file")
        if element.name == "face":
            name = next(name for name in lengths if name.removeprefix("length of ") in CORNERS)
            faces = rows[name].astype(int)
    return faces
