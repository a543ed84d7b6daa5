"""The geometry of an arm at any value of its redundancy, compiled: what `Chain.geometry` has for samples.

The locked joint turns all that comes after it about its axis, as a rigid body: axes, tool, and the points
where axes meet. A triple of axes on both sides of the locked joint meets on its axis, and stays
there. Of arms without a triple, where the pair meets and how the other axes lie is computed anew at every
value, unless the locked joint is the last.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.arm_ik import one_turn
from symgrasp.ik.chain import (
    AXES,
    CENTRE,
    CENTRE_SEEN,
    MIDDLE,
    P0,
    PARALLEL_PHI,
    PHI,
    R0,
    SPHERICAL,
    THREE_PARALLEL,
    TRIPLE,
    WRIST,
    WRIST_SEEN,
)
from symgrasp.ik.compiled import CompiledIK
from symgrasp.ik.families import BESIDE, chain_geometries, free_joints, parallel_below
from symgrasp.ik.pair.from_axes import meeting_point, write_pair
from symgrasp.ik.pair.geometry import MEETING_PAIR, PAIR_PHI, SHIFTED, WRIST_POINT
from symgrasp.ik.vectors import STRICT, cross, dot, minus, plus, rotate, row, vec
from symgrasp.poses import Array

__all__ = ["Locked", "geometry_at", "locked_joint"]


class Locked(NamedTuple):
    """What `geometry_at` needs of an arm with a locked joint.

    Attributes:
        row: (m,) its geometry at one value of the redundancy, see `Chain.geometry`.
        phi: that value (rad).
        axis: (3,) axis of the locked joint, in the base.
        centre: (3,) a point on it.
        points: (6, 3) a point on each free joint's axis, in the order of the closed form, where the geometry
            of an arm without a spherical triple is computed from them; else (0, 3).
        parallel: sine of the angle between the axes of joints 5 and 6 below which they do not meet.
        after: (8,) which parts the locked joint turns: the free joints 1 to 6 in the order of the closed
            form, the point where the triple meets, and that where the pair does.
        place: index of the redundancy in the row.
        spherical: whether the arm is of the family with a spherical triple.
        lower: least value of the redundancy (rad).
        upper: largest value of it (rad).
    """

    row: Array
    phi: float
    axis: Array
    centre: Array
    points: Array
    parallel: float
    after: np.ndarray
    place: int
    spherical: bool
    lower: float
    upper: float


def locked_joint(ik: CompiledIK) -> Locked | None:
    """Return what is needed to compute an arm's geometry at any φ, or None where that is not known.

    It is known for arms with a spherical triple, for those of which two axes meet, and for others whose last
    joint is locked.
    """
    joint = ik.locked
    family = int(ik.chain.joint[8])
    if joint is None or ik.arm.pitched or (family == THREE_PARALLEL and joint != ik.arm.dof - 1):
        return None
    after = ik.chain.joint[:6] > joint
    lower, upper = one_turn(float(ik.arm.lower[joint]), float(ik.arm.upper[joint]))
    row, phi, points, parallel = ik.chain.geometry[0].copy(), float(ik.phi[0]), np.empty((0, 3)), 0.0
    if family == MEETING_PAIR and joint != ik.arm.dof - 1:
        own = free_joints(ik.arm, joint, phi, bool(ik.chain.joint[7]))
        points = np.ascontiguousarray(own.o)
        row[:P0] = np.concatenate([own.h.ravel(), own.R0.ravel()])
        row[P0 : P0 + 3], row[SHIFTED] = own.p0, 0.0
        known = chain_geometries(ik.arm, joint, ik.phi)
        assert known is not None  # or there would be no solver
        parallel = parallel_below(known[0])
    return Locked(
        row=row,
        phi=phi,
        axis=ik.arm.H[joint].copy(),
        centre=np.cumsum(ik.arm.P, axis=0)[joint].copy(),
        points=points,
        parallel=parallel,
        after=np.array([*after, after[:3].all(), after[4:].all()]),
        place={SPHERICAL: PHI, THREE_PARALLEL: PARALLEL_PHI}.get(family, PAIR_PHI),
        spherical=family == SPHERICAL,
        lower=lower,
        upper=upper,
    )


@njit(**STRICT)
def geometry_at(locked, phi, g):
    """Write the geometry (m,) of an arm at a value φ (rad) of its redundancy into g."""
    if len(locked.points):
        if not _pair_at(locked, phi, g):
            shifted = _pair_at(locked, phi + BESIDE, g)
            g[SHIFTED] = 1.0
            if not shifted:
                g[WRIST_POINT] = math.nan  # nothing is found there
        g[locked.place] = phi
        return
    for i in range(len(g)):
        g[i] = locked.row[i]
    g[locked.place] = phi
    axis, centre = vec(locked.axis, 0), vec(locked.centre, 0)
    s, c = math.sin(phi - locked.phi), math.cos(phi - locked.phi)
    for j in range(3):
        x, y, z = rotate(axis, s, c, (g[R0 + j], g[R0 + 3 + j], g[R0 + 6 + j]))
        g[R0 + j], g[R0 + 3 + j], g[R0 + 6 + j] = x, y, z
    _put(g, P0, plus(rotate(axis, s, c, minus(vec(g, P0), centre)), centre))
    if not locked.spherical:
        return
    on_axis = minus(vec(g, CENTRE), vec(g, CENTRE_SEEN))  # a point on the axis of joint 4
    if locked.after[3]:
        on_axis = plus(rotate(axis, s, c, minus(on_axis, centre)), centre)
    for k in range(6):
        if locked.after[k]:
            _put(g, AXES + 3 * k, rotate(axis, s, c, vec(g, AXES + 3 * k)))
    for k, place in ((6, CENTRE), (7, WRIST)):
        if locked.after[k]:
            _put(g, place, plus(rotate(axis, s, c, minus(vec(g, place), centre)), centre))
    a, b = minus(vec(g, CENTRE), on_axis), minus(vec(g, WRIST), on_axis)
    _put(g, CENTRE_SEEN, a)
    _put(g, WRIST_SEEN, b)
    _constants(g, MIDDLE, vec(g, AXES + 9), a, b)
    g[MIDDLE + 2] -= 0.5 * (dot(a, a) + dot(b, b))
    _constants(g, TRIPLE, vec(g, AXES + 3), vec(g, AXES + 6), vec(g, AXES))


@njit(**STRICT)
def _pair_at(locked, phi, g):
    """Write the geometry of an arm of which two axes meet; return whether they do at φ (rad)."""
    for i in range(len(g)):
        g[i] = locked.row[i]
    axis = vec(locked.axis, 0)
    s, c = math.sin(phi - locked.phi), math.cos(phi - locked.phi)
    for j in range(3):
        x, y, z = rotate(axis, s, c, (g[R0 + j], g[R0 + 3 + j], g[R0 + 6 + j]))
        g[R0 + j], g[R0 + 3 + j], g[R0 + 6 + j] = x, y, z
    _put(g, P0, _turned(locked, s, c, vec(g, P0)))
    for k in range(6):
        if locked.after[k]:
            _put(g, AXES + 3 * k, rotate(axis, s, c, vec(g, AXES + 3 * k)))
    p = (
        _point(locked, s, c, 0), _point(locked, s, c, 1), _point(locked, s, c, 2),
        _point(locked, s, c, 3), _point(locked, s, c, 4), _point(locked, s, c, 5),
    )  # fmt: skip
    meets, W = meeting_point(g, p, locked.parallel)
    return meets and write_pair(g, p, W)


@njit(**STRICT)
def _point(locked, s, c, k):
    """Return a point on the axis of a free joint, turned by the locked joint by an angle of that sine."""
    point = row(locked.points, k)
    return _turned(locked, s, c, point) if locked.after[k] else point


@njit(**STRICT)
def _turned(locked, s, c, point):
    """Return a point (3,) turned about the axis of the locked joint."""
    centre = vec(locked.centre, 0)
    return plus(rotate(vec(locked.axis, 0), s, c, minus(point, centre)), centre)


@njit(**STRICT)
def _put(g, place, v):
    g[place], g[place + 1], g[place + 2] = v


@njit(**STRICT)
def _constants(g, place, k, a, b):
    """Write the constants (5,) of `symgrasp.ik.families.cosine_constants`."""
    part = dot(k, a) * dot(k, b)
    sine, cosine = dot(b, cross(k, a)), dot(a, b) - part
    length = math.sqrt(sine * sine + cosine * cosine)
    g[place], g[place + 1], g[place + 2] = math.atan2(sine, cosine), length, part
    g[place + 3], g[place + 4] = sine / length, cosine / length
