"""Meshes are read completely, in metres with z up, or refused in one line."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.errors import MeshError
from symgrasp.meshes import MESH_ENDINGS, check_size, read_mesh, read_parts
from symgrasp.meshes.reading import MOST_INSTANCES, MOST_TRIANGLES

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


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_every_format_gives_the_triangles_that_were_written(tmp_path, ending):
    path = tmp_path / ("mesh" + ending)
    tetrahedron().export(path)
    if ending == ".dae":
        path.write_text(path.read_text().replace("Y_UP", "Z_UP"))
    expected = CORNERS[FACES]
    if ending == ".glb":  # y is up in glTF, and z to the front
        expected = np.stack([expected[..., 0], -expected[..., 2], expected[..., 1]], axis=-1)
    assert same_triangles(read_mesh(path).triangles, expected)
    assert same_triangles(read_mesh(path, upright=False).triangles, CORNERS[FACES])
    assert sum(len(part.faces) for part in read_parts(path)) == len(FACES)


# -- COLLADA ------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.001, 0.0254])
def test_the_unit_of_collada_counts(tmp_path, unit):
    path = write(tmp_path, "wall.dae", collada(f'<unit meter="{unit}"/><up_axis>Z_UP</up_axis>'))
    for upright in (True, False):
        assert read_mesh(path, upright=upright).extents == pytest.approx(unit * np.array([0.2, 0.3, 0.5]))
    assert read_parts(path)[0].extents == pytest.approx(unit * np.array([0.2, 0.3, 0.5]))


@pytest.mark.parametrize(
    ("up", "right", "upwards", "inwards"),
    [("X_UP", -1, 0, 2), ("Y_UP", 0, 1, 2), ("Z_UP", 0, 2, -1), (None, 0, 1, 2)],
)
def test_the_vertical_of_collada_counts(tmp_path, up, right, upwards, inwards):
    """Its specification names the axes that point right, up and towards the viewer: x, z and -y here."""
    asset = f"<up_axis>{up}</up_axis>" if up else ""
    found = read_mesh(write(tmp_path, "wall.dae", collada(asset))).triangles
    seen = CORNERS[FACES]
    signed = lambda axis: -seen[..., 1] if axis == -1 else seen[..., axis]  # noqa: E731
    assert same_triangles(found, np.stack([signed(right), -signed(inwards), signed(upwards)], axis=-1))


def test_polygons_and_placed_meshes_of_collada_are_counted(tmp_path):
    quads = '<polylist count="2">INPUT<vcount>4 3</vcount><p>0 1 2 3 0 1 3</p></polylist>'
    twice = (
        '<node><instance_node url="#n"/></node><node><translate>1 0 0</translate>'
        '<instance_node url="#n"/></node>'
    )
    nodes = '<node id="n"><instance_geometry url="#g"/></node>'
    mesh = read_mesh(write(tmp_path, "wall.dae", collada(scene=twice, faces=quads, nodes=nodes)))
    assert len(mesh.faces) == 6
    assert mesh.extents[0] == pytest.approx(1.2)


def test_nodes_that_double_each_other_are_refused_at_once(tmp_path):
    nodes = "".join(
        f'<node id="n{k}"><instance_node url="#n{k + 1}"/><instance_node url="#n{k + 1}"/></node>'
        for k in range(60)
    )
    nodes += '<node id="n60"><instance_geometry url="#g"/></node>'
    path = write(tmp_path, "wall.dae", collada(scene='<node><instance_node url="#n0"/></node>', nodes=nodes))
    assert str(4 * 2**60) in refused(path)
    circle = '<node id="n"><instance_node url="#n"/></node>'
    text = collada(scene='<node><instance_node url="#n"/></node>', nodes=circle)
    assert "contains itself" in refused(write(tmp_path, "circle.dae", text))


# -- glTF ---------------------------------------------------------------------------------------


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


def test_every_instance_of_a_mesh_is_read(tmp_path):
    mesh = read_mesh(write(tmp_path, "wall.glb", glb(instances=3)))
    assert len(mesh.faces) == 12
    assert mesh.bounds[:, 0] == pytest.approx([0.0, 2.2])


def test_too_many_instances_are_refused_before_any_is_made(tmp_path, monkeypatch):
    def load_scene(*_: object, **__: object) -> None:
        raise AssertionError("the file was read")

    monkeypatch.setattr(trimesh, "load_scene", load_scene)
    assert "20000" in refused(write(tmp_path, "wall.glb", glb(instances=20_000)))
    assert MOST_INSTANCES < 20_000
    large = {
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * 2_000, "type": "SCALAR"},
        ]
    }
    assert str(2_000 * 2_000) in refused(write(tmp_path, "large.glb", glb(large, instances=2_000)))
    assert MOST_TRIANGLES < 2_000 * 2_000
    soup = b" " * 80 + (MOST_TRIANGLES + 1).to_bytes(4, "little") + bytes(50 * (MOST_TRIANGLES + 1))
    assert "at most" in refused(write(tmp_path, "large.stl", soup))


ATTRIBUTES = {"attributes": {"POSITION": 0}, "indices": 1}

DAMAGED_GLB: dict[str, tuple[dict[str, Any], str]] = {
    "two scenes": ({"scenes": [{"nodes": [0]}, {"nodes": [0]}]}, "2 scenes"),
    "no scene": ({"scenes": []}, "0 scenes"),
    "a mesh that is not placed": ({"scenes": [{"nodes": []}]}, "does not place"),
    "a node in a circle": ({"nodes": [{"mesh": 0, "children": [0]}]}, "contains itself"),
    "a node that is missing": ({"scenes": [{"nodes": [5]}]}, "GLB"),
    "a fan": ({"meshes": [{"primitives": [{**ATTRIBUTES, "mode": 6}]}]}, "0 of its 10"),
    "a camera in its place": ({"nodes": [{"mesh": 0, "camera": 0}], "cameras": [
        {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]}, "0 of its 4"),
    "another file": ({"buffers": [{"byteLength": 96, "uri": "/etc/passwd"}]}, "other files"),
    "compressed": ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression"),
    "a skin": ({"nodes": [{"mesh": 0, "skin": 0}]}, "bent"),
    "morphed": ({"meshes": [{"primitives": [{**ATTRIBUTES, "targets": [{"POSITION": 0}]}]}]}, "bent"),
    "zeros without data": ({"accessors": [
        {"componentType": 5126, "count": 4_000_000_000, "type": "VEC3"}]}, "not in the file"),
    "corners that are none": ({"accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}]}, "corner"),
    "a node twice": ({"nodes": [{"mesh": 0}, {"children": [0]}, {"children": [0]}],
                      "scenes": [{"nodes": [1, 2]}]}, "4 of its 8"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED_GLB)
def test_gltf_that_cannot_be_read_completely_is_refused(tmp_path, name):
    change, words = DAMAGED_GLB[name]
    assert words in refused(write(tmp_path, "wall.glb", glb(change)))


# -- OBJ ----------------------------------------------------------------------------------------


@given(st.data())
def test_obj_is_read_whatever_its_indices_count_from(tmp_path_factory, data):
    """Blocks of vertices and polygons that count from the beginning or back, with textures and comments."""
    points: list[list[float]] = []
    lines, expected = ["vt 0 0"], []
    for _ in range(data.draw(st.integers(1, 4))):
        lines.append(data.draw(st.sampled_from(["o part", "g 1", "# a comment", ""])))
        for _ in range(data.draw(st.integers(3, 6))):
            points.append([round(0.1 * len(points), 3), round(len(points) ** 0.5, 3), len(points) % 3])
            end = data.draw(st.sampled_from(["", " # corner", " 0.5 0.5 0.5", "\r"]))
            lines.append(
                data.draw(st.sampled_from(["v ", " v  ", "v\t"])) + " ".join(map(str, points[-1])) + end
            )
        for _ in range(data.draw(st.integers(1, 3))):
            size = data.draw(st.integers(3, 5))
            corners = data.draw(st.permutations(range(len(points))))[:size]
            if len(corners) < 3:
                continue
            form = data.draw(st.sampled_from(["{}", "{}/1", "{}/-1"]))
            back = data.draw(st.booleans())
            words = [form.format(k - len(points) if back else k + 1) for k in corners]
            split = data.draw(st.sampled_from([" ", " \\\n"]))
            lines.append("f " + split.join(words))
            expected += [[corners[0], a, b] for a, b in pairwise(corners[1:])]
    path = write(tmp_path_factory.mktemp("obj"), "wall.obj", "\n".join(lines))
    assert same_triangles(read_mesh(path).triangles, np.array(points, dtype=float)[np.array(expected)])


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SQUARE + "f 1 2 9", "index 8"),
        (SQUARE + "f 0 1 2", "line 5: no vertex 0"),
        (SQUARE + "f -1 -2 -5", "line 5: no vertex -5"),
        (SQUARE + "f 1 2 three", "OBJ"),
        (SQUARE + "l 1 2\np 3", "no triangles"),
        (SQUARE + "f 1 2 3\nsurf 0 1 0 1 1 2 3 4", "line 6: a free-form surface"),
        (SQUARE + "v 1 2\nf 1 2 3", "line 5: no vertex of three numbers"),
        (SQUARE + "v 1,5 2 0\nf 1 2 3", "line 5: no vertex of three numbers"),
        (SQUARE + "v nan 0 0\nf 1 2 5", "finite"),
    ],
)
def test_obj_that_cannot_be_read_completely_is_refused(tmp_path, text, words):
    assert words in refused(write(tmp_path, "wall.obj", text))


# -- PLY and OFF --------------------------------------------------------------------------------


def ply(faces: str, count: int = 3) -> str:
    head = "ply\nformat ascii 1.0\nelement vertex 5\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {count}\nproperty list uchar int vertex_indices\nend_header\n"
    return head + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 1\n" + faces


def test_polygons_of_ply_and_off_are_read(tmp_path):
    faces = "3 0 1 2\n4 0 1 2 3\n5 0 1 2 3 4\n"
    read = read_mesh(write(tmp_path, "wall.ply", ply(faces)))
    assert len(read.faces) == 1 + 2 + 3
    off = "OFF # a comment\n5 3 0\n\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 1\n" + faces
    assert same_triangles(read_mesh(write(tmp_path, "wall.off", off)).triangles, read.triangles)


def binary_ply(*lists: list[int]) -> bytes:
    text = ply("", len(lists)).replace("ascii", "binary_little_endian")
    head = text[: text.index("end_header")].encode() + b"end_header\n"
    body = CORNERS[[0, 1, 2, 3, 3]].astype("<f4").tobytes()
    return head + body + b"".join(bytes([len(k)]) + np.array(k, "<i4").tobytes() for k in lists)


def test_binary_ply(tmp_path):
    mesh = read_mesh(write(tmp_path, "quads.ply", binary_ply([0, 1, 2, 3], [1, 2, 3, 4])))
    assert len(mesh.faces) == 4
    # Their lengths add up to those of three quads, so the file is as long as it would be with them.
    assert "different" in refused(
        write(tmp_path, "mixed.ply", binary_ply([0, 1, 2, 3], [0, 1, 2, 3, 4], [0, 1, 2]))
    )
    refused(write(tmp_path, "cut.ply", binary_ply([0, 1, 2], [1, 2, 3])[:-4]))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("missing.ply", ply("3 0 1 2\n4 0 1 2 3\n"), "2 of 3 rows"),
        ("short.ply", ply("3 0 1 2\n4 0 1 2\n3 0 1 2\n"), "4 numbers"),
        ("edge.ply", ply("3 0 1 2\n2 0 1\n3 0 1 2\n"), "2 corners"),
        ("outside.ply", ply("3 0 1 2\n3 0 1 2\n3 0 1 9\n"), "corner"),
        ("strips.ply", ply("3 0 1 2\n").replace("element face", "element tristrips"), "tristrips"),
        ("points.ply", ply("", 0), "no triangles"),
        ("missing.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "2 faces"),
        ("short.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "a face of 3 corners"),
        ("outside.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "OFF"),
        ("four.off", "4OFF\n3 1 0\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n", "OFF"),
    ],
)  # fmt: skip
def test_ply_and_off_that_cannot_be_read_completely_are_refused(tmp_path, name, text, words):
    assert words in refused(write(tmp_path, name, text))


# -- STL ----------------------------------------------------------------------------------------


def stl(name: str = "") -> str:
    text = str(tetrahedron().export(file_type="stl_ascii"))
    return text.replace("solid \n", f"solid {name}\n", 1)


@pytest.mark.parametrize(
    "text",
    [
        stl().upper(),
        "\ufeff" + stl(),
        stl("vertex of a facet, endsolid"),
        stl().replace("\n", "\r\n"),
        stl().replace("normal", "normal nan nan nan #"),
        stl()[: stl().rindex("endsolid")] + "endsolid a solid name\n",
    ],
)
def test_text_stl_in_many_ways(tmp_path, text):
    assert same_triangles(read_mesh(write(tmp_path, "wall.stl", text)).triangles, CORNERS[FACES])


def test_several_solids_are_all_read(tmp_path):
    assert len(read_mesh(write(tmp_path, "wall.stl", stl("a") + stl("b"))).faces) == 8


def test_binary_stl_may_begin_like_a_text(tmp_path):
    path = tmp_path / "plain.stl"
    tetrahedron().export(path)
    content = path.read_bytes()
    path = write(tmp_path, "wall.stl", b"solid facet endsolid".ljust(80) + content[80:])
    assert same_triangles(read_mesh(path).triangles, CORNERS[FACES])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (stl()[: len(stl()) // 2], "the end is missing"),
        (stl()[: len(stl()) // 2] + "\nendsolid\n", "no complete triangle"),
        (stl().replace("0.5", "0,5"), "line"),
        (stl().replace("0.5", "nan"), "line"),
        (stl().replace("vertex 0.0 0.0 0.5\n", "", 1), "line"),
        ("solid empty\nendsolid empty\n", "no triangles"),
    ],
)
def test_damaged_text_stl_is_refused_in_one_line(tmp_path, text, words):
    """With nothing beside the line, as a program without any handler of logs sees it."""
    path = write(tmp_path, "wall.stl", text)
    assert words in refused(path)
    code = (
        "import sys\nfrom pathlib import Path\nfrom symgrasp.meshes import read_mesh\n"
        "try:\n    read_mesh(Path(sys.argv[1]))\nexcept ValueError as error:\n    print(error)\n"
    )
    run = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert run.stderr == ""
    assert run.stdout.count("\n") == 1


# -- all formats --------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_files_that_are_no_mesh_are_refused(tmp_path, ending, caplog):
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 12345\n"
    assert "git lfs pull" in refused(write(tmp_path, "pointer" + ending, pointer))
    assert "empty" in refused(write(tmp_path, "empty" + ending, ""))
    assert "No such file" in refused(tmp_path / ("missing" + ending))
    whole = tmp_path / ("whole" + ending)
    tetrahedron().export(whole)
    with warnings.catch_warnings(), caplog.at_level(logging.WARNING):
        warnings.simplefilter("error")
        for share in (0.3, 0.6, 0.9) if ending != ".obj" else ():  # it does not say how long it is
            content = whole.read_bytes()
            refused(write(tmp_path, "cut" + ending, content[: int(share * len(content))]))
    assert not caplog.records


@pytest.mark.parametrize("name", ["wall.3mf", "wall.gltf", "wall.step", "wall"])
def test_other_formats_are_refused(tmp_path, name):
    assert ".glb" in refused(write(tmp_path, name, "anything"))


@pytest.mark.parametrize(
    ("size", "scale", "words"),
    [
        (800.0, 1.0, ["scale 0.001 would make it 0.8 m"]),
        (20.0, 1.0, ["scale 0.01 would make it 0.2 m"]),
        (20.0, 2.0, ["scale 0.02 would make it 0.2 m"]),
        (0.0008, 0.001, ["scale 1 would make it 0.8 m"]),
        (1e9, 1.0, ["a size of 0.005 to 10 m"]),
    ],
)
def test_implausible_sizes_are_refused_with_what_would_mend_them(size, scale, words):
    mesh = trimesh.creation.box([size, size / 2, size / 3])
    with pytest.raises(MeshError) as caught:
        check_size(Path("wall.stl"), "obstacle wall", mesh, (0.005, 10.0), scale)
    assert all(word in str(caught.value) for word in words)
    check_size(Path("wall.stl"), "obstacle wall", trimesh.creation.box([5, 1, 1]), (0.005, 10.0))
