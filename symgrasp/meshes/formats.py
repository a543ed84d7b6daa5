"""What a mesh file says of itself: how many triangles it has, in which unit, and which way is up.

The parser that reads the triangles afterwards leaves out what it does not understand without a word. So
what it returns is compared with the counts from here, which come from the text and the headers alone; they
are known before anything large is made of the file. Every function raises an exception where the file is
damaged or holds what the parser gets wrong.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from symgrasp.poses import Array

__all__ = ["FORMATS", "Declared", "ending_of_content"]


class Declared(NamedTuple):
    """What a mesh file says of itself.

    Attributes:
        content: the file, put in a form that the parser reads right.
        triangles: their number, with polygons of n corners as n − 2, and once for each time they are placed.
        instances: how many times a mesh is placed.
        unit: length (m) of one unit of the file.
        upright: (4, 4) turns coordinates of the file so that z is up.
    """

    content: bytes
    triangles: int
    instances: int = 1
    unit: float = 1.0
    upright: Array | None = None


Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Takes coordinates with y up and z to the front to z up and -y to the front."""

UP_AXES = {"Y_UP": Y_UP, "Z_UP": np.eye(4), "X_UP": np.eye(4)[[1, 2, 0, 3]] * [[-1.0], [-1.0], [1.0], [1.0]]}
"""The axes that COLLADA knows, each with its rotation to z up."""

BOM = b"\xef\xbb\xbf"
"""Text files may begin with it."""


def ending_of_content(content: bytes) -> str | None:
    """Return the file ending that fits the content of a mesh file, or None."""
    if content.startswith(b"glTF"):
        return ".glb"
    if re.match(rb"ply\s", content):
        return ".ply"
    if re.match(rb"\s*(#[^\n]*\n\s*)*(ST)?C?N?4?n?OFF\b", content):
        return ".off"
    # Some binary STL files begin with "solid" as well, so their length is what tells.
    if _is_binary_stl(content):
        return ".stl"
    text = content.removeprefix(BOM)
    if re.match(rb"(?i)\s*solid\b", text) and re.search(rb"(?i)\bfacet\b|\bendsolid\b", text):
        return ".stl"
    if re.match(rb"\s*<", text) and b"<COLLADA" in text[:10_000]:
        return ".dae"
    if re.search(rb"^\s*v\s+[-+.\dnN]", text, re.MULTILINE):
        return ".obj"
    return None


# -- STL ----------------------------------------------------------------------------------------

NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
FACET = re.compile(
    rb"[ \t]*facet\b[^\n]*\s+outer[ \t]+loop"
    rb"(?:\s*\n\s*vertex[ \t]+" + rb"[ \t]+".join([NUMBER] * 3) + rb"[ \t]*(?=[\r\n])){3}"
    rb"\s+endloop\s+endfacet\b",
    re.IGNORECASE,
)
"""One triangle of an STL file in text form."""


def _is_binary_stl(content: bytes) -> bool:
    return len(content) >= 84 and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")


def _stl(content: bytes) -> Declared:
    if _is_binary_stl(content):
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


def _obj(content: bytes) -> Declared:
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


def _off(content: bytes) -> Declared:
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


def _ply(content: bytes) -> Declared:
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


# -- glTF ---------------------------------------------------------------------------------------

DRAWN = {"KHR_materials", "KHR_texture", "KHR_lights", "EXT_texture", "KHR_xmp"}
"""Beginnings of the names of extensions of glTF that leave the triangles as they are."""


def _glb(content: bytes) -> Declared:
    if int.from_bytes(content[8:12], "little") > len(content):
        raise ValueError("the end is missing")
    header = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    for name in header.get("extensionsRequired", ()):
        if not name.startswith(tuple(DRAWN)):
            raise ValueError(f"the extension {name}")
    if any("uri" in buffer for buffer in header.get("buffers", ())):
        raise ValueError("parts in other files")
    accessors, nodes = header.get("accessors", []), header.get("nodes", [])
    if any("bufferView" not in accessor for accessor in accessors):
        raise ValueError("numbers that are not in the file as they are")
    meshes = [sum(_gltf_triangles(p, accessors) for p in m["primitives"]) for m in header.get("meshes", [])]
    scenes = header.get("scenes", [])
    if len(scenes) != 1:
        raise ValueError(f"{len(scenes)} scenes")
    for node in nodes:
        if "mesh" in node and ("skin" in node or "EXT_mesh_gpu_instancing" in node.get("extensions", {})):
            raise ValueError("meshes that are bent or repeated when they are drawn")
    placed = _placed(
        scenes[0].get("nodes", []),
        lambda k: nodes[k].get("children", []),
        lambda k: [nodes[k]["mesh"]] if "mesh" in nodes[k] else [],
        meshes,
    )
    return Declared(content, *placed, upright=Y_UP)


