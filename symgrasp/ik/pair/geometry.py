"""The geometry of arms of which the axes of the last two joints meet, packed for the solver."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array

__all__ = [
    "CHAIN_DIRECTION", "CHAIN_POINT", "COSINE", "COSINE_56", "FIRST_AXIS", "FIRST_POINT", "FRAME", "GENERAL",
    "KIND", "LENGTH", "MEETING", "MEETING_PAIR", "OUTER_LAST", "PAIR_PHI", "PARALLEL", "SHIFTED",
    "SHOULDER_POINT", "SINE", "SPECIAL", "VARIES", "WORTH", "WRIST_POINT", "PairGeometry", "pair_geometry",
]  # fmt: skip

WRIST_POINT, SHOULDER_POINT, FRAME, FIRST_AXIS, FIRST_POINT = 30, 33, 36, 45, 48
CHAIN_POINT, CHAIN_DIRECTION, LENGTH, COSINE, SINE, COSINE_56 = 51, 60, 69, 70, 71, 72
KIND, OUTER_LAST, PAIR_PHI, SHIFTED = 73, 74, 75, 76
"""Where the parts of a `PairGeometry` begin that other geometries do not have."""

MEETING_PAIR = 2
"""The family of these arms."""

GENERAL, MEETING, PARALLEL = 0.0, 1.0, 2.0
"""What the axes of joints 2 and 3 do."""

SPECIAL = 3e-6
"""Axes closer than this (m) count as meeting here, and with a sine below it as parallel: the equations of
axes that almost are lose more digits than that, and Newton's method on the arm itself mends the rest."""

WORTH = 5.0
"""Joint 4 is the outer joint where that makes the least coefficient larger by this factor; with joint 1, what
does not depend on the pose is the inner joint's."""

VARIES = 1e-6
"""An inner joint whose least coefficient (m², or m) is below this does not move the point that it should."""


class PairGeometry(NamedTuple):
    """The geometry of six free joints of which the last two meet, at one value φ of the locked joint.

    The first four parts are in the base frame at zero; the others in the frames of joints 2 and 3, whose
    origins are the feet of the common normal, and whose axes are the normal n, h × n and the axis h of the
    joint. Where joint 4 is the outer joint, the frames are turned around: n and h point the other way.

    Attributes:
        backwards: whether the arm is read from the tool to the base.
        h: (6, 3) unit axes, reversed where the arm is read backwards.
        R0: (3, 3) orientation of the tool.
        p0: (3,) position of the tool.
        W: (3,) point where the axes of joints 5 and 6 meet.
        shoulder: (3,) foot of the normal on the axis of joint 2.
        frame: (3, 3) axes of the frame at joint 2, as rows.
        first_axis: (3,) axis of joint 1 in that frame.
        first_point: (3,) point on it.
        chain_point: (3, 3) the point W as joint 4 turns it, in the frame at joint 3: at rest, and the
            coefficients of cosine and sine.
        chain_direction: (3, 3) the same of h5.
        length: length a of the normal (m); exactly 0 where the axes meet.
        cosine: cosine of the angle of the two axes.
        sine: its sine, by which ``h = cosine·h' − sine·(h' × n)`` of the inner joint's axis h and the outer
            one's h'; exactly 0 where they are parallel.
        cosine_56: cosine of the angle of the axes of joints 5 and 6.
        kind: `GENERAL`, `MEETING` or `PARALLEL`.
        outer_last: 1 where joint 4 is the outer joint, 0 where joint 1 is.
        phi: the value φ (rad).
        shifted: 1 where the pair is parallel at φ, and the geometry that of a value beside it; else 0.
    """

    backwards: bool
    h: Array
    R0: Array
    p0: Array
    W: Array
    shoulder: Array
    frame: Array
    first_axis: Array
    first_point: Array
    chain_point: Array
    chain_direction: Array
    length: float
    cosine: float
    sine: float
    cosine_56: float
    kind: float
    outer_last: float
    phi: float
    shifted: float = 0.0

    @property
    def family(self) -> int:
        """`MEETING_PAIR`."""
        return MEETING_PAIR

    def packed(self) -> Array:
        """Return all parts but the first in one row (77,)."""
        return np.concatenate([np.ravel(part) for part in self[1:]])


