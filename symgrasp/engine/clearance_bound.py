"""An upper bound of the clearance that an arm can have at all, from links that hardly move to each other.

Two joints of a wrist keep the links before and behind them at nearly the same distance, whatever their
values. No candidate has a clearance above the largest of these distances, so a search that found one near it
need not go on.

The distance of two pieces is not larger than that of any parts of them. Such a part is the largest solid of
revolution about a joint's axis inside a piece: the joint does not move it. With it the first and the last of
the joints between two pieces drop out, so of up to three only one is left to be swept.
"""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from symgrasp.caching import kept
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import PackedPieces, Piece, pack, pose_rows
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.kinematics import MovingPieces, compose, rotate
from symgrasp.poses import Array, axis_frame, from_rotation, inverse
from symgrasp.progress import Progress

__all__ = ["clearance_bound", "core"]

STEP = 5e-4
"""Furthest (m) that any point of a piece moves between two values of the joint that is swept; the bound is
at most half of it above the largest distance."""

LEVELS = 33
"""Heights at which the radius of a solid of revolution is computed."""


class _Part(NamedTuple):
    """A convex part of the robot, with its pose (4, 4) in the frame of the joint that carries it."""

    piece: Piece
    pose: Array


def clearance_bound(
    moving: MovingPieces,
    pieces: PackedPieces,
    pose: Array,
    limits: Array,
    most: float,
    progress: Progress | None = None,
) -> float:
    """Return a distance (m) that the clearance of an arm's configurations never exceeds, at most ``most``.

    Args:
        moving: the pieces that the arm moves.
        pieces: all P pieces.
        pose: (P, 12) poses of all pieces; those of moving ones do not matter.
        limits: (2, n) lower and upper limits (rad) of the arm's joints, infinite where there are none.
        most: distance (m) above which nothing matters.
        progress: called with the finished share; may raise `Cancelled`.
    """
    pairs = _pairs(moving, pieces, pose)
    of_arm = (moving.joint_origin, moving.joint_axis, limits)
    content = hashlib.sha256(b"".join(map(np.ndarray.tobytes, of_arm)))
    for near, first, far, last in pairs:
        for part in (near, far):
            content.update(part.piece.vertices.tobytes() + part.pose.tobytes())
        content.update(repr((first, last, near.piece[1:], far.piece[1:])).encode())

    def compute() -> tuple[Array]:
        found = most
        for k, (near, first, far, last) in enumerate(pairs):
            if progress:
                progress(k / len(pairs))
            found = _furthest(moving, limits, near, first, far, last, found)
        return (np.array(found),)

    (found,) = kept(("clearance bound", most, content.hexdigest()), compute)
    return float(found)


def _pairs(moving: MovingPieces, pieces: PackedPieces, pose: Array) -> list[tuple[_Part, int, _Part, int]]:
    """Return the pairs of parts with one to three joints between them, each part with its joint."""
    found = []
    count, hands = len(moving.frame), moving.hand.shape[1]
    frame = [*moving.frame.tolist(), *[-1] * (len(pose) - count)]
    finger = np.ptp(moving.hand, axis=0).max(axis=1, initial=0.0) > 0.0
    for pair in np.concatenate([moving.base_pairs, moving.arm_pairs]).tolist():
        a, b = sorted(pair, key=frame.__getitem__)
        if 1 <= frame[b] - frame[a] <= 3 and not (b < hands and finger[b]):
            near = _part(pieces, a, moving.local[a] if a < count else pose[a])
            far = _part(pieces, b, moving.local[b])
            found.append((near, frame[a], far, frame[b]))
    return found


def _part(pieces: PackedPieces, k: int, row: Array) -> _Part:
    """Return piece k as a part, given its pose as a row (12,)."""
    first, end, _ = pieces.ranges[k]
    return _Part(Piece(pieces.vertices[first:end], float(pieces.size[k, 0])), _matrix(row))


def _furthest(
    moving: MovingPieces, limits: Array, near: _Part, first: int, far: _Part, last: int, most: float
) -> float:
    """Return an upper bound (m), at most ``most``, of how far two parts can be from each other.

    Joint ``first`` carries the one nearer to the base, joint ``last`` the other, one to three joints later.
    """
    if last - first == 1:
        return _sweep(moving, limits, near, far, last, most)
    # A core may be carried by either side of its joint.
    after, before = _axis_frame(moving.joint_axis[first + 1]), _axis_frame(moving.joint_axis[last])
    near_core = _core_part(near, _matrix(moving.joint_origin[first + 1]) @ after, after)
    far_core = _core_part(far, before, _matrix(moving.joint_origin[last]) @ before)
    if last - first == 3:
        if near_core and far_core:
            most = _sweep(moving, limits, near_core, far_core, last - 1, most)
        return most
    if far_core:
        most = _sweep(moving, limits, near, far_core, last - 1, most)
    if near_core:
        most = _sweep(moving, limits, near_core, far, last, most)
    return most


