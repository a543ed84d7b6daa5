"""The geometry of arms of the compiled closed forms, packed for compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np

from symgrasp.ik.pair_geometry import PairGeometry, pair_geometry
from symgrasp.poses import Array, rotation_about
from symgrasp.robot.robot import Arm

__all__ = [
    "AXES", "BASE", "BEND", "CENTRE", "CENTRE_SEEN", "COSINE_TOLERANCE", "ELBOW", "FOREARM", "HAND",
    "MEETING", "MIDDLE", "P0", "PARALLEL_PHI", "PARALLEL_SLACK", "PHI", "R0", "SHOULDER", "SLACK",
    "THREE_PARALLEL", "TRIPLE", "TURN", "WRIST", "WRIST_SEEN", "Chain", "ChainGeometry",
    "ParallelGeometry", "SphericalGeometry",
    "chain_geometries", "has_exact_pair", "is_rounded",
]  # fmt: skip

MEETING_DISTANCE = 1e-8
"""Axes whose distance is below this (m) meet in a point, up to the rounding of numbers."""

EXACTLY_PARALLEL = 1e-8
"""Unit axes whose cross product is shorter than this are parallel, up to the rounding of numbers."""

PARALLEL = 1e-6
"""Unit axes whose cross product is shorter than this do not meet in a point that can be computed."""

ROUNDED_DISTANCE, ROUNDED_PARALLEL = 5e-4, 1e-3
"""The same (m, and length of the cross product) for axes that are meant to meet or to be parallel in a URDF
that rounds its angles. One of 1.57 for a quarter turn is off by 8e-4 rad, which with the length of a link is
3e-4 m; offsets that arms are built with are greater, and a smaller one does no harm either: the closed form
of the axes where they are meant to be only says where Newton's method starts on the true ones."""

SLACK_RATIO = 30.0
"""Slack of the roots of a closed form (see `symgrasp.ik.joints.sine`) for each m or rad that axes are moved
by. A root's radicand is the ratio of lengths, of which the shortest are some centimetres."""

COSINE_TOLERANCE = 1e-9
"""A joint is known to be outside its limits from its cosine alone where that is off by more than this."""

AXES, R0, P0 = 0, 18, 27
"""Where the parts that all geometries have begin in a row of `Chain.geometry`."""

CENTRE, WRIST, CENTRE_SEEN, WRIST_SEEN, MIDDLE, TRIPLE, PHI, SLACK = 30, 33, 36, 39, 42, 47, 52, 53
"""Where the other parts of a `SphericalGeometry` begin."""

BASE, MEETING, SHOULDER, ELBOW, FOREARM, HAND, BEND, TURN = 30, 33, 36, 39, 42, 45, 48, 53
PARALLEL_PHI, PARALLEL_SLACK = 58, 59
"""Where the other parts of a `ParallelGeometry` begin."""

SPHERICAL, THREE_PARALLEL = 0, 1
"""The families of arms whose closed forms are compiled."""


class Chain(NamedTuple):
    """The geometry of an arm at K redundancy values, packed into arrays for compiled code.

    The arm has n joints, of which six are free, numbered 1 to 6 as in `symgrasp.ik.spherical`,
    `symgrasp.ik.parallel` or `symgrasp.ik.pair`.

    Attributes:
        geometry: (K, m) a geometry of one of the families in each row.
        joint: (11,) index of each free joint in the arm, of the locked one (or -1), whether the arm is
            read backwards, its family, whether it is rounded: then its geometry is not quite its own,
            and what the closed form finds has to be polished; and the index of a pitched arm's azimuth (or
            -1), outside of whose limits the grasp is that of another cell.
        limits: (6, n) lower limit, upper limit, middle of the range, cosine and sine of the middle, and
            the cosine of half the range, less `COSINE_TOLERANCE`.
        leeway: (6, n) the same limits for the closed form: of a rounded arm they are wider.
        forward: (2 n + 5, 3) for forward kinematics: H (n rows), P (n + 1), R0 (3) of the arm, and the
            tolerances (m, rad, unused).
        fixed: (n,) which joints are locked.
    """

    geometry: Array
    joint: np.ndarray
    limits: Array
    leeway: Array
    forward: Array
    fixed: np.ndarray


