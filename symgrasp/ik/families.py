"""Which closed form an arm has: its joint axes decide, up to the rounding of its URDF."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from symgrasp.ik.chain import ChainGeometry, ParallelGeometry, SphericalGeometry
from symgrasp.ik.pair.from_axes import pair_geometry
from symgrasp.ik.pair.geometry import SHIFTED, PairGeometry
from symgrasp.poses import Array, rotation_about
from symgrasp.robot.robot import Arm

__all__ = [
    "BESIDE", "COARSE", "EXACT", "Joints", "Precision", "chain_geometries", "cosine_constants", "free_joints",
    "further_geometries", "has_exact_pair", "parallel_below",
]  # fmt: skip


class Precision(NamedTuple):
    """How far off axes may be that are taken to meet, or to be parallel.

    Attributes:
        distance: of axes that meet in a point (m).
        sine: length of the cross product of unit axes that are parallel.
    """

    distance: float
    sine: float


EXACT = Precision(1e-8, 1e-8)
"""Up to the rounding of numbers."""

ROUNDED = Precision(2e-5, 1e-4)
"""As rounding to four decimals leaves them: an angle is off by up to 5e-5 rad, which with the length of a
link is 2e-5 m. What is more may be an offset that the arm was built with, and the closed form of axes without
it would lose solutions beside singular poses."""

COARSE = Precision(5e-4, 1e-3)
"""As an angle of 1.57 leaves them, which is off by 8e-4 rad; for arms of which nothing else is known. The
closed form of axes where they are meant to be only says where Newton's method starts on the true ones."""

PARALLEL = 1e-6
"""Unit axes whose cross product is shorter than this do not meet in a point that can be computed."""

BESIDE = 1e-3
"""How far (rad) from a value of the locked joint at which axes are parallel they are taken to meet."""

LEAST_OFFSET = 1e-3
"""Axes of joints 5 and 6 that come closer than this (m) are taken to meet, up to rounding, or not solved."""

LEAST_SKEW = 1e-7
"""Least determinant (m) of the equations of joint 5 where its axis and that of joint 6 do not meet:
near parallel axes have a smaller one. The rounding of the equations is divided by it."""

SLACK_RATIO = 100.0
"""Slack of the roots of a closed form (see `symgrasp.ik.joints.sine`) for each m or rad that axes are moved
by. A root's radicand is the ratio of lengths, of which the shortest are a centimetre."""


class Joints(NamedTuple):
    """Six free joints in the order of a closed form, at one value of the locked joint.

    Attributes:
        backwards: whether they are read from the tool to the base.
        h: (6, 3) unit axes.
        o: (6, 3) a point on each axis.
        R0: (3, 3) orientation of the tool.
        p0: (3,) position of the tool.
        phi: value of the locked joint (rad).
    """

    backwards: bool
    h: Array
    o: Array
    R0: Array
    p0: Array
    phi: float


def chain_geometries(
    arm: Arm, locked: int | None, phi: Array
) -> tuple[Precision, Sequence[ChainGeometry]] | None:
    """Return the arm's geometry at every redundancy value, or None where it is of no compiled family.

    Exact closed forms go before rounded ones, these before the search, and coarse ones come last.

    Args:
        arm: the arm.
        locked: index of the locked joint; None for a 6-joint arm.
        phi: (K,) values of the locked joint (rad).

    Returns:
        Up to what its axes meet or are parallel, and K geometries of one family.
    """
    found = _geometries(_screws(arm), locked, phi.tobytes())
    return found and (found.precision, found.rows)


def further_geometries(
    arm: Arm, locked: int | None, known: Array, phi: Array
) -> Sequence[ChainGeometry] | None:
    """Return an arm's geometry at more values of its redundancy, of the family that it has at known ones.

    Args:
        arm: the arm.
        locked: index of the locked joint; None for a 6-joint arm.
        known: (K,) values of the locked joint (rad) at which `chain_geometries` is known.
        phi: (M,) the other values (rad).

    Returns:
        M geometries, or None where that family has none at one of the values.
    """
    found = _geometries(_screws(arm), locked, known.tobytes())
    assert found is not None  # or nothing would be known
    rows = [
        found.find(free_joints(arm, locked, float(x), found.rows[0].backwards), found.precision) for x in phi
    ]
    if isinstance(found.rows[0], SphericalGeometry) and None in rows:
        return None
    return _filled(arm, locked, rows, phi, found.rows[0], found.precision)


