"""Meshes that are made of known profiles, to measure."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh

from symgrasp.object.measure.measurement import measure_mesh
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