class SphericalGeometry(NamedTuple):
    """The geometry of six free joints with a spherical triple, at one value φ of the locked joint.

    Everything is in the base frame at zero.

    Attributes:
        backwards: whether the arm is read from the tool to the base.
        h: (6, 3) unit axes, reversed where the arm is read backwards.
        R0: (3, 3) orientation of the tool.
        p0: (3,) position of the tool.
        S: (3,) point where the axes of the triple meet.
        W: (3,) point where the axes of the pair meet.
        a: (3,) S relative to a point on the middle joint's axis.
        b: (3,) W relative to the same point.
        middle: (5,) constants of subproblem 3, see `_cosine_constants`.
        triple: (5,) constants of subproblem 4, see `_cosine_constants`.
        phi: the value φ (rad).
        slack: slack of the roots, which an arm has whose axes had to be moved; 0 for others.
    """

    backwards: bool
    h: Array
    R0: Array
    p0: Array
    S: Array
    W: Array
    a: Array
    b: Array
    middle: Array
    triple: Array
    phi: float
    slack: float

    @property
    def family(self) -> int:
        """`SPHERICAL`."""
        return SPHERICAL

    def packed(self) -> Array:
        """Return all parts but the first in one row (54,)."""
        return np.concatenate([np.ravel(part) for part in self[1:]])


class ParallelGeometry(NamedTuple):
    """The geometry of six free joints of which 2, 3 and 4 are parallel, at one value φ of the locked joint.

    Everything is in the base frame at zero. O2, O3 and O4 are points on the axes of joints 2, 3 and 4 in
    the plane of W perpendicular to them.

    Attributes:
        backwards: whether the arm is read from the tool to the base.
        h: (6, 3) unit axes, reversed where the arm is read backwards.
        R0: (3, 3) orientation of the tool.
        p0: (3,) position of the tool.
        base: (3,) a point on the axis of joint 1.
        W: (3,) point where the axes of joints 5 and 6 meet.
        shoulder: (3,) O2.
        elbow: (3,) O3.
        forearm: (3,) O4 − O3.
        hand: (3,) W − O4.
        bend: (5,) constants of subproblem 3 for joint 3, see `_cosine_constants`.
        turn: (5,) constants of subproblem 4 for joint 5, see `_cosine_constants`.
        phi: the value φ (rad).
        slack: slack of the roots, which an arm has whose axes had to be moved; 0 for others.
    """

    backwards: bool
    h: Array
    R0: Array
    p0: Array
    base: Array
    W: Array
    shoulder: Array
    elbow: Array
    forearm: Array
    hand: Array
    bend: Array
    turn: Array
    phi: float
    slack: float

    @property
    def family(self) -> int:
        """`THREE_PARALLEL`."""
        return THREE_PARALLEL

    def packed(self) -> Array:
        """Return all parts but the first in one row (60,)."""
        return np.concatenate([np.ravel(part) for part in self[1:]])


ChainGeometry: TypeAlias = SphericalGeometry | ParallelGeometry | PairGeometry


class _Joints(NamedTuple):
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


def chain_geometries(arm: Arm, locked: int | None, phi: Array) -> Sequence[ChainGeometry] | None:
    """Return the arm's geometry at every redundancy value, or None where it is of no compiled family.

    Exact closed forms go before rounded ones, and these before the search.

    Args:
        arm: the arm.
        locked: index of the locked joint; None for a 6-joint arm.
        phi: (K,) values of the locked joint (rad).

    Returns:
        K geometries of one family.
    """
    closed_forms = product((False, True), (_spherical, _three_parallel))
    for (rounded, find), backwards in product(
        [*closed_forms, (False, _meeting_pair), (True, _meeting_pair)], (False, True)
    ):
        rows = [find(_joints(arm, locked, float(value), backwards), rounded) for value in phi]
        known = [row for row in rows if row is not None]
        if find is _meeting_pair and known:
            # At single values the axes of a pair may be parallel: nothing is found there.
            nowhere = known[0]._replace(W=np.full(3, np.nan))
            return [row or nowhere._replace(phi=float(value)) for row, value in zip(rows, phi, strict=True)]
        if len(known) == len(rows):
            return known
    return None


def has_exact_pair(arm: Arm, locked: int | None, phi: float) -> bool:
    """Whether two axes at one end of an arm meet without being moved, with a joint locked at φ."""
    return any(_meeting_pair(_joints(arm, locked, phi, end), False) is not None for end in (False, True))


def is_rounded(geometries: Sequence[ChainGeometry]) -> bool:
    """Whether axes of an arm had to be moved for its closed form."""
    return any(not isinstance(row, PairGeometry) and row.slack > 0.0 for row in geometries)