class _Screws(NamedTuple):
    """The part of an arm's kinematics that decides; see `Arm`."""

    H: Array
    P: Array
    R0: Array


class _Found(NamedTuple):
    """The family of an arm, and its geometry at some values of the redundancy.

    Attributes:
        precision: up to what its axes meet or are parallel.
        find: returns the geometry at one value.
        rows: the geometries.
    """

    precision: Precision
    find: _Find
    rows: Sequence[ChainGeometry]


def _screws(arm: Arm) -> tuple[bytes, bytes, bytes]:
    # For a pitched arm it is asked row by row, though the limits are all that differs.
    return arm.H.tobytes(), arm.P.tobytes(), arm.R0.tobytes()


@lru_cache(maxsize=256)
def _geometries(screws: tuple[bytes, bytes, bytes], locked: int | None, values: bytes) -> _Found | None:
    """Do what `chain_geometries` does, for the bytes of H, P, R0 and phi."""
    phi = np.frombuffer(values)
    arm = _Screws(*(np.frombuffer(part).reshape(-1, 3) for part in screws))
    joints = cache(lambda backwards: [free_joints(arm, locked, float(x), backwards) for x in phi])
    for precision, find in _FAMILIES:
        # At single values the axes of a pair may be parallel, or so nearly that nothing can be computed.
        most = {_meeting_pair: len(phi) - 1, _three_parallel_skew: (len(phi) - 1) // 2}.get(find, 0)
        for backwards in (False, True):
            rows = _rows(find, joints(backwards), precision, most)
            if rows is None:
                continue
            one = next(row for row in rows if row is not None)
            return _Found(precision, find, _filled(arm, locked, rows, phi, one, precision))
    return None


def _filled(
    arm: Arm | _Screws,
    locked: int | None,
    rows: Sequence[ChainGeometry | None],
    phi: Array,
    one: ChainGeometry,
    precision: Precision,
) -> list[ChainGeometry]:
    """Return geometries (K,) at values of the redundancy (rad), with others of one's family for None."""
    if isinstance(one, SphericalGeometry):  # of which none is missing
        return [row for row in rows if row is not None]
    return [
        row or _beside(arm, locked, float(value), one, precision) or one.nowhere(float(value))
        for row, value in zip(rows, phi, strict=True)
    ]


def _rows(
    find: _Find, joints: Sequence[Joints], precision: Precision, most: int
) -> list[ChainGeometry | None] | None:
    """Return the geometries of a family, None where there is none; or None after more than ``most`` Nones."""
    rows: list[ChainGeometry | None] = []
    lost = 0
    for own in joints:
        rows.append(find(own, precision))
        lost += rows[-1] is None
        if lost > most:
            return None
    return rows


def has_exact_pair(arm: Arm, locked: int | None, phi: float) -> bool:
    """Whether two axes at one end of an arm meet without being moved, with a joint locked at φ."""
    return any(_meeting_pair(free_joints(arm, locked, phi, end), EXACT) is not None for end in (False, True))


def free_joints(arm: Arm | _Screws, locked: int | None, phi: float, backwards: bool) -> Joints:
    """Return the free joints of an arm with a joint locked at φ (rad), read from the tool if backwards."""
    h, o = arm.H.copy(), np.cumsum(arm.P, axis=0)
    R0, p0, o = arm.R0, o[-1], o[:-1].copy()
    if locked is not None:
        # The locked joint rotates all joints after it by a constant.
        turn, centre = rotation_about(h[locked], phi), o[locked].copy()
        h[locked + 1 :] = h[locked + 1 :] @ turn.T
        o[locked + 1 :] = (o[locked + 1 :] - centre) @ turn.T + centre
        R0, p0 = turn @ R0, turn @ (p0 - centre) + centre
        h, o = np.delete(h, locked, axis=0), np.delete(o, locked, axis=0)
    if backwards:
        h, o = -h[::-1], o[::-1]
    return Joints(backwards, h, o, R0, p0, phi)


def _spherical(joints: Joints, precision: Precision) -> SphericalGeometry | None:
    """Return the geometry of joints with a spherical triple and a pair that meet, else None."""
    backwards, h, o, R0, p0, phi = joints
    triple, pair = _common_point(h[:3], o[:3], precision), _common_point(h[4:], o[4:], precision)
    if triple is None or pair is None:
        return None
    (S, off_S), (W, off_W) = triple, pair
    slack = SLACK_RATIO * max(off_S, off_W) if precision is not EXACT else 0.0
    a, b = S - o[3], W - o[3]
    # h1ᵀ R2 h3 = h1ᵀ M h3
    middle, turns = _distance_constants(h[3], a, b), cosine_constants(h[1], h[2], h[0])
    if middle[1] <= PARALLEL * EXACT.distance or turns[1] <= PARALLEL:
        return None
    return SphericalGeometry(backwards, h, R0, p0, S, W, a, b, middle, turns, phi, slack)


def _three_parallel(joints: Joints, precision: Precision) -> ParallelGeometry | None:
    """Return the geometry of joints of which 2, 3, 4 are parallel and 5, 6 meet, else None."""
    pair = _common_point(joints.h[4:], joints.o[4:], precision)
    return None if pair is None else _parallel_geometry(joints, precision, pair[0], pair[0], pair[1])


def _three_parallel_skew(joints: Joints, precision: Precision) -> ParallelGeometry | None:
    """Return the geometry of joints of which 2, 3, 4 are parallel and 5, 6 do not meet, else None."""
    h, o = joints.h, joints.o
    normal = np.cross(h[4], h[5])
    if np.linalg.norm(normal) < PARALLEL:
        return None
    x, y, _ = np.linalg.solve(np.array([h[4], -h[5], normal]).T, o[5] - o[4])
    return _parallel_geometry(joints, precision, o[4] + x * h[4], o[5] + y * h[5], 0.0)


def _parallel_geometry(
    joints: Joints, precision: Precision, O5: Array, W: Array, off: float
) -> ParallelGeometry | None:
    """Return the geometry of joints of which 2, 3, 4 are parallel, else None.

    Args:
        joints: the joints.
        precision: up to what they are.
        O5: point (3,) on the axis of joint 5 that is nearest to that of joint 6.
        W: the point on that axis; the same where they are taken to meet.
        off: how far off they are then (m).
    """
    backwards, h, o, R0, p0, phi = joints
    aslant = np.linalg.norm(np.cross(h[1], h), axis=1)
    if max(aslant[2:4]) > precision.sine or aslant[0] < max(precision.sine, PARALLEL):
        return None
    slack = 0.0
    if precision is not EXACT:
        slack = SLACK_RATIO * max(off, *aslant[2:4])
        ways = np.sign(h[1:4] @ h[1])
        mean = ways @ h[1:4]
        h = h.copy()
        h[1:4] = np.outer(ways, mean / np.linalg.norm(mean))
    O2, O3, O4 = o[1:4] + np.outer((W - o[1:4]) @ h[1], h[1])
    bend, turn = _distance_constants(h[2], O4 - O3, O2 - O3), cosine_constants(h[4], h[5], h[1])
    if bend[1] <= PARALLEL * EXACT.distance or turn[1] <= PARALLEL:
        return None
    skew = np.zeros(7)
    if O5 is not W:
        along, matrix = np.zeros(2), np.zeros((2, 2))
        for i, v in enumerate((W - O5, h[5])):
            along[i] = (h[4] @ v) * (h[1] @ h[4])
            matrix[i] = h[1] @ v - along[i], h[1] @ np.cross(h[4], v)
        if np.linalg.norm(W - O5) < LEAST_OFFSET or abs(np.linalg.det(matrix)) < LEAST_SKEW:
            return None
        skew = np.concatenate([[1.0], along, np.linalg.inv(matrix).ravel()])
    return ParallelGeometry(
        backwards, h, R0, p0, o[0], W, O2, O3, O4 - O3, O5 - O4, bend, turn, W - O5, skew, phi, slack
    )


def _meeting_pair(joints: Joints, precision: Precision) -> PairGeometry | None:
    """Return the geometry of joints of which 5 and 6 meet, else None."""
    backwards, h, o, R0, p0, phi = joints
    pair = _common_point(h[4:], o[4:], precision)
    return None if pair is None else pair_geometry(backwards, h, o, R0, p0, pair[0], phi)


def _beside(
    arm: Arm | _Screws, locked: int | None, phi: float, known: ChainGeometry, precision: Precision
) -> PairGeometry | None:
    """Return the geometry of a pair that is parallel at φ, as it is at a value beside it.

    A search begins with it, and ends with the arm's own kinematics. None of another family.
    """
    if not isinstance(known, PairGeometry):
        return None
    beside = _meeting_pair(free_joints(arm, locked, phi + BESIDE, known.backwards), precision)
    return None if beside is None else beside.at(phi, {SHIFTED: 1.0})


_Find: TypeAlias = Callable[[Joints, Precision], ChainGeometry | None]

_FAMILIES: tuple[tuple[Precision, _Find], ...] = (
    (EXACT, _spherical),
    (EXACT, _three_parallel),
    (EXACT, _three_parallel_skew),
    (ROUNDED, _spherical),
    (ROUNDED, _three_parallel),
    (ROUNDED, _three_parallel_skew),
    (EXACT, _meeting_pair),
    (COARSE, _spherical),
    (COARSE, _three_parallel),
    (COARSE, _three_parallel_skew),
    (COARSE, _meeting_pair),
)
"""What is tried, best first."""


def _distance_constants(k: Array, a: Array, b: Array) -> Array:
    """Return the constants of subproblem 3, ``−½ |R(k, x) a − b|² = length·cos(x − middle) + constant``.

    See `cosine_constants`, for ``|R a − b|² = |a|² + |b|² − 2 b·R a``.
    """
    return cosine_constants(k, a, b) + np.array([0.0, 0.0, -0.5 * (a @ a + b @ b), 0.0, 0.0])


def cosine_constants(k: Array, a: Array, b: Array) -> Array:
    """Return the constants of ``b·R(k, x) a = length·cos(x − middle) + constant``.

    Args:
        k: unit axis (3,) of the rotation by x.
        a: vector (3,).
        b: vector (3,).

    Returns:
        (5,) middle, length, constant, sin(middle), cos(middle).
    """
    part = float((k @ a) * (k @ b))
    sine, cosine = float(b @ np.cross(k, a)), float(a @ b) - part
    middle = np.arctan2(sine, cosine)
    return np.array([middle, np.hypot(sine, cosine), part, np.sin(middle), np.cos(middle)])


def parallel_below(precision: Precision) -> float:
    """Return the length of the cross product of unit axes below which they are parallel, and do not meet."""
    return PARALLEL if precision is EXACT else COARSE.sine


def _common_point(h: Array, o: Array, precision: Precision) -> tuple[Array, float] | None:
    """Return the point (3,) where lines meet, and how far off it they are at most (m).

    Args:
        h: (m, 3) unit directions of the lines.
        o: (m, 3) a point on each line.
        precision: up to what they have to meet.

    Returns:
        None where they do not meet, or two successive ones are parallel.
    """
    if (np.linalg.norm(np.cross(h[:-1], h[1:]), axis=1) < parallel_below(precision)).any():
        return None
    across = np.eye(3) - h[:, :, None] * h[:, None, :]
    point = np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, o))
    off = float(np.linalg.norm(np.einsum("kij,kj->ki", across, point - o), axis=1).max())
    return (point, off) if off < precision.distance else None