def pair_geometry(
    backwards: bool, h: Array, o: Array, R0: Array, p0: Array, W: Array, phi: float
) -> PairGeometry | None:
    """Return the geometry of joints, with the outer joint that makes the equations well-conditioned.

    Args:
        backwards: whether they are read from the tool to the base.
        h: (6, 3) unit axes.
        o: (6, 3) a point on each axis.
        R0: (3, 3) orientation of the tool.
        p0: (3,) position of the tool.
        W: (3,) point where the axes of joints 5 and 6 meet.
        phi: value of the locked joint (rad).

    Returns:
        None where joints 2 and 3 have the same axis, or neither joint 1 nor joint 4 can be the inner one.
    """
    normal = _common_normal(h[1], o[1], h[2], o[2])
    if normal is None:
        return None
    shoulder, elbow, n, a, s = normal
    kind = MEETING if a < SPECIAL else PARALLEL if s < SPECIAL else GENERAL
    choices = []
    for way in (1.0, -1.0):
        frame2, frame3 = (np.array([way * n, np.cross(k, n), way * k]) for k in (h[1], h[2]))
        outer, inner = (h[1], h[2]) if way > 0.0 else (-h[2], -h[1])
        chain = _circle(h[3], W - o[3]) @ frame3.T
        chain[0] += frame3 @ (o[3] - elbow)
        choices.append(PairGeometry(
            backwards, h, R0, p0, W, shoulder, frame2,
            first_axis=frame2 @ h[0],
            first_point=frame2 @ (o[0] - shoulder),
            chain_point=chain,
            chain_direction=_circle(h[3], h[4]) @ frame3.T,
            length=0.0 if kind == MEETING else a,
            cosine=float(inner @ outer),
            sine=0.0 if kind == PARALLEL else -float(inner @ np.cross(outer, way * n)),
            cosine_56=float(h[4] @ h[5]),
            kind=kind,
            outer_last=float(way < 0.0),
            phi=phi,
        ))  # fmt: skip
    first, last = choices
    best = last if _leading(last) > WORTH * _leading(first) else first
    return best if _leading(best) > VARIES else None


def _common_normal(k: Array, a: Array, m: Array, b: Array) -> tuple[Array, Array, Array, float, float] | None:
    """Return the feet of the common normal of two lines, its direction and length, and the sine of the angle.

    None where both are the same line.

    Args:
        k: unit direction (3,) of the first line.
        a: point (3,) on it.
        m: unit direction (3,) of the second line.
        b: point (3,) on it.
    """
    normal, d = np.cross(k, m), b - a
    s = float(np.linalg.norm(normal))
    if s < SPECIAL:
        d = d - k * (k @ d)
        length = float(np.linalg.norm(d))
        return None if length < SPECIAL else (a, a + d, d / length, length, s)
    n = normal / s
    x, y, length = np.linalg.solve(np.array([k, -m, n]).T, d)
    n = -n if length < 0.0 else n
    return a + x * k, b + y * m, n, abs(float(length)), s


def _circle(k: Array, v: Array) -> Array:
    """Return a vector (3,) turned about a unit axis: what rests, and the coefficients of cosine and sine."""
    rest = k * (k @ v)
    return np.array([rest, v - rest, np.cross(k, v)])


def _leading(geometry: PairGeometry) -> float:
    """Return the size (m², or m) of the coefficients that tell the values of the inner joint apart."""
    a, s = geometry.length, geometry.sine
    if geometry.outer_last:
        # p has any distance from the axis of joint 1: 1 m stands for it.
        axis, point = geometry.first_axis, geometry.first_point
        along, square = np.linalg.norm(axis[:2]), 2.0 * np.linalg.norm(np.cross(axis, point))
        general = max(abs(s) * square, 2.0 * a * along)
    else:
        rest, c, t = geometry.chain_point
        along1, square1 = complex(c[2], -t[2]), 2.0 * complex(rest @ c, -(rest @ t))
        along, square = abs(along1), abs(square1)
        general = math.sqrt(abs((s * square1) ** 2 + (2.0 * a * along1) ** 2))
    return float({MEETING: square, PARALLEL: along, GENERAL: general}[geometry.kind])
