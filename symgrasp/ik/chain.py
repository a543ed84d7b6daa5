"""The geometry of arms with a spherical triple of joints, as the closed form of `spherical` needs it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array, rotation_about
from symgrasp.robot.robot import Arm

__all__ = [
    "AXES", "CENTRE", "CENTRE_SEEN", "COSINE_TOLERANCE", "MIDDLE", "P0", "PHI", "R0", "TRIPLE", "WRIST",
    "WRIST_SEEN", "Chain", "ChainGeometry", "chain_geometries",
]  # fmt: skip

MEETING_DISTANCE = 1e-8
"""Axes whose distance is below this (m) count as meeting in a point; URDF files round their angles."""

PARALLEL = 1e-6
"""Unit axes whose cross product is shorter than this count as parallel."""

COSINE_TOLERANCE = 1e-9
"""A joint is known to be outside its limits from its cosine alone where that is off by more than this."""

AXES, R0, P0, CENTRE, WRIST = 0, 18, 27, 30, 33
CENTRE_SEEN, WRIST_SEEN, MIDDLE, TRIPLE, PHI = 36, 39, 42, 47, 52
"""Where the parts of a `ChainGeometry` begin in a row of `Chain.geometry`."""


class Chain(NamedTuple):
    """The geometry of an arm at K redundancy values, packed into arrays for compiled code.

    The arm has n joints, of which six are free, numbered 1 to 6 as in `symgrasp.ik.spherical`.

    Attributes:
        geometry: (K, 53) a `ChainGeometry` in each row.
        joint: (8,) index of each free joint in the arm, of the locked one (or -1), and whether
            the arm is read backwards.
        limits: (6, n) lower limit, upper limit, middle of the range, cosine and sine of the middle, and
            the cosine of half the range, less `COSINE_TOLERANCE`.
        forward: (2 n + 5, 3) for forward kinematics: H (n rows), P (n + 1), R0 (3) of the arm, and the
            tolerances (m, rad, unused).
    """

    geometry: Array
    joint: np.ndarray
    limits: Array
    forward: Array


class ChainGeometry(NamedTuple):
    """The geometry of the six free joints at one value φ of the locked joint, in the base frame.

    Attributes:
        backwards: whether the arm is read from the tool to the base.
        h: (6, 3) unit axes at zero, reversed where the arm is read backwards.
        R0: (3, 3) orientation of the tool at zero.
        p0: (3,) position of the tool at zero.
        S: (3,) point where the axes of the triple meet.
        W: (3,) point where the axes of the pair meet.
        a: (3,) S relative to a point on the middle joint's axis.
        b: (3,) W relative to the same point.
        middle: (5,) constants of subproblem 3, see `_cosine_constants`.
        triple: (5,) constants of subproblem 4, see `_cosine_constants`.
        phi: the value φ (rad).
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


def chain_geometries(arm: Arm, locked: int | None, phi: Array) -> list[ChainGeometry] | None:
    """Return the arm's geometry at every redundancy value, or None where it has no spherical triple and pair.

    Args:
        arm: the arm.
        locked: index of the locked joint; None for a 6-joint arm.
        phi: (K,) values of the locked joint (rad).
    """
    rows = [_chain_geometry(arm, locked, float(value)) for value in phi]
    known = [row for row in rows if row is not None]
    return known if len(known) == len(rows) else None


def _chain_geometry(arm: Arm, locked: int | None, phi: float) -> ChainGeometry | None:
    """Return the arm's geometry with a joint locked at φ; None where it has no triple and pair."""
    h, o = arm.H.copy(), np.cumsum(arm.P, axis=0)
    R0, p0, o = arm.R0, o[-1], o[:-1].copy()
    if locked is not None:
        # The locked joint rotates all joints after it by a constant.
        turn, centre = rotation_about(h[locked], phi), o[locked].copy()
        h[locked + 1 :] = h[locked + 1 :] @ turn.T
        o[locked + 1 :] = (o[locked + 1 :] - centre) @ turn.T + centre
        R0, p0 = turn @ R0, turn @ (p0 - centre) + centre
        h, o = np.delete(h, locked, axis=0), np.delete(o, locked, axis=0)
    for backwards in (False, True):
        axes, points = (-h[::-1], o[::-1]) if backwards else (h, o)
        S, W = _common_point(axes[:3], points[:3]), _common_point(axes[4:], points[4:])
        if S is not None and W is not None:
            a, b = S - points[3], W - points[3]
            # |R4⁻¹ a − b|² = |t|² as b·R4⁻¹ a = …, and h1ᵀ R2 h3 = h1ᵀ M h3.
            middle = _cosine_constants(axes[3], a, b) + np.array([0.0, 0.0, -0.5 * (a @ a + b @ b), 0.0, 0.0])
            triple = _cosine_constants(axes[1], axes[2], axes[0])
            if middle[1] > PARALLEL * MEETING_DISTANCE and triple[1] > PARALLEL:
                return ChainGeometry(backwards, axes, R0, p0, S, W, a, b, middle, triple, phi)
    return None


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


def _common_point(h: Array, o: Array) -> Array | None:
    """Return the point (3,) where lines meet; None where they do not, or two successive ones are parallel.

    Args:
        h: (m, 3) unit directions of the lines.
        o: (m, 3) a point on each line.
    """
    if (np.linalg.norm(np.cross(h[:-1], h[1:]), axis=1) < PARALLEL).any():
        return None
    across = np.eye(3) - h[:, :, None] * h[:, None, :]
    point = np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, o))
    distance = np.linalg.norm(np.einsum("kij,kj->ki", across, point - o), axis=1)
    return point if distance.max() < MEETING_DISTANCE else None
