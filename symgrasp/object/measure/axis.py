"""Finding the axis of revolution of a mesh.

Every normal of a surface of revolution meets its axis. In Plücker coordinates that is linear in
the axis, so an eigenvector problem gives it without a first guess (Pottmann and Randrup,
"Rotational and helical surface approximation", 1998). Normals of a noisy mesh are rough, so the
result is then refined on positions: the first harmonic of the deviation from the mean profile
tells how far the axis is off.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from symgrasp.object.measure.meridian import column_angles, cut, envelope, in_frame
from symgrasp.poses import Array, from_rotation, rotation_about, translation

__all__ = ["find_axis", "frame_along"]

COLUMNS, FINE_COLUMNS = 48, 240
"""Number of half-planes that a candidate axis is scored at, and that the best one is refined at."""

ROWS, RINGS = 128, 32
"""Number of heights at which the side wall is sampled, and of radii at which the two ends are."""

MOST_NORMALS = 50_000
"""Largest number of triangles whose normals are asked where they meet; of a finer mesh, as many at random."""

MOST_STEPS = 20
"""Largest number of steps of the refinement; it usually converges in five."""

CONVERGED_STEP = 1e-6
"""The refinement ends with a step that moves no part of the object further than this share of its size."""

DIVERGED = 1.1
"""A refinement that raises the score (lower is better) by this factor has diverged and is dropped."""

MOST_REFINED, HOPELESS_RATIO = 3, 4.0
"""Largest number of candidates that are refined, and the largest ratio of their scores to the best one."""

SAME_DIRECTION = np.cos(np.deg2rad(2.0))
"""Candidates the cosine of whose angle is at least this have the same direction; one of them is refined."""

EQUALLY_GOOD = 1.02
"""Candidates whose scores are within this factor are equally good: any line through its centre is an axis
of a ball."""


class _SurfaceSamples(NamedTuple):
    """Points of the outer surface in a candidate's axis frame, and their deviations from the mean over θ.

    Attributes:
        rho: (n,) distances from the axis (m).
        h: (n,) heights along the axis (m).
        theta: (n,) angles about the axis (rad).
        normal: (n, 2) outward normals of the mean surface as (ρ, h).
        deviation: (n,) signed distances outwards from the mean surface (m).
        weight: (n,) areas that the points stand for, on any common scale.
    """

    rho: Array
    h: Array
    theta: Array
    normal: Array
    deviation: Array
    weight: Array


def find_axis(mesh: trimesh.Trimesh) -> Array:
    """Return a pose ``T_mesh_object`` (4, 4) whose z axis is the axis of revolution.

    Its origin lies on the axis at half height; which end is up is left open. A mesh that is no
    surface of revolution gets the axis that fits most of its surface.
    """
    # Coordinate by coordinate and corner by corner, since that is how they are read.
    vertices, faces = np.asfortranarray(mesh.vertices), np.asfortranarray(mesh.faces)
    centre = mesh.bounds.mean(axis=0)
    size = float(np.linalg.norm(mesh.extents))
    # Candidates are scored around the origin, because coordinates far from it are less precise.
    local = vertices - centre
    candidates = _candidates(mesh, centre)
    scored = [(_score(_sample(local, faces, pose, COLUMNS)), k, pose) for k, pose in enumerate(candidates)]
    refined = [(*_refine(local, faces, pose, size, COLUMNS), k) for k, pose in _best_directions(scored)]
    limit = EQUALLY_GOOD * min(score for score, _, _ in refined)
    # Equally good ones keep the order of the candidates, which begins with the file's own axes.
    _, best = min((k, n) for n, (score, _, k) in enumerate(refined) if score <= limit)
    _, pose = _refine(local, faces, refined[best][1], size, FINE_COLUMNS)
    return translation(centre) @ pose


def _best_directions(scored: list[tuple[float, int, Array]]) -> list[tuple[int, Array]]:
    """Choose the candidates to refine: those with the best scores, each direction once.

    Args:
        scored: (score, index, axis frame (4, 4)) of every candidate.

    Returns:
        Index and axis frame of each chosen candidate, best first.
    """
    ordered = sorted(scored, key=lambda entry: entry[:2])
    chosen: list[tuple[int, Array]] = []
    for score, k, pose in ordered:
        new = all(abs(pose[:3, 2] @ other[:3, 2]) < SAME_DIRECTION for _, other in chosen)
        if new and len(chosen) < MOST_REFINED and score <= HOPELESS_RATIO * ordered[0][0] + 1e-9:
            chosen.append((k, pose))
    return chosen


def frame_along(axis: Array, origin: Array) -> Array:
    """Return the pose (4, 4) with this z axis (3,) and origin (3,), its x axis as near to x as possible."""
    z = axis / np.linalg.norm(axis)
    across = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = across - (across @ z) * z
    x /= np.linalg.norm(x)
    return from_rotation(np.column_stack([x, np.cross(z, x), z]), origin)


def _candidates(mesh: trimesh.Trimesh, centre: Array) -> list[Array]:
    """Return candidate axis frames (4, 4) relative to ``centre``: of the file, of inertia, and of normals."""
    points, normals = mesh.triangles_center - centre, np.asarray(mesh.face_normals)
    areas = mesh.area_faces
    middle = np.average(points, axis=0, weights=areas)
    _, principal = np.linalg.eigh(np.cov((points - middle).T, aweights=areas))
    file_axes = [(axis, middle) for axis in np.eye(3)[::-1]]
    inertia = [(axis, middle) for axis in principal.T]
    return [
        frame_along(axis, p)
        for axis, p in file_axes + inertia + _lines_met_by_normals(points, normals, areas)
    ]


def _lines_met_by_normals(points: Array, normals: Array, areas: Array) -> list[tuple[Array, Array]]:
    """Return (direction (3,), point (3,)) of the three lines that the normals come closest to meeting.

    The line through q along a has the moment m = q × a; it meets the normal n through p when
    ``n·m + (p × n)·a = 0``. Least squares over m leave an eigenvector problem for a. It is
    solved again with the normals that do not fit weighted down, so a handle does not pull.
    """
    if len(areas) > MOST_NORMALS:
        some = np.random.default_rng(0).choice(len(areas), MOST_NORMALS, replace=False)
        points, normals, areas = points[some], normals[some], areas[some]
    middle = np.average(points, axis=0, weights=areas)
    scale = float(np.abs(points - middle).max())
    moments = np.cross((points - middle) / scale, normals)
    weights, lines = areas, []
    for _ in range(10):
        A = (normals * weights[:, None]).T @ normals
        B = (normals * weights[:, None]).T @ moments
        D = (moments * weights[:, None]).T @ moments
        to_moment = -np.linalg.pinv(A, rcond=1e-6, hermitian=True) @ B
        _, vectors = np.linalg.eigh(D + B.T @ to_moment)
        lines = [(a, middle + scale * np.cross(a, to_moment @ a)) for a in vectors.T]
        residual = normals @ (to_moment @ vectors[:, 0]) + moments @ vectors[:, 0]
        spread = np.median(np.abs(residual)) + 1e-9
        weights = areas / (1.0 + (residual / (2.0 * spread)) ** 2)
    return lines


def _refine(
    vertices: Array, faces: np.ndarray, pose: Array, size: float, columns: int
) -> tuple[float, Array]:
    """Move an axis frame until the deviations have no first harmonic over θ.

    Returns:
        Score and pose (4, 4) of the refined frame, or of the given one where the refinement diverged.
    """
    samples = _sample(vertices, faces, pose, columns)
    start = (_score(samples), pose)
    for _ in range(MOST_STEPS):
        turn, shift = _correction(samples)
        angle = float(np.linalg.norm(turn))
        pose = pose @ from_rotation(rotation_about(turn / (angle or 1.0), angle), shift)
        samples = _sample(vertices, faces, pose, columns)
        if angle * size + np.linalg.norm(shift) < CONVERGED_STEP * size:
            break
    score = _score(samples)
    return (score, pose) if score < DIVERGED * start[0] else start


def _correction(samples: _SurfaceSamples) -> tuple[Array, Array]:
    """Return the rotation vector (3,) (rad) and shift (3,) (m) of the frame that explain the deviations.

    A rigid motion moves the surface along its normal by ``n · (t + ω × p)``; this is fitted by
    weighted least squares with Tukey's weights, which leave handles and inner walls out.
    """
    rho, h, theta = samples.rho, samples.h, samples.theta
    radial, axial = samples.normal.T
    length = max(float(rho.max()), float(np.ptp(h)))
    lever = (axial * rho - radial * h) / length
    columns = np.column_stack(
        [radial * np.cos(theta), radial * np.sin(theta), lever * np.sin(theta), -lever * np.cos(theta)]
    )
    spread = 1.4826 * np.median(np.abs(samples.deviation)) + 1e-7
    inside = np.clip(1.0 - (samples.deviation / (4.685 * spread)) ** 2, 0.0, None)
    root = np.sqrt(samples.weight) * inside
    # Small singular values belong to turns that hardly change the surface, as those of a ball: ignore them.
    solution, *_ = np.linalg.lstsq(columns * root[:, None], samples.deviation * root, rcond=1e-3)
    return np.array([*solution[2:] / length, 0.0]), np.array([*solution[:2], 0.0])


def _score(samples: _SurfaceSamples) -> float:
    """Return the weighted mean deviation (m) with exponent ½, so that few large deviations count little."""
    return float(np.average(np.sqrt(np.abs(samples.deviation)), weights=samples.weight) ** 2)


def _sample(vertices: Array, faces: np.ndarray, pose: Array, columns: int) -> _SurfaceSamples:
    """Sample the side wall and both ends of a mesh in a candidate's axis frame ``pose`` (4, 4)."""
    local = in_frame(vertices, pose)
    theta, cuts = column_angles(columns), cut(local, faces, columns)
    bottom, top = local[:, 2].min(), local[:, 2].max()
    heights = bottom + (np.arange(ROWS) + 0.5) * ((top - bottom) / ROWS)
    radii = (np.arange(RINGS) + 0.5) * (np.hypot(local[:, 0], local[:, 1]).max() / RINGS)
    wall, _ = envelope(cuts.column, cuts.h, cuts.r, heights, columns)
    # An angle without a surface counts as radius zero, or a wrong axis would look symmetric.
    parts = [_deviation_from_mean(heights, np.maximum(wall, 0.0), theta, "wall")]
    for sign in (-1.0, 1.0):
        end, _ = envelope(cuts.column, cuts.r, sign * cuts.h, radii, columns)
        whole = np.isfinite(end).all(axis=1)
        if whole.sum() >= 2:
            parts.append(_deviation_from_mean(radii[whole], end[whole], theta, "end", sign))
    return _SurfaceSamples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _deviation_from_mean(x: Array, y: Array, theta: Array, kind: str, sign: float = 1.0) -> _SurfaceSamples:
    """Return the deviations of an envelope y (rows, columns) over x (rows,) from its median over the angle.

    For the wall, y is the radius and x the height. For an end, x is the radius and y the height times
    ``sign``, which makes it grow outwards.
    """
    mean = np.median(y, axis=1)
    slope = np.gradient(mean, x)
    across = 1.0 / np.sqrt(1.0 + slope**2)
    along = -slope * across
    spread = np.broadcast_to(x[:, None], y.shape)
    if kind == "wall":
        rho, h, normal, step = y, spread, (across, along), x[1] - x[0]
        # Equal around the axis, but more for what is further out than the mean: a stick that reaches out at a
        # few angles, as around an axis across it, is not outweighed by those at which there is nothing.
        around = y.mean(axis=1, keepdims=True)
        weight = np.maximum(around, np.sqrt(around * y)) * step
    else:
        rho, h, normal, step = spread, sign * y, (along, sign * across), x[1] - x[0]
        weight = spread * step
    return _SurfaceSamples(
        rho.ravel(),
        h.ravel(),
        np.broadcast_to(theta, y.shape).ravel(),
        np.column_stack([np.repeat(n, y.shape[1]) for n in normal]),
        ((y - mean[:, None]) * across[:, None]).ravel(),
        weight.ravel(),
    )