def _gltf_triangles(primitive: Mapping[str, Any], accessors: Sequence[Mapping[str, Any]]) -> int:
    """Return the number of triangles of a primitive, without touching the numbers that it is made of."""
    if any("POSITION" in target for target in primitive.get("targets", ())):
        raise ValueError("meshes that are bent when they are drawn")
    corners = accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
    mode = primitive.get("mode", 4)
    if mode == 4:
        return corners // 3
    return max(corners - 2, 0) if mode in (5, 6) else 0


def _placed(
    roots: Iterable[Any],
    children: Callable[[Any], Iterable[Any]],
    own: Callable[[Any], Iterable[Any]],
    triangles: Sequence[int] | Mapping[Any, int],
) -> tuple[int, int]:
    """Count what the nodes of a scene place, without walking twice through one that is placed twice.

    Args:
        roots: the nodes of the scene.
        children: the nodes in a node.
        own: the keys of the meshes in a node.
        triangles: key of a mesh → its number of triangles.

    Returns:
        The number of triangles, and of instances of meshes.

    Raises:
        ValueError: a node contains itself, or a mesh with triangles is placed nowhere.
    """
    counts: dict[Any, tuple[int, int] | None] = {}
    used: set[Any] = set()

    def count(node: Any) -> tuple[int, int]:
        if node not in counts:
            counts[node] = None
            meshes = list(own(node))
            used.update(meshes)
            inner = [count(child) for child in children(node)]
            counts[node] = (
                sum(triangles[mesh] for mesh in meshes) + sum(t for t, _ in inner),
                len(meshes) + sum(n for _, n in inner),
            )
        found = counts[node]
        if found is None:
            raise ValueError("a node that contains itself")
        return found

    inner = [count(root) for root in roots]
    keys = triangles if isinstance(triangles, Mapping) else range(len(triangles))
    if any(triangles[key] for key in keys if key not in used):
        raise ValueError("a mesh that the scene does not place")
    return sum(t for t, _ in inner), sum(n for _, n in inner)


# -- COLLADA ------------------------------------------------------------------------------------


def _dae(content: bytes) -> Declared:
    root = ET.fromstring(content)
    unit = root.find("{*}asset/{*}unit")
    metres = 1.0 if unit is None else float(unit.get("meter", 1))
    if not 0 < metres < np.inf:
        raise ValueError(f"a unit of {metres:g} metres")
    up = root.findtext("{*}asset/{*}up_axis", "Y_UP").strip()
    triangles = {
        f"#{geometry.get('id')}": sum(_collada_triangles(part) for part in geometry.iterfind("{*}mesh/*"))
        for geometry in root.iterfind("{*}library_geometries/{*}geometry")
    }
    by_id = {f"#{node.get('id')}": node for node in root.iter() if node.get("id")}
    scene = by_id[root.find("{*}scene/{*}instance_visual_scene").get("url")]  # pyright: ignore

    def children(node: ET.Element) -> list[ET.Element]:
        return [
            *node.iterfind("{*}node"),
            *(by_id[inner.get("url", "")] for inner in node.iterfind("{*}instance_node")),
        ]

    if next(root.iter("{*}instance_controller"), None) is not None:
        raise ValueError("meshes that are bent when they are drawn")
    placed = _placed(
        scene.iterfind("{*}node"),
        children,
        lambda node: [inner.get("url", "") for inner in node.iterfind("{*}instance_geometry")],
        triangles,
    )
    return Declared(content, *placed, metres, UP_AXES[up])


def _collada_triangles(part: ET.Element) -> int:
    """Return the number of triangles in a part of a mesh."""
    kind = part.tag.rpartition("}")[2]
    if kind == "triangles":
        return int(part.get("count", 0))
    if kind == "polylist":
        return sum(int(corners) - 2 for corners in part.findtext("{*}vcount", "").split())
    if kind not in ("polygons", "tristrips", "trifans"):
        return 0
    if part.find("{*}ph") is not None:
        raise ValueError("polygons with holes")
    numbers = 1 + max((int(inner.get("offset", 0)) for inner in part.iterfind("{*}input")), default=0)
    return sum(len((p.text or "").split()) // numbers - 2 for p in part.iterfind("{*}p"))


FORMATS: Mapping[str, Callable[[bytes], Declared]] = {
    ".dae": _dae,
    ".glb": _glb,
    ".obj": _obj,
    ".off": _off,
    ".ply": _ply,
    ".stl": _stl,
}
"""File ending → what reads the declarations of that format; these are all formats that are read."""
