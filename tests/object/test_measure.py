from __future__ import annotations

import struct
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.errors import MeshError
from symgrasp.object.measure.axis import find_axis
from symgrasp.object.measure.measurement import SIMPLIFY_TOLERANCE, Measurement, measure_mesh
from symgrasp.object.measure.meridian import column_angles, cut, envelope
from symgrasp.object.measure.mesh_io import read_single_object
from symgrasp.object.measure.outline import distance_outside, simplify
from symgrasp.object.profile import Profile
from symgrasp.poses import from_position_quat, from_position_rpy, inverse
from symgrasp.references import package_dir

MUG = Path(package_dir("pybullet_data") or "") / "objects/mug.obj"


def joined(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    mesh = trimesh.util.concatenate(parts)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def ball(r: float, rows: int) -> list[tuple[float, float]]:
    angles = np.linspace(0.0, np.pi, rows + 1)[1:-1]
    middle = [(r * np.sin(a), r - r * np.cos(a)) for a in angles]
    return [(0.0, 0.0), *middle, (0.0, 2 * r)]


def barrel(rows: int) -> list[tuple[float, float]]:
    s = np.linspace(0.0, 1.0, rows + 1)
    return [(0.0, 0.0), *((0.03 + 0.01 * np.sin(np.pi * x), 0.1 * x) for x in s), (0.0, 0.1)]


BOTTLE = [(0, 0), (0.033, 0), (0.033, 0.15), (0.014, 0.2), (0.014, 0.24), (0, 0.24)]
GLASS_OUTSIDE = [
    (0, 0), (0.035, 0), (0.034, 0.002), (0.005, 0.007), (0.004, 0.08),
    (0.012, 0.085), (0.03, 0.11), (0.036, 0.14), (0.03, 0.2),
]  # fmt: skip
GLASS = [*GLASS_OUTSIDE, (0.0288, 0.2), (0.0345, 0.14), (0.028, 0.11), (0, 0.086)]
TUMBLER = [(0, 0), (0.03, 0), (0.04, 0.12), (0.0375, 0.12), (0.028, 0.008), (0, 0.008)]
STRAIGHT = {
    "cylinder": [(0, 0), (0.033, 0), (0.033, 0.115), (0, 0.115)],
    # All three moments of inertia of this one are equal.
    "cubic cylinder": [(0, 0), (0.03, 0), (0.03, 0.03 * 3**0.5), (0, 0.03 * 3**0.5)],
    "frustum": [(0, 0), (0.04, 0), (0.025, 0.1), (0, 0.1)],
    "bottle": BOTTLE,
    "glass": GLASS,
    "tumbler": TUMBLER,
    "log": [(0, 0), (0.035, 0), (0.035, 1.2), (0, 1.2)],
}
OUTSIDE = {"glass": [*GLASS_OUTSIDE, (0, 0.2)], "tumbler": [*TUMBLER[:3], (0, 0.12)]}
CURVED = {"sphere": lambda facets: ball(0.033, facets // 2), "barrel": lambda facets: barrel(facets // 2)}
SHAPES = [*STRAIGHT, *CURVED]


def random_pose(rng: np.random.Generator) -> np.ndarray:
    return from_position_quat(rng.uniform(-1, 1, 3), rng.standard_normal(4))


def z_up(ending: str) -> np.ndarray:
    """Rotation (4, 4) of what is read from a file, relative to its numbers."""
    return from_position_rpy([0, 0, 0], [np.pi / 2 if ending == ".glb" else 0.0, 0, 0])


def along(outline: np.ndarray) -> np.ndarray:
    """Points (n, 2) every 0.1 mm or so along an outline."""
    parts = [
        a + np.linspace(0, 1, max(2, int(np.linalg.norm(b - a) / 1e-4)))[:, None] * (b - a)
        for a, b in pairwise(outline)
    ]
    return np.concatenate(parts)


def outline_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Hausdorff distance of two outlines."""
    return max(to_outline(along(a), b).max(), to_outline(along(b), a).max())


def to_outline(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    nearest = np.full(len(points), np.inf)
    for a, b in pairwise(outline):
        s = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(points - a - s[:, None] * (b - a), axis=1))
    return nearest


def save(folder: Path, mesh: trimesh.Trimesh, name: str = "mesh.ply") -> Path:
    path = folder / name
    mesh.export(path)
    return path


class Case:
    """A mesh made of a known profile, and what was measured from it, in the same frame."""

    def __init__(self, folder: Path, shape: str, facets: int, noise: float, seed: int, ending: str) -> None:
        rng = np.random.default_rng(seed)
        knots = STRAIGHT[shape] if shape in STRAIGHT else CURVED[shape](facets)
        mesh = trimesh.creation.revolve(np.array(knots, dtype=float), sections=facets)
        # How far chords lie inside: around the axis, and for a curved profile along it as well.
        r = max(radius for radius, _ in knots)
        self.facet = r * (1 - np.cos(np.pi / facets)) * (2 if shape in CURVED else 1)
        mesh.vertices += noise * rng.standard_normal(mesh.vertices.shape)
        self.pose = random_pose(rng)
        mesh.apply_transform(self.pose)
        self.found = measure_mesh(save(folder, mesh, "mesh" + ending))
        self.truth = np.array(OUTSIDE.get(shape, knots), dtype=float)[:, ::-1]
        relative = inverse(z_up(ending) @ self.pose) @ self.found.T_mesh_object
        self.up = bool(relative[2, 2] > 0)
        if shape == "sphere":  # every axis through the centre is right
            self.axis_error = 0.0
            start = relative[:3, :3].T @ (np.array([0, 0, 0.033]) - relative[:3, 3])
            self.off_axis = float(np.hypot(start[0], start[1]))
            self.bottom = 0.033 - start[2]
            self.up = True
        else:
            self.axis_error = float(np.rad2deg(np.arctan2(np.hypot(*relative[:2, 2]), abs(relative[2, 2]))))
            self.off_axis = float(np.hypot(relative[0, 3], relative[1, 3]))
            self.bottom = relative[2, 3]

    @property
    def outline(self) -> np.ndarray:
        """The measured outline [h, r] where the true one is, closed by flat ends."""
        points = self.found.points
        closed = np.concatenate([[[points[0, 0], 0.0]], points, [[points[-1, 0], 0.0]]])
        return closed * [1.0 if self.up else -1.0, 1.0] + [self.bottom, 0.0]


def some_cases() -> list[tuple[str, int, float, int, str]]:
    """Each shape with many and few facets, with noise and without, each time in another pose."""
    endings = (".stl", ".obj", ".ply", ".off", ".glb")
    grid = [(s, f, n) for s in SHAPES for f in (24, 37, 120) for n in (0.0, 2e-4)]
    grid += [(s, 256, 2e-4) for s in ("bottle", "glass", "barrel")]
    return [(*case, k, endings[k % len(endings)]) for k, case in enumerate(grid)]


@pytest.mark.parametrize(("shape", "facets", "noise", "seed", "ending"), some_cases())
def test_known_profiles_are_found_in_any_pose(tmp_path, shape, facets, noise, seed, ending):
    found = Case(tmp_path, shape, facets, noise, seed, ending)
    assert found.axis_error < (0.2 if noise else 0.01)
    assert found.off_axis < found.facet + 3e-4
    assert outline_distance(found.truth, found.outline) < found.facet + 3e-4
    assert found.found.simplification <= SIMPLIFY_TOLERANCE <= 2e-4


@pytest.mark.parametrize("shape", STRAIGHT)
def test_facets_do_not_shrink_a_straight_profile(tmp_path, shape):
    # The vertices lie on the true surface, so even a prism of 24 sides has the exact radius.
    found = Case(tmp_path, shape, 24, 0.0, 5, ".stl")
    assert outline_distance(found.truth, found.outline) < 2e-5
    assert found.axis_error < 1e-4
    assert found.off_axis < 1e-6


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("facets", [32, 200])
def test_flat_ends_stay_flat_under_noise(tmp_path, facets, seed):
    # One vertex in the middle of each end moves the whole disc, yet r(h) holds up to the ends.
    found = Case(tmp_path, "cylinder", facets, 2e-4, seed, ".ply").found
    h = np.linspace(0.0, found.points[-1, 0], 500)
    assert np.interp(h, *found.points.T) == pytest.approx(
        0.033, abs=3e-4 + 0.033 * (1 - np.cos(np.pi / facets))
    )
    assert found.points[-1, 0] == pytest.approx(0.115, abs=3e-4)


@pytest.mark.parametrize(("shape", "seed"), [("bottle", 1), ("glass", 2), ("tumbler", 3), ("frustum", 4)])
def test_objects_stand_on_their_closed_or_wider_end(tmp_path, shape, seed):
    # The tumbler's mouth is wider than its base, but hollow.
    assert Case(tmp_path, shape, 48, 0.0, seed, ".ply").up


@pytest.mark.parametrize(("ending", "turn"), [(".ply", 0.0), (".glb", -np.pi / 2)])
def test_an_upright_mesh_stays_upright(tmp_path, ending, turn):
    # A bottle upside down in the file, and 5° off: z is up in PLY, y in GLB.
    mesh = trimesh.creation.revolve(np.array(BOTTLE, dtype=float), sections=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi + np.deg2rad(5) + turn, [1, 0, 0]))
    mesh.apply_translation([0.3, 0.2, 0.1])
    found = measure_mesh(save(tmp_path, mesh, "upside_down" + ending))
    assert found.T_mesh_object[2, 2] > np.cos(np.deg2rad(6))
    assert found.points[0, 1] == pytest.approx(0.014, abs=1e-5)


def test_the_pose_puts_the_mesh_on_the_profile(tmp_path):
    mesh = trimesh.creation.revolve(np.array(BOTTLE, dtype=float), sections=64)
    mesh.apply_transform(random_pose(np.random.default_rng(8)))
    path = save(tmp_path, mesh)
    profile = Profile.from_mesh(path)
    assert profile.T_mesh_object is not None
    x, y, h = (trimesh.transform_points(mesh.vertices, inverse(profile.T_mesh_object))).T
    assert h.min() == pytest.approx(0.0, abs=1e-5)
    on_wall = np.hypot(x, y) > 1e-3
    inside = np.clip(h, profile.h_min, profile.h_max)
    assert np.hypot(x, y)[on_wall] == pytest.approx(profile.radius(inside[on_wall]), abs=5e-5)
    assert Profile(BOTTLE_POINTS).T_mesh_object is None


BOTTLE_POINTS = [[0, 0.033], [0.15, 0.033], [0.20, 0.014], [0.24, 0.014]]


def test_scale_is_metres_in_a_unit_of_the_file(tmp_path):
    mesh = trimesh.creation.revolve(1000 * np.array(BOTTLE, dtype=float), sections=32)
    found = measure_mesh(save(tmp_path, mesh), scale=0.001)
    assert found.points == pytest.approx(np.array(BOTTLE_POINTS), abs=1e-5)


def test_a_sharp_step_stays_sharp(tmp_path):
    jar = [(0, 0), (0.03, 0), (0.03, 0.08), (0.035, 0.08), (0.035, 0.1), (0, 0.1)]
    points = measure_mesh(save(tmp_path, trimesh.creation.revolve(np.array(jar), sections=48))).points
    assert len(points) == 4
    assert points[2, 0] - points[1, 0] < 2e-5
    assert points[1:3, 1] == pytest.approx([0.03, 0.035], abs=1e-5)


def test_holes_in_the_ends_do_not_matter(tmp_path):
    mesh = trimesh.creation.revolve(np.array(BOTTLE, dtype=float), sections=48)
    mesh.update_faces(np.abs(mesh.face_normals[:, 2]) < 0.99)
    assert not mesh.is_watertight
    assert measure_mesh(save(tmp_path, mesh)).points == pytest.approx(np.array(BOTTLE_POINTS), abs=1e-5)


def bumped(height: float, angle: float, size: float, width: float = 4e-3) -> trimesh.Trimesh:
    """A finely meshed can with a round bump or dent."""
    rows = np.linspace(0, 0.12, 61)
    mesh = trimesh.creation.revolve(np.array([(0, 0), *((0.03, z) for z in rows), (0, 0.12)]), sections=120)
    centre = [0.03 * np.cos(angle), 0.03 * np.sin(angle), height]
    rise = size * np.exp(-((np.linalg.norm(mesh.vertices - centre, axis=1) / width) ** 2))
    mesh.vertices += rise[:, None] * [np.cos(angle), np.sin(angle), 0]
    return mesh


@pytest.mark.parametrize("size", [1.3e-3, -1.3e-3])
def test_the_map_shows_a_bump_where_it_is(tmp_path, size):
    found = measure_mesh(save(tmp_path, bumped(0.04, np.deg2rad(45), size)))
    largest, height, angle = found.worst
    assert largest == pytest.approx(abs(size), abs=1e-4)
    assert height == pytest.approx(0.04, abs=1e-3)
    assert np.rad2deg(angle) == pytest.approx(45, abs=3)
    row = np.argmin(np.abs(found.heights - height))
    column = np.argmin(np.abs(found.angles - angle))
    assert np.sign(found.deviation[row, column]) == np.sign(size)
    # Far from it there are only the facets of a circle of 120 chords.
    assert found.largest[np.abs(found.heights - 0.04) > 0.02].max() < 0.03 * (1 - np.cos(np.pi / 120)) + 2e-5
    rms = np.sqrt(np.mean(found.deviation**2, axis=1))
    assert rms.shape == found.heights.shape
    assert rms[row] > 5 * np.median(rms)
    assert 0 < found.overall_rms < rms.max()


def test_a_spike_between_the_angles_of_the_map_is_not_missed(tmp_path):
    with pytest.raises(MeshError, match=r"\+1\.9 mm at height 0.060 m, angle 3°"):
        measure_mesh(save(tmp_path, bumped(0.06, np.deg2rad(3), 1.9e-3, width=1e-4)))


def test_results_are_read_only(tmp_path):
    found = measure_mesh(save(tmp_path, bumped(0.04, 0.0, 0.0)))
    for array in (found.points, found.T_mesh_object, found.heights, found.angles, found.deviation):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    assert isinstance(found, Measurement)


@pytest.mark.parametrize("axis", [None, 3, 11])
def test_the_mug_is_refused_at_its_handle(tmp_path, axis):
    path = MUG
    if axis is not None:
        mesh = trimesh.load_mesh(MUG, process=False)
        mesh.apply_transform(random_pose(np.random.default_rng(axis)))
        path = save(tmp_path, mesh, "mug.stl")
    with pytest.raises(MeshError) as caught:
        measure_mesh(path)
    assert caught.value.field == "symmetry"
    # The handle spans 17 to 83 mm and reaches 40 mm out; the file has it along +y.
    value = str(caught.value.value)
    assert value.startswith("+39.")
    height, angle = value.split("height ")[1].split(" m, angle ")
    assert 0.017 < float(height) < 0.083
    if axis is None:
        assert 80 < float(angle.rstrip("°")) < 100
    # Whoever insists gets the mug without its handle, and the handle on the map.
    found = measure_mesh(path, tolerance=0.05)
    assert found.points[:, 1].max() == pytest.approx(0.041, abs=3e-4)
    assert found.worst[0] == pytest.approx(0.0397, abs=2e-4)


def test_tolerance_grows_with_the_object(tmp_path):
    squeezed = np.diag([1.05, 1.0, 1.0, 1.0])
    small = trimesh.creation.cylinder(0.03, 0.1, sections=64).apply_transform(squeezed)
    large = trimesh.creation.cylinder(0.3, 0.6, sections=64).apply_transform(squeezed)
    assert measure_mesh(save(tmp_path, small)).tolerance == 1.5e-3
    found = measure_mesh(save(tmp_path, large))
    assert found.tolerance == pytest.approx(0.03 * found.points[:, 1].max())
    assert 5e-3 < found.worst[0] < found.tolerance
    with pytest.raises(MeshError, match="symmetry"):
        measure_mesh(save(tmp_path, small), tolerance=5e-4)


def knob(offset: float) -> trimesh.Trimesh:
    top = trimesh.creation.cylinder(0.006, 0.02, sections=24)
    top.apply_translation([offset, 0, 0.055])
    return joined([trimesh.creation.cylinder(0.03, 0.1, sections=48), top])


def slanted() -> trimesh.Trimesh:
    mesh = trimesh.creation.cylinder(0.03, 0.3, sections=48)
    upper = mesh.vertices[:, 2] > 0
    mesh.vertices[upper, 2] += 0.5 * mesh.vertices[upper, 0]
    return mesh


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box([0.05, 0.05, 0.1]),
        trimesh.creation.cylinder(0.03, 0.1, sections=6),
        knob(0.02),
        slanted(),
    ],
    ids=["box", "hexagon", "knob beside the axis", "slanted end"],
)
def test_what_is_not_of_revolution_is_refused(tmp_path, mesh):
    with pytest.raises(MeshError) as caught:
        measure_mesh(save(tmp_path, mesh))
    assert caught.value.field == "symmetry"


def test_a_knob_on_the_axis_is_part_of_the_object(tmp_path):
    found = measure_mesh(save(tmp_path, knob(0.0)))
    assert found.points[-1] == pytest.approx([0.115, 0.006], abs=2e-5)


def refused(path: Path, field: str, **options: Any) -> str:
    with pytest.raises(MeshError) as caught:
        measure_mesh(path, **options)
    assert caught.value.field == field
    text = str(caught.value)
    assert "\n" not in text
    assert path.name in text
    return text


CAN = trimesh.creation.cylinder(0.033, 0.115, sections=32)


def test_millimetres_are_refused_with_the_remedy(tmp_path):
    path = save(tmp_path, CAN.copy().apply_scale(2000), "can.stl")
    text = refused(path, "size")
    assert "230 m" in text
    assert "--scale 0.001" in text
    assert "--scale" in refused(save(tmp_path, CAN.copy().apply_scale(1e-3), "tiny.stl"), "size")


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_scales(tmp_path, scale):
    refused(save(tmp_path, CAN), "scale", scale=scale)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan")])
def test_bad_tolerances(tmp_path, tolerance):
    refused(save(tmp_path, CAN), "tolerance", tolerance=tolerance)


@pytest.mark.parametrize("offset", [[0.1, 0, 0], [0.05, 0.05, 0.01], [0, 0, 0.2], [0, 0.0665, 0]])
def test_bodies_apart_are_refused(tmp_path, offset):
    pair = joined([CAN, CAN.copy().apply_translation(offset)])
    assert "2" in refused(save(tmp_path, pair), "bodies")


def test_parts_that_touch_or_enclose_are_one_body(tmp_path):
    inside = trimesh.creation.cylinder(0.02, 0.1, sections=32)
    stacked = trimesh.creation.cylinder(0.02, 0.05, sections=32).apply_translation([0, 0, 0.0825])
    # Touches the body only by way of the one below it.
    higher = trimesh.creation.cylinder(0.025, 0.05, sections=32).apply_translation([0, 0, 0.1325])
    found = measure_mesh(save(tmp_path, joined([CAN, inside, stacked, higher])))
    assert found.points[-1] == pytest.approx([0.215, 0.025], abs=2e-5)


def test_open_meshes_are_refused(tmp_path):
    half = CAN.copy()
    half = half.subdivide().subdivide().subdivide()
    half.update_faces(half.triangles_center[:, 0] > 0)
    assert "open" in refused(save(tmp_path, half), "surface")
    sheet = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]])
    refused(save(tmp_path, sheet), "surface")
    point = trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False)
    refused(save(tmp_path, point, "point.obj"), "surface")


def test_empty_and_broken_files_are_refused(tmp_path):
    only_points = tmp_path / "points.obj"
    only_points.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    refused(only_points, "content")
    missing_vertex = tmp_path / "index.obj"
    missing_vertex.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    refused(missing_vertex, "content")
    for ending in ("stl", "obj", "ply", "off", "glb"):
        whole = save(tmp_path, CAN, "whole." + ending).read_bytes()
        for name, content in [
            ("empty", b""),
            ("text", b"no mesh at all\n" * 9),
            ("half", whole[: len(whole) // 2]),
        ]:
            path = tmp_path / f"{name}.{ending}"
            path.write_bytes(content)
            refused(path, "content")


def test_content_must_be_what_the_ending_says(tmp_path):
    endings = ("stl", "obj", "ply", "off", "glb")
    for said, is_ in zip(endings, endings[1:] + endings[:1], strict=True):
        path = tmp_path / f"wrong.{said}"
        path.write_bytes(save(tmp_path, CAN, "right." + is_).read_bytes())
        assert is_.upper() in refused(path, "content")


def test_missing_files_and_unknown_endings(tmp_path):
    refused(tmp_path / "none.stl", "file")
    (tmp_path / "folder.stl").mkdir()
    refused(tmp_path / "folder.stl", "file")
    assert ".glb" in refused(tmp_path / "can.step", "ending")


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    content = bytearray(save(tmp_path, CAN, "nan.stl").read_bytes())
    content[84 + 12 : 84 + 16] = struct.pack("<f", float("nan"))
    (tmp_path / "nan.stl").write_bytes(content)
    assert "finite" in refused(tmp_path / "nan.stl", "content")
    lines = save(tmp_path, CAN, "nan.obj").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("v "))
    lines[first] = "v nan 0 0"
    (tmp_path / "nan.obj").write_text("\n".join(lines))
    assert "finite" in refused(tmp_path / "nan.obj", "content")


def test_ascii_stl_is_read(tmp_path):
    path = tmp_path / "can.stl"
    path.write_text(CAN.export(file_type="stl_ascii"))
    assert len(read_single_object(path).faces) == len(CAN.faces)


@given(st.integers(0, 10**6))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_cuts_are_those_of_a_plane(seed):
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.05)
    mesh.vertices += 0.003 * rng.standard_normal(mesh.vertices.shape) + 0.01
    cuts = cut(mesh.vertices, mesh.faces, 7)
    for j, angle in enumerate(column_angles(7)):
        normal = [-np.sin(angle), np.cos(angle), 0]
        lines = np.asarray(trimesh.intersections.mesh_plane(mesh, normal, [0, 0, 0]))
        out = lines @ [np.cos(angle), np.sin(angle), 0]
        # Both keep the same part of the plane: compare the lengths of what lies beyond the axis.
        share = np.clip(out.max(axis=1) / np.maximum(np.ptp(out, axis=1), 1e-300), 0, 1)
        share[out.min(axis=1) >= 0] = 1.0
        expected = (share * np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)).sum()
        mine = cuts.column == j
        lengths = np.hypot(np.diff(cuts.h[mine], axis=1), np.diff(cuts.r[mine], axis=1))
        assert lengths.sum() == pytest.approx(expected, abs=1e-9)
    assert cuts.r.min() >= 0


def test_the_envelope_is_the_largest(tmp_path):
    x = np.array([[0.0, 2.0], [1.0, 3.0], [2.0, 2.0]])
    y = np.array([[0.0, 2.0], [5.0, 5.0], [1.0, 7.0]])
    largest, other = envelope(np.zeros(3, dtype=int), x, y, np.array([0.5, 1.5, 2.0, 4.0]), 1, 10 * y)
    assert largest[:, 0].tolist() == [0.5, 5.0, 7.0, -np.inf]
    assert other[:3, 0].tolist() == [5.0, 50.0, 70.0]
    assert np.isnan(other[3, 0])


@given(st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=60), st.floats(1e-5, 5e-3))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_simplified_profiles_stay_within_the_tolerance(steps, tolerance):
    outline = np.column_stack([np.linspace(0.0, 0.05, len(steps)), np.abs(np.cumsum(steps))])
    few = simplify(outline, tolerance)
    assert np.abs(np.interp(outline[:, 0], *few.T) - outline[:, 1]).max() <= tolerance
    assert {tuple(p) for p in few} <= {tuple(p) for p in outline}
    assert len(simplify(np.column_stack([outline[:, 0], 2 * outline[:, 0]]), tolerance)) == 2


def test_knots_at_one_height_end_the_simplification():
    assert len(simplify(np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]), 0.1)) >= 2


def test_distances_outside_an_outline():
    outline = np.array([[0.0, 1.0], [2.0, 1.0], [2.00001, 3.0], [4.0, 3.0]])
    points = [[1, 1.5], [1, 0.8], [-0.25, 0.5], [0.125, 0.25], [1.9, 2.0], [5, 0.0], [3, 0.0]]
    expected = [0.5, -0.2, 0.25, -0.125, 0.1, 1.0, -1.0]
    assert distance_outside(np.array(points), outline) == pytest.approx(expected, abs=1e-4)


def test_a_ball_keeps_the_axis_of_its_file():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.033)
    axis = find_axis(mesh)[:3, 2]
    assert abs(axis[2]) > 0.999


def axis_errors(knots: list[tuple[float, float]], facets: int, noise: float, seeds: int) -> np.ndarray:
    """Errors (seeds,) in degrees of the axis of noisy meshes in random poses."""
    errors = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        mesh = trimesh.creation.revolve(np.array(knots, dtype=float), sections=facets)
        mesh.vertices += noise * rng.standard_normal(mesh.vertices.shape)
        pose = random_pose(rng)
        found = find_axis(mesh.apply_transform(pose))
        errors.append(np.rad2deg(np.arcsin(np.linalg.norm(np.cross(pose[:3, 2], found[:3, 2])))))
    return np.array(errors)


def test_many_facets_average_the_noise():
    # Two rings of 256 vertices, 0.2 mm off at random, 115 mm apart: 0.2 √2 √2 / √256 / 115 rad each way.
    expected = np.rad2deg(2e-4 * 2 / np.sqrt(256) / 0.115)
    assert np.sqrt(np.mean(axis_errors(STRAIGHT["cylinder"], 256, 2e-4, 5) ** 2)) < 2.5 * expected


def test_the_axis_runs_through_the_middle():
    mesh = trimesh.creation.revolve(np.array(STRAIGHT["cylinder"], dtype=float), sections=256)
    # A sixth of the wall is flattened, so that neither centroid nor normals point at the middle.
    x, y, _ = mesh.vertices.T
    dented = np.abs(np.arctan2(y, x)) < np.pi / 6
    mesh.vertices[dented, :2] *= 0.93
    mesh.vertices += 1e-4 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    assert np.hypot(*find_axis(mesh)[:2, 3]) < 1e-4


def test_a_lid_is_held_level_by_its_faces():
    radii = np.linspace(0, 0.04, 20)
    lid = [*((r, 0.0) for r in radii), *((r, 0.006) for r in radii[::-1])]
    assert axis_errors(lid, 64, 2e-4, 5).max() < 0.04


def test_a_frustum_without_principal_axes_is_found_by_its_normals():
    # The second moments of this surface are nearly the same in all directions.
    frustum = [(0, 0), (0.0416, 0), (0.0486, 0.0913), (0, 0.0913)]
    assert axis_errors(frustum, 48, 1e-4, 4).max() < 0.1
