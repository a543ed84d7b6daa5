"""Mesh files of a tetrahedron, as tests write them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from symgrasp.errors import MeshError
from symgrasp.meshes import read_mesh

CORNERS = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.5]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def tetrahedron() -> trimesh.Trimesh:
    return trimesh.Trimesh(CORNERS, FACES, process=False)


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def same_triangles(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two arrays (n, 3, 3) hold the same triangles in any order, each from any corner on."""

    def ordered(triangles: np.ndarray) -> np.ndarray:
        turned = [np.roll(t, -min(range(3), key=lambda k: t[k].round(5).tolist()), axis=0) for t in triangles]
        rows = np.array(turned).reshape(-1, 9)
        return rows[np.lexsort(rows.round(5).T)]

    return a.shape == b.shape and np.allclose(ordered(a), ordered(b), atol=1e-6)


def refused(path: Path) -> str:
    """Read a file, and return the one line that says why it cannot be."""
    with pytest.raises(MeshError) as caught:
        read_mesh(path, "obstacle wall")
    text = str(caught.value)
    assert "\n" not in text
    assert path.name in text
    return text


def collada(
    asset: str = '<unit meter="1"/><up_axis>Z_UP</up_axis>',
    scene: str = '<node><instance_geometry url="#g"/></node>',
    faces: str | None = None,
    nodes: str = "",
) -> str:
    numbers = " ".join(map(str, CORNERS.ravel()))
    indices = " ".join(map(str, FACES.ravel()))
    put = '<input semantic="VERTEX" source="#v" offset="0"/>'
    faces = faces or f'<triangles count="4">{put}<p>{indices}</p></triangles>'
    params = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    return (
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f"<asset>{asset}</asset><library_geometries><geometry id='g'><mesh><source id='p'>"
        f'<float_array id="a" count="12">{numbers}</float_array><technique_common>'
        f'<accessor source="#a" count="4" stride="3">{params}</accessor></technique_common></source>'
        f'<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{faces.replace("INPUT", put)}'
        f"</mesh></geometry></library_geometries><library_nodes>{nodes}</library_nodes>"
        f'<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )


def glb(change: dict[str, Any] | None = None, instances: int = 1) -> bytes:
    """The tetrahedron as GLB; ``change`` replaces parts of the header."""
    data = CORNERS.astype("<f4").tobytes() + FACES.astype("<u4").tobytes()
    header = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0, "translation": [k, 0, 0]} for k in range(instances)],
        "scenes": [{"nodes": list(range(instances))}],
        "scene": 0,
        **(change or {}),
    }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    parts = ((b"JSON", text), (b"BIN\0", data))
    chunks = b"".join(len(part).to_bytes(4, "little") + kind + part for kind, part in parts)
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def stl(name: str = "") -> str:
    text = str(tetrahedron().export(file_type="stl_ascii"))
    return text.replace("solid \n", f"solid {name}\n", 1)
