"""The geometry of arms with a spherical triple, read off the URDF: what the closed form needs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array, rotation_about
from symgrasp.robot.robot import Arm

__all__ = [
    "AXES", "CENTRE", "CENTRE_SEEN", "CLEARLY", "MIDDLE", "P0", "PHI", "R0", "TRIPLE", "WRIST", "WRIST_SEEN",
    "Chain", "Structure", "structures",
]  # fmt: skip

MEET = 1e-8
"""Axes that pass each other closer than this (m) meet; URDF files round their angles."""

PARALLEL = 1e-6
"""Axes whose cross product is shorter than this are parallel."""

CLEARLY = 1e-9
"""A joint is outside its limits without asking for its angle when a cosine says so by more than this."""

AXES, R0, P0, CENTRE, WRIST = 0, 18, 27, 30, 33
CENTRE_SEEN, WRIST_SEEN, MIDDLE, TRIPLE, PHI = 36, 39, 42, 47, 52
"""Where the parts of a `Structure` begin in a row of `Chain.geometry`."""


class Chain(NamedTuple):
    """The geometry of an arm read from the end with the triple, as numba wants it.

    K redundancy values, n joints, of which six are free, in the order of `symgrasp.ik.spherical`.

    Attributes:
        geometry: (K, 53) a `Structure` in each row.
        joint: (8,) index of each free joint in the arm, of the locked one (or -1), and whether
            the arm is read backwards.
        limits: (6, n) lower and upper limits, the middle that joint values are turned to, its cosine
            and sine, and the cosine of half the range, less `CLEARLY`.
        forward: (2 n + 5, 3) axes (n), offsets (n + 1), orientation of the tool at zero (3), and
            the tolerances (m, rad, -).
    """

    geometry: Array
    joint: np.ndarray
    limits: Array
    forward: Array


class Structure(NamedTuple):
    """The geometry at one value φ of the locked joint.

    Attributes:
        backwards: whether the arm is read from the tool to the base.
        h: (6, 3) unit axes at zero, reversed where the arm is read backwards.
        R0: (3, 3) orientation of the tool at zero.
        p0: (3,) position of the tool at zero.
        S: (3,) where the triple meets.
        W: (3,) where the pair meets.
        a: (3,) S seen from the middle joint.
        b: (3,) W seen from the middle joint.
        middle: (5,) constants of subproblem 3, see `_middle`.
        triple: (5,) constants of subproblem 4, see `_middle`.
        phi: φ.
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


def structures(arm: Arm, locked: int | None, phi: Array) -> list[Structure] | None:
    """Return the arm's geometry at every redundancy value, or None where it is of another family."""
    rows = [_structure(arm, locked, float(value)) for value in phi]
    known = [row for row in rows if row is not None]
    return known if len(known) == len(rows) else None


def _structure(arm: Arm, locked: int | None, phi: float) -> Structure | None:
    """Return the arm's geometry with a joint locked at φ, or None where it is of another family."""
    h, o = arm.H.copy(), np.cumsum(arm.P, axis=0)
    R0, p0, o = arm.R0, o[-1], o[:-1].copy()
    if locked is not None:
        # The locked joint turns all that comes after it once and for all.
        turn, centre = rotation_about(h[locked], phi), o[locked].copy()
        h[locked + 1 :] = h[locked + 1 :] @ turn.T
        o[locked + 1 :] = (o[locked + 1 :] - centre) @ turn.T + centre
        R0, p0 = turn @ R0, turn @ (p0 - centre) + centre
        h, o = np.delete(h, locked, axis=0), np.delete(o, locked, axis=0)
    for backwards in (False, True):
        axes, points = (-h[::-1], o[::-1]) if backwards else (h, o)
        S, W = _meeting(axes[:3], points[:3]), _meeting(axes[4:], points[4:])
        if S is not None and W is not None:
            a, b = S - points[3], W - points[3]
            # |R4⁻¹ a − b|² = |t|² as b·R4⁻¹ a = …, and h1ᵀ R2 h3 = h1ᵀ M h3.
            middle = _middle(axes[3], a, b) + np.array([0.0, 0.0, -0.5 * (a @ a + b @ b), 0.0, 0.0])
            triple = _middle(axes[1], axes[2], axes[0])
            if middle[1] > PARALLEL * MEET and triple[1] > PARALLEL:
                return Structure(backwards, axes, R0, p0, S, W, a, b, middle, triple, phi)
    return None


def _middle(k: Array, a: Array, b: Array) -> Array:
    """Return (middle, length, even part) of ``b·R(k, x) a = length·cos(x − middle) + even part``.

    Then come the sine and cosine of the middle.
    """
    part = float((k @ a) * (k @ b))
    sine, cosine = float(b @ np.cross(k, a)), float(a @ b) - part
    middle = np.arctan2(sine, cosine)
    return np.array([middle, np.hypot(sine, cosine), part, np.sin(middle), np.cos(middle)])


def _meeting(h: Array, o: Array) -> Array | None:
    """Return the point (3,) where lines meet whose neighbours are not parallel, or None."""
    if (np.linalg.norm(np.cross(h[:-1], h[1:]), axis=1) < PARALLEL).any():
        return None
    across = np.eye(3) - h[:, :, None] * h[:, None, :]
    point = np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, o))
    distance = np.linalg.norm(np.einsum("kij,kj->ki", across, point - o), axis=1)
    return point if distance.max() < MEET else None
