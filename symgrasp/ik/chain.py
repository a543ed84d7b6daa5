"""The geometry of arms of the compiled closed forms, packed for compiled code."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from symgrasp.ik.pair.geometry import PairGeometry
from symgrasp.poses import Array

__all__ = [
    "AXES", "BASE", "BEND", "CENTRE", "CENTRE_SEEN", "COSINE_TOLERANCE", "ELBOW", "FOREARM", "HAND",
    "MEETING", "MIDDLE", "OFFSET", "P0", "PARALLEL_PHI", "PARALLEL_SLACK", "PHI", "R0", "SHOULDER", "SKEW",
    "SLACK", "THREE_PARALLEL", "TRIPLE", "TURN", "WRIST", "WRIST_SEEN", "Chain", "ChainGeometry",
    "ParallelGeometry", "SphericalGeometry",
]  # fmt: skip


COSINE_TOLERANCE = 4e-9
"""A joint is known to be outside its limits from its cosine alone where that is off by more than this: what
the tolerance of limits may change it by, and more."""

AXES, R0, P0 = 0, 18, 27
"""Where the parts that all geometries have begin in a row of `Chain.geometry`."""

CENTRE, WRIST, CENTRE_SEEN, WRIST_SEEN, MIDDLE, TRIPLE, PHI, SLACK = 30, 33, 36, 39, 42, 47, 52, 53
"""Where the other parts of a `SphericalGeometry` begin."""

BASE, MEETING, SHOULDER, ELBOW, FOREARM, HAND, BEND, TURN = 30, 33, 36, 39, 42, 45, 48, 53
OFFSET, SKEW, PARALLEL_PHI, PARALLEL_SLACK = 58, 61, 68, 69
"""Where the other parts of a `ParallelGeometry` begin."""

SPHERICAL, THREE_PARALLEL = 0, 1
"""The families of arms whose closed forms are compiled."""


class Chain(NamedTuple):
    """The geometry of an arm at K redundancy values, packed into arrays for compiled code.

    The arm has n joints, of which six are free, numbered 1 to 6 as in `symgrasp.ik.spherical`,
    `symgrasp.ik.parallel` or `symgrasp.ik.pair.solver`.

    Attributes:
        geometry: (K, m) a geometry of one of the families in each row.
        joint: (11,) index of each free joint in the arm, of the locked one (or -1), whether the arm is
            read backwards, its family, whether it is rounded: then its geometry is not quite its own,
            and what the closed form finds has to be polished; and the index of a pitched arm's azimuth (or
            -1), outside of whose limits the grasp is that of another cell.
        limits: (6, n) lower limit, upper limit, middle of the range, cosine and sine of the middle, and
            the cosine of half the range, less `COSINE_TOLERANCE`.
        leeway: (6, n) the same limits, wider, for the closed form: of a rounded arm by more than of others.
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
        middle: (5,) constants of subproblem 3, see `symgrasp.ik.families.cosine_constants`.
        triple: (5,) constants of subproblem 4, see `symgrasp.ik.families.cosine_constants`.
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
        W: (3,) point where the axes of joints 5 and 6 meet, or that of joint 6 is nearest to that of joint 5.
        shoulder: (3,) O2.
        elbow: (3,) O3.
        forearm: (3,) O4 − O3.
        hand: (3,) O5 − O4, for the point O5 on the axis of joint 5 that is nearest to W.
        bend: (5,) constants of subproblem 3 for joint 3, see `symgrasp.ik.families.cosine_constants`.
        turn: (5,) constants of subproblem 4 for joint 5, see `symgrasp.ik.families.cosine_constants`.
        offset: (3,) W − O5; zero where they meet.
        skew: (7,) whether they do not, the parts of W and h6 along h2 that joint 5 does not change, and the
            inverse of the matrix by which it changes them.
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
    offset: Array
    skew: Array
    phi: float
    slack: float

    @property
    def family(self) -> int:
        """`THREE_PARALLEL`."""
        return THREE_PARALLEL

    def packed(self) -> Array:
        """Return all parts but the first in one row (70,)."""
        return np.concatenate([np.ravel(part) for part in self[1:]])

    def nowhere(self, phi: float) -> ParallelGeometry:
        """Return the geometry of a value (rad) at which no solution is found."""
        return self._replace(W=np.full(3, np.nan), phi=phi)


ChainGeometry: TypeAlias = SphericalGeometry | ParallelGeometry | PairGeometry
