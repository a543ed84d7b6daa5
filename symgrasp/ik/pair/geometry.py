"""The geometry of arms of which the axes of the last two joints meet, packed for the solver."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from symgrasp.poses import Array

__all__ = [
    "CHAIN_DIRECTION", "CHAIN_POINT", "COSINE", "COSINE_56", "FIRST_AXIS", "FIRST_POINT", "FRAME", "GENERAL",
    "KIND", "LENGTH", "MEETING", "MEETING_PAIR", "OUTER_LAST", "PAIR_PHI", "PARALLEL", "SHIFTED",
    "SHOULDER_POINT", "SINE", "SIZE", "SPECIAL", "TILT", "VARIES", "WORTH", "WRIST_POINT", "PairGeometry",
]  # fmt: skip

WRIST_POINT, SHOULDER_POINT, FRAME, FIRST_AXIS, FIRST_POINT = 30, 33, 36, 45, 48
CHAIN_POINT, CHAIN_DIRECTION, LENGTH, COSINE, SINE, COSINE_56 = 51, 60, 69, 70, 71, 72
KIND, OUTER_LAST, PAIR_PHI, SHIFTED, TILT, SIZE = 73, 74, 75, 76, 77, 78
"""Where the parts of a row of a `PairGeometry` begin that other geometries do not have, and its length."""

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

    The first four parts of the row are in the base frame at zero; the others in the frames of joints 2 and 3,
    whose origins are the feet of the common normal, and whose axes are the normal n, h × n and the axis h of
    the joint. Where joint 4 is the outer joint, the frames are turned around: n and h point the other way.
    The feet of axes that are nearly parallel are far away: there n is normal to the inner joint's axis alone,
    and begins at a point on the other axis, whose frame has the part of n that is normal to its own axis.
    In this order the row has

    - the unit axes h (6, 3), reversed where the arm is read backwards, and the tool's orientation (3, 3) and
      position (3,), as all geometries do;
    - `WRIST_POINT`: the point W (3,) where the axes of joints 5 and 6 meet;
    - `SHOULDER_POINT`: the foot (3,) of the normal on the axis of joint 2;
    - `FRAME`: the axes (3, 3) of the frame at joint 2, as rows;
    - `FIRST_AXIS` and `FIRST_POINT`: the axis (3,) of joint 1 in that frame, and a point (3,) on it;
    - `CHAIN_POINT`: the point W as joint 4 turns it, in the frame at joint 3: at rest (3,), and the
      coefficients (3,) of cosine and of sine;
    - `CHAIN_DIRECTION`: the same of h5;
    - `LENGTH`: the length a of the normal (m); exactly 0 where the axes meet;
    - `COSINE` and `SINE`: the outer joint's axis is ``tilt·n + sine·(h × n) + cosine·h`` with the inner one's
      h; the sine is exactly 0 where they are parallel, or meet far away;
    - `COSINE_56`: the cosine of the angle of the axes of joints 5 and 6;
    - `KIND`: `GENERAL`, `MEETING` or `PARALLEL`;
    - `OUTER_LAST`: 1 where joint 4 is the outer joint, 0 where joint 1 is;
    - `PAIR_PHI`: the value φ (rad);
    - `SHIFTED`: 1 where the pair is parallel at φ, and the geometry that of a value beside it; else 0;
    - `TILT`: the cosine of the angle of n and the outer joint's axis; 0 for the common normal.

    Attributes:
        backwards: whether the arm is read from the tool to the base.
        row: (`SIZE`,) all that compiled code needs.
    """

    backwards: bool
    row: Array

    @property
    def family(self) -> int:
        """`MEETING_PAIR`."""
        return MEETING_PAIR

    def packed(self) -> Array:
        """Return the row."""
        return self.row

    def at(self, phi: float, places: Mapping[int, float]) -> PairGeometry:
        """Return a copy for a value (rad), with other values at places of its row."""
        row = self.row.copy()
        row[[PAIR_PHI, *places]] = [phi, *places.values()]
        return PairGeometry(self.backwards, row)

    def nowhere(self, phi: float) -> PairGeometry:
        """Return the geometry of a value (rad) at which no solution is found."""
        return self.at(phi, {WRIST_POINT: math.nan})