def _core_part(part: _Part, axis: Array, pose: Array) -> _Part | None:
    """Return the core of a part about the z axis of a frame (4, 4), to be carried at another pose."""
    inside = core(part.piece.vertices, part.piece.rounding, inverse(axis) @ part.pose)
    return None if inside is None else _Part(inside, pose)


def core(vertices: Array, rounding: float = 0.0, pose: Array | None = None) -> Piece | None:
    """Return a solid of revolution about z inside a piece, or None if the axis misses the piece.

    Args:
        vertices: (n, 3) vertices of the piece.
        rounding: radius (m) of the ball that the piece is enlarged by.
        pose: (4, 4) of the piece, in the frame of the z axis.
    """
    planes = _planes(np.ascontiguousarray(vertices).tobytes())
    if planes is None:
        return None
    if pose is not None:
        vertices = vertices @ pose[:3, :3].T + pose[:3, 3]
        normals = planes[:, :3] @ pose[:3, :3].T
        planes = np.column_stack([normals, planes[:, 3] - normals @ pose[:3, 3]])
    across, along, offset = np.hypot(planes[:, 0], planes[:, 1]), planes[:, 2], planes[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        heights = -offset / along
    low = heights[along < -1e-9].max(initial=vertices[:, 2].min())
    high = heights[along > 1e-9].min(initial=vertices[:, 2].max())
    steep = across > 1e-9
    upright = steep & (abs(along) <= 1e-9)
    if low >= high or offset[upright].max(initial=-1.0) > 0.0:
        return None
    h = np.linspace(low, high, LEVELS)
    # The radius is concave in h, so the chords between the levels lie inside.
    radius = ((-offset[steep] - np.outer(h, along[steep])) / across[steep]).min(axis=1).clip(min=0.0)
    return Piece(np.column_stack([radius, np.zeros(LEVELS), h]), rounding, revolved=True)


@lru_cache(maxsize=1024)
def _planes(vertices: bytes) -> Array | None:
    """Return the planes (., 4) of the convex hull of vertices, None where they lie in a plane.

    Links look the same in every engine, and around all of their axes.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(np.frombuffer(vertices).reshape(-1, 3)).equations
    except QhullError:
        return None


def _sweep(moving: MovingPieces, limits: Array, near: _Part, far: _Part, joint: int, most: float) -> float:
    """Return an upper bound (m) of the distance of parts carried by both sides of a joint, over its range."""
    lower, upper = limits[:, joint]
    if upper - lower > 2 * np.pi:
        lower, upper = -np.pi, np.pi
    T = inverse(_axis_frame(moving.joint_axis[joint])) @ far.pose
    lever = np.hypot(*(_corners(far.piece) @ T[:3, :3].T + T[:3, 3])[:, :2].T).max() + far.piece.rounding
    count = 1 + math.ceil((upper - lower) * lever / STEP)
    pieces = pack([near.piece, far.piece])
    angles = lower + (np.arange(count) + 0.5) * (upper - lower) / count
    furthest = _furthest_at(
        pieces,
        pose_rows(np.array([near.pose, far.pose, np.eye(4)])),
        moving.joint_origin[joint],
        moving.joint_axis[joint],
        pose_rows(far.pose),
        angles,
        most,
        np.empty((4, 3)),
    )
    return min(most, furthest + 0.5 * STEP)


def _corners(piece: Piece) -> Array:
    """Return points (., 3) of which a piece, but for its rounding, lies in the convex hull."""
    if not piece.revolved:
        return piece.vertices
    radius, h = piece.vertices[:, 0].max(), piece.vertices[:, 2]
    return np.array(list(product((-radius, radius), (-radius, radius), (h.min(), h.max()))))


def _matrix(row: Array) -> Array:
    """Return the pose (4, 4) of a row (12,)."""
    return from_rotation(row[:9].reshape(3, 3), row[9:])


def _axis_frame(axis: Array) -> Array:
    """Return a frame (4, 4) at the origin with an axis (3,) as its z axis."""
    T = np.eye(4)
    T[:3, 2] = axis
    return axis_frame(T)


@njit(**ENTRY)
def _furthest_at(pieces, pose, origin, axis, local, angles, most, work):
    """Return the largest distance (m) at some angles of a joint, or the first one above ``most``."""
    furthest = -math.inf
    frame = pose[2]  # no piece has this pose
    for angle in angles:
        for i in range(12):
            frame[i] = origin[i]
        rotate(frame, axis, angle)
        compose(frame, local, pose[1])
        _, upper = distance_bounds(pieces, pose, 0, 1, most, math.inf, -math.inf, work)
        furthest = max(furthest, upper)
        if furthest > most:
            break
    return furthest
