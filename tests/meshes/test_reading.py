"""Meshes are read completely, in metres with z up, or refused in one line."""

from __future__ import annotations

import logging
import subprocess
import sys
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.errors import MeshError
from symgrasp.meshes import MESH_ENDINGS, check_size, read_mesh, read_parts
from tests.meshes.files import CORNERS, FACES, refused, same_triangles, stl, tetrahedron, write


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