def _joints(arm: Arm, locked: int | None, phi: float, backwards: bool) -> _Joints:
    """Return the free joints of an arm with a joint locked at φ."""
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
    return _Joints(backwards, h, o, R0, p0, phi)


def _spherical(joints: _Joints, rounded: bool) -> SphericalGeometry | None:
    """Return the geometry of joints with a spherical triple and a pair that meet, else None."""
    backwards, h, o, R0, p0, phi = joints
    triple, pair = _common_point(h[:3], o[:3], rounded), _common_point(h[4:], o[4:], rounded)
    if triple is None or pair is None:
        return None
    (S, off_S), (W, off_W) = triple, pair
    slack = SLACK_RATIO * max(off_S, off_W) if rounded else 0.0
    a, b = S - o[3], W - o[3]
    # h1ᵀ R2 h3 = h1ᵀ M h3
    middle, turns = _distance_constants(h[3], a, b), _cosine_constants(h[1], h[2], h[0])
    if middle[1] <= PARALLEL * MEETING_DISTANCE or turns[1] <= PARALLEL:
        return None
    return SphericalGeometry(backwards, h, R0, p0, S, W, a, b, middle, turns, phi, slack)


def _three_parallel(joints: _Joints, rounded: bool) -> ParallelGeometry | None:
    """Return the geometry of joints of which 2, 3, 4 are parallel and 5, 6 meet, else None."""
    backwards, h, o, R0, p0, phi = joints
    pair = _common_point(h[4:], o[4:], rounded)
    aslant = np.linalg.norm(np.cross(h[1], h), axis=1)
    parallel = ROUNDED_PARALLEL if rounded else EXACTLY_PARALLEL
    if pair is None or max(aslant[2:4]) > parallel or aslant[0] < max(parallel, PARALLEL):
        return None
    W, off_W = pair
    slack = 0.0
    if rounded:
        slack = SLACK_RATIO * max(off_W, *aslant[2:4])
        ways = np.sign(h[1:4] @ h[1])
        mean = ways @ h[1:4]
        h = h.copy()
        h[1:4] = np.outer(ways, mean / np.linalg.norm(mean))
    O2, O3, O4 = o[1:4] + np.outer((W - o[1:4]) @ h[1], h[1])
    bend, turn = _distance_constants(h[2], O4 - O3, O2 - O3), _cosine_constants(h[4], h[5], h[1])
    if bend[1] <= PARALLEL * MEETING_DISTANCE or turn[1] <= PARALLEL:
        return None
    return ParallelGeometry(backwards, h, R0, p0, o[0], W, O2, O3, O4 - O3, W - O4, bend, turn, phi, slack)


def _meeting_pair(joints: _Joints, rounded: bool) -> PairGeometry | None:
    """Return the geometry of joints of which 5 and 6 meet, else None."""
    backwards, h, o, R0, p0, phi = joints
    pair = _common_point(h[4:], o[4:], rounded)
    return None if pair is None else pair_geometry(backwards, h, o, R0, p0, pair[0], phi)


def _distance_constants(k: Array, a: Array, b: Array) -> Array:
    """Return the constants of subproblem 3, ``−½ |R(k, x) a − b|² = length·cos(x − middle) + constant``.

    See `_cosine_constants`, for ``|R a − b|² = |a|² + |b|² − 2 b·R a``.
    """
    return _cosine_constants(k, a, b) + np.array([0.0, 0.0, -0.5 * (a @ a + b @ b), 0.0, 0.0])


def _cosine_constants(k: Array, a: Array, b: Array) -> Array:
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


def _common_point(h: Array, o: Array, rounded: bool) -> tuple[Array, float] | None:
    """Return the point (3,) where lines meet, and how far off it they are at most (m).

    Args:
        h: (m, 3) unit directions of the lines.
        o: (m, 3) a point on each line.
        rounded: whether they only have to be meant to meet.

    Returns:
        None where they do not meet, or two successive ones are parallel.
    """
    parallel = ROUNDED_PARALLEL if rounded else PARALLEL
    if (np.linalg.norm(np.cross(h[:-1], h[1:]), axis=1) < parallel).any():
        return None
    across = np.eye(3) - h[:, :, None] * h[:, None, :]
    point = np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, o))
    off = float(np.linalg.norm(np.einsum("kij,kj->ki", across, point - o), axis=1).max())
    return (point, off) if off < (ROUNDED_DISTANCE if rounded else MEETING_DISTANCE) else None
