"""Mesh files that place meshes in a scene: glTF and COLLADA."""

from __future__ import annotations

import io
import json
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from symgrasp.meshes.declared import Declared
from symgrasp.poses import Array

__all__ = ["collada_up", "dae", "glb"]

Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Takes coordinates with y up and z to the front to z up and -y to the front."""

UP_AXES = {"Y_UP": Y_UP, "Z_UP": np.eye(4), "X_UP": np.eye(4)[[1, 2, 0, 3]] * [[-1.0], [-1.0], [1.0], [1.0]]}
"""The axes that COLLADA knows, each with its rotation to z up."""


# -- glTF ---------------------------------------------------------------------------------------

DRAWN = {"KHR_materials", "KHR_texture", "KHR_lights", "EXT_texture", "KHR_xmp"}
"""Beginnings of the names of extensions of glTF that leave the triangles as they are."""


def glb(content: bytes) -> Declared:
    """Read binary glTF, which has y up."""
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


def dae(content: bytes) -> Declared:
    """Read COLLADA, with the unit and the axis that it states."""
    root = ET.fromstring(content)
    unit = root.find("{*}asset/{*}unit")
    metres = 1.0 if unit is None else float(unit.get("meter", 1))
    if not 0 < metres < np.inf:
        raise ValueError(f"a unit of {metres:g} metres")
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
    return Declared(content, *placed, metres, _up(root))


def _up(root: ET.Element) -> Array:
    """Return the rotation (4, 4) that makes z of the axis which a COLLADA document states as up."""
    return UP_AXES[root.findtext("{*}asset/{*}up_axis", "Y_UP").strip()]


def collada_up(content: bytes) -> Array:
    """Return the rotation (4, 4) to z up of a COLLADA file, which need not be complete.

    Raises:
        ValueError: it states no axis that COLLADA knows.
    """
    try:
        for _, element in ET.iterparse(io.BytesIO(content)):
            if element.tag.rpartition("}")[2] == "asset":  # the document's own is its first one
                asset = ET.Element("COLLADA")
                asset.append(element)
                return _up(asset)
    except (ET.ParseError, KeyError) as error:
        raise ValueError(str(error)) from error
    raise ValueError("no asset")


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
