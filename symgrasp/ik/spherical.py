"""Batched closed-form inverse kinematics of arms with a spherical triple, compiled by numba.

With one joint locked (or with six joints), many arms are three joints that meet in a point S at one
end, one joint in the middle, and two joints that meet in a point W at the other end: Panda, iiwa,
PR2, TALOS, TIAGo. Seen from the end with the triple (an arm with a spherical wrist is read
backwards, ``G⁻¹ = e6⁻¹ … e1⁻¹``), the motion of the tool from its place at zero is

    G = e1 e2 e3 · e4 · e5 e6,     ek = rotation by qk about the line (hk, ok),

    |G⁻¹ S − W| = |e4⁻¹ S − W|                     the middle joint: two values
    R5⁻¹ (e4⁻¹ S − W) = R6 (G⁻¹ S − W)             the pair: two values
    R1 R2 R3 = R_G R6⁻¹ R5⁻¹ R4⁻¹                  the triple: two values

which are the subproblems 3, 2 and 4 of Paden and Kahan, eight branches in all. Each branch is
computed by itself, in plain IEEE arithmetic: the answer at a pose and a redundancy value does not
depend on what else is in the batch.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from symgrasp.compiling import njit
from symgrasp.ik.closed_form import ClosedFormIK, Solutions, Tolerance
from symgrasp.poses import Array, rotation_about
from symgrasp.robot import Arm

__all__ = ["BRANCHES", "STRICT", "Chain", "SphericalIK", "branches_at"]

BRANCHES = 8
"""Branches of the closed form: two for the middle joint, times two for the pair, times two."""

MEET = 1e-8
"""Axes that pass each other closer than this (m) meet; URDF files round their angles."""

PARALLEL = 1e-6
"""Axes whose cross product is shorter than this are parallel."""

GRAZE = 1e-12
"""By how much (of one, or m²) a square root may fall below zero and count as zero: at the edge of
the reach both branches are one, and rounding decides."""

CLEARLY = 1e-9
"""A joint is outside its limits without asking for its angle when a cosine says so by more than this."""

STRICT: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
"""How to compile: plain IEEE arithmetic. The last entry spares the counting of references to arrays,
of which nothing below makes any."""


class Chain(NamedTuple):
    """The geometry of an arm read from the end with the triple, as numba wants it.

    K redundancy values, n joints, of which six are free, in the order above.

    Attributes:
        geometry: (K, 53) a `_Structure` in each row.
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


class SphericalIK(ClosedFormIK):
    """`ClosedFormIK` for arms with a spherical triple, hundreds of times faster in batches.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        tolerance: what a solution may miss the pose by.

    Raises:
        UrdfError: no closed form is known for the arm, whichever joint is locked.
        ValueError: a closed form is known, but it is not of this family; see `fits`.
    """

    def __init__(self, arm: Arm, samples: int, tolerance: Tolerance | None = None) -> None:
        super().__init__(arm, samples, tolerance)
        self.chain = self._chain(self.phi)

    @staticmethod
    def fits(ik: ClosedFormIK) -> bool:
        """Whether the arm of a solver belongs to the family, with the joint locked that it locks."""
        return _structures(ik.arm, ik.locked, ik.phi) is not None

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), at every redundancy sample."""
        return self._solve(self.chain, T_base_tool, 0, len(self.phi))

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""
        found = self._solve(self.chain, T_base_tool, sample, sample + 1)
        return found._replace(sample=np.zeros_like(found.sample))

    def solve_at(self, T_base_tool: Array, phi: float) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy value."""
        return self._solve(self._chain(np.array([phi])), T_base_tool, 0, 1)

    def solve_batch(self, T_base_tool: Array) -> tuple[Array, np.ndarray, np.ndarray]:
        """Solve many poses at every redundancy sample, on all cores.

        Args:
            T_base_tool: poses (m, 4, 4).

        Returns:
            q (m, samples, BRANCHES, n), whether it reaches the pose (m, samples, BRANCHES), and
            whether it does so inside the limits.
        """
        T = np.ascontiguousarray(T_base_tool, dtype=float)
        found = self._room(len(T), len(self.phi))
        _solve_batch(*self.chain, T, *found)
        return found

    def _solve(self, chain: Chain, T_base_tool: Array, first: int, last: int) -> Solutions:
        T = np.ascontiguousarray(T_base_tool, dtype=float)
        q, exists, inside = self._room(last - first)
        _solve_range(*chain, T, first, last, q, exists, inside)
        sample, branch = np.nonzero(exists)
        return Solutions(q[exists], sample + first, branch, inside[exists])

    def _room(self, *shape: int) -> tuple[Array, np.ndarray, np.ndarray]:
        """Return arrays for compiled code to write to: a Ctrl-C while numba wraps up results crashes."""
        q = np.empty((*shape, BRANCHES, self.arm.dof))
        return q, np.empty(q.shape[:-1], dtype=bool), np.empty(q.shape[:-1], dtype=bool)

    def _chain(self, phi: Array) -> Chain:
        arm = self.arm
        rows = _structures(arm, self.locked, phi)
        if rows is None:
            raise ValueError(f"{arm.name}: no spherical triple and pair of joints that meet")
        locked = -1 if self.locked is None else self.locked
        free = [j for j in range(arm.dof) if j != locked]
        backwards = rows[0].backwards
        bounded = np.isfinite(arm.lower) & np.isfinite(arm.upper)
        middle = np.zeros(arm.dof)
        middle[bounded] = 0.5 * (arm.lower + arm.upper)[bounded]
        half = np.minimum(np.where(bounded, 0.5 * (arm.upper - arm.lower), np.inf), np.pi)
        least = np.cos(half) - CLEARLY
        tolerance = [self.tolerance.position, self.tolerance.rotation, 0.0]
        return Chain(
            geometry=np.array([np.concatenate([np.ravel(part) for part in row[1:]]) for row in rows]),
            joint=np.array([*(free[::-1] if backwards else free), locked, backwards]),
            limits=np.array([arm.lower, arm.upper, middle, np.cos(middle), np.sin(middle), least]),
            forward=np.concatenate([arm.H, arm.P, arm.R0, [tolerance]]),
        )


class _Structure(NamedTuple):
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


# Where they lie in a row of `Chain.geometry`.
_H, _R0, _P0, _S, _W, _A, _B, _MIDDLE, _TRIPLE, _PHI = 0, 18, 27, 30, 33, 36, 39, 42, 47, 52


def _structures(arm: Arm, locked: int | None, phi: Array) -> list[_Structure] | None:
    """Return the arm's geometry at every redundancy value, or None where it is of another family."""
    rows = [_structure(arm, locked, float(value)) for value in phi]
    known = [row for row in rows if row is not None]
    return known if len(known) == len(rows) else None


def _structure(arm: Arm, locked: int | None, phi: float) -> _Structure | None:
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
                return _Structure(backwards, axes, R0, p0, S, W, a, b, middle, triple, phi)
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


# -- compiled -------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy", parallel=True)
def _solve_batch(geometry, joint, limits, forward, T, q, exists, inside):
    for i in prange(len(T)):
        for k in range(len(geometry)):
            branches_at(geometry, joint, limits, forward, k, T[i], False, q[i, k], exists[i, k], inside[i, k])


@njit(cache=True, error_model="numpy")
def _solve_range(geometry, joint, limits, forward, T, first, last, q, exists, inside):
    for k in range(first, last):
        i = k - first
        branches_at(geometry, joint, limits, forward, k, T, False, q[i], exists[i], inside[i])


@njit(**STRICT)
def branches_at(geometry, joint, limits, forward, k, T, inside_only, q, exists, inside):
    """Solve one pose (4, 4) at redundancy sample k.

    Args:
        geometry, joint, limits, forward: the arm, see `Chain`.
        k: index of the redundancy sample.
        T: tool pose (4, 4) in the base.
        inside_only: leave out what is outside the limits, as soon as that shows; what remains is
            bit for bit the same.
        q: (BRANCHES, n) receives the joint values.
        exists: (BRANCHES,) receives which branches reach the pose.
        inside: (BRANCHES,) receives which do so inside the limits.

    Returns:
        Whether the middle joint can bring S and W as far apart as the pose has them.
    """
    for b in range(BRANCHES):
        exists[b] = False
        inside[b] = False
    g = geometry[k]
    R, p = _motion(g, joint[7], T)
    a = _vec(g, _A)
    t = _minus(_back(R, _minus(_vec(g, _S), p)), _vec(g, _W))  # G⁻¹ S − W
    # Subproblem 3: |R4⁻¹ a − b| = |t|. Sines and cosines come without their angles where they can:
    # most branches end at a limit, and few angles are ever needed.
    middle, length, part = _vec(g, _MIDDLE)
    sm, cm = g[_MIDDLE + 3], g[_MIDDLE + 4]
    c = (-0.5 * _dot(t, t) - part) / length
    s = _sine(c)
    if s < 0.0:
        return False
    swing = math.atan2(s, c)
    for i in range(2):
        if i == 0:
            q4, s4, c4 = -(middle + swing), -(sm * c + cm * s), cm * c - sm * s
        else:
            q4, s4, c4 = swing - middle, s * cm - c * sm, cm * c + sm * s
        if inside_only and _outside(limits, joint[3], s4, c4):
            continue
        q4 = _turned(limits, joint[3], q4)
        if inside_only and not _within(limits, joint[3], q4):
            continue
        u = _minus(_turn(_vec(g, _H + 9), -s4, c4, a), _vec(g, _B))  # e4⁻¹ S − W
        _pairs(g, joint, limits, R, t, u, q4, s4, c4, i, inside_only, q, exists, inside)
    for i in range(BRANCHES):
        if exists[i] and _misses(forward, q[i], T):
            exists[i] = False
            inside[i] = False
    return True


@njit(**STRICT)
def _sine(cosine):
    """Return the sine of the arc cosine, which is not negative, or -1 where there is none."""
    rest = 1.0 - cosine * cosine
    return math.sqrt(max(rest, 0.0)) if rest >= -GRAZE else -1.0


@njit(**STRICT)
def _pairs(g, joint, limits, R, t, u, q4, s4, c4, i, inside_only, q, exists, inside):
    """Subproblem 2: R5⁻¹ u = R6 t."""
    h4, h5, h6 = _vec(g, _H + 9), _vec(g, _H + 12), _vec(g, _H + 15)
    c = _dot(h5, h6)
    across = 1.0 - c * c
    along5, along6 = _dot(h5, u), _dot(h6, t)
    alpha = (along5 - c * along6) / across
    beta = (along6 - c * along5) / across
    rest = (_dot(u, u) - alpha * alpha - beta * beta - 2.0 * alpha * beta * c) / across
    if rest < -GRAZE:
        return
    gamma = math.sqrt(max(rest, 0.0))
    normal = _cross(h5, h6)
    h3 = _vec(g, _H + 6)
    side = _perpendicular(h3)
    v3, vside = _turn(h4, -s4, c4, h3), _turn(h4, -s4, c4, side)
    for j in range(2):
        out = gamma if j == 0 else -gamma
        z = (
            alpha * h5[0] + beta * h6[0] + out * normal[0],
            alpha * h5[1] + beta * h6[1] + out * normal[1],
            alpha * h5[2] + beta * h6[2] + out * normal[2],
        )
        y6, x6 = _angle(h6, t, z)
        s6, c6 = _unit(y6, x6)
        if inside_only and _outside(limits, joint[5], s6, c6):
            continue
        y5, x5 = _angle(h5, z, u)
        s5, c5 = _unit(y5, x5)
        if inside_only and _outside(limits, joint[4], s5, c5):
            continue
        q6 = _turned(limits, joint[5], math.atan2(y6, x6))
        if inside_only and not _within(limits, joint[5], q6):
            continue
        q5 = _turned(limits, joint[4], math.atan2(y5, x5))
        if inside_only and not _within(limits, joint[4], q5):
            continue
        # M = R_G R6⁻¹ R5⁻¹ R4⁻¹, of h3 and of what stands across it
        M3 = _times(R, _turn(h6, -s6, c6, _turn(h5, -s5, c5, v3)))
        Mside = _times(R, _turn(h6, -s6, c6, _turn(h5, -s5, c5, vside)))
        _triple(g, joint, limits, M3, Mside, side, q4, q5, q6, 4 * i + 2 * j, inside_only, q, exists, inside)


@njit(**STRICT)
def _triple(g, joint, limits, M3, Mside, side, q4, q5, q6, branch, inside_only, q, exists, inside):
    """Subproblem 4: R1 R2 R3 = M, so h1ᵀ R2 h3 = h1ᵀ M h3."""
    h1, h2, h3 = _vec(g, _H), _vec(g, _H + 3), _vec(g, _H + 6)
    middle, length, part = _vec(g, _TRIPLE)
    sm, cm = g[_TRIPLE + 3], g[_TRIPLE + 4]
    c = (_dot(h1, M3) - part) / length
    s = _sine(c)
    if s < 0.0:
        return
    for i in range(2):
        way = s if i == 0 else -s
        s2, c2 = sm * c + cm * way, cm * c - sm * way
        if inside_only and _outside(limits, joint[1], s2, c2):
            continue
        y1, x1 = _angle(h1, _turn(h2, s2, c2, h3), M3)
        s1, c1 = _unit(y1, x1)
        if inside_only and _outside(limits, joint[0], s1, c1):
            continue
        # R3 from all of R2⁻¹ R1⁻¹ M: where q1 is free, because h1 and h3 align, q3 makes up for it.
        y3, x3 = _angle(h3, side, _turn(h2, -s2, c2, _turn(h1, -s1, c1, Mside)))
        q2 = _turned(limits, joint[1], middle + math.atan2(way, c))
        if inside_only and not _within(limits, joint[1], q2):
            continue
        q1 = _turned(limits, joint[0], math.atan2(y1, x1))
        if inside_only and not _within(limits, joint[0], q1):
            continue
        q3 = _turned(limits, joint[2], math.atan2(y3, x3))
        if inside_only and not _within(limits, joint[2], q3):
            continue
        row = q[branch + i]
        row[joint[0]] = q1
        row[joint[1]] = q2
        row[joint[2]] = q3
        row[joint[3]] = q4
        row[joint[4]] = q5
        row[joint[5]] = q6
        if joint[6] >= 0:
            row[joint[6]] = _turned(limits, joint[6], g[_PHI])
        exists[branch + i] = True
        fits = True
        for j in range(row.shape[0]):
            fits = fits and _within(limits, j, row[j])
        inside[branch + i] = fits


@njit(**STRICT)
def _motion(g, backwards, T):
    """Return G as nested tuples (rotation, position), read from the end with the triple."""
    p0 = _vec(g, _P0)
    # G = T T0⁻¹: rotation T R0ᵀ, position p − R p0.
    R = (
        (_row3(T, 0, g, 0), _row3(T, 0, g, 1), _row3(T, 0, g, 2)),
        (_row3(T, 1, g, 0), _row3(T, 1, g, 1), _row3(T, 1, g, 2)),
        (_row3(T, 2, g, 0), _row3(T, 2, g, 1), _row3(T, 2, g, 2)),
    )
    p = (
        T[0, 3] - (R[0][0] * p0[0] + R[0][1] * p0[1] + R[0][2] * p0[2]),
        T[1, 3] - (R[1][0] * p0[0] + R[1][1] * p0[1] + R[1][2] * p0[2]),
        T[2, 3] - (R[2][0] * p0[0] + R[2][1] * p0[1] + R[2][2] * p0[2]),
    )
    if backwards:
        back = _back(R, p)
        p = (-back[0], -back[1], -back[2])
        R = (
            (R[0][0], R[1][0], R[2][0]),
            (R[0][1], R[1][1], R[2][1]),
            (R[0][2], R[1][2], R[2][2]),
        )
    return R, p


@njit(**STRICT)
def _row3(T, i, g, j):
    return T[i, 0] * g[_R0 + 3 * j] + T[i, 1] * g[_R0 + 3 * j + 1] + T[i, 2] * g[_R0 + 3 * j + 2]


@njit(**STRICT)
def _times(R, v):
    """Return R v."""
    return (
        R[0][0] * v[0] + R[0][1] * v[1] + R[0][2] * v[2],
        R[1][0] * v[0] + R[1][1] * v[1] + R[1][2] * v[2],
        R[2][0] * v[0] + R[2][1] * v[1] + R[2][2] * v[2],
    )


@njit(**STRICT)
def _turned(limits, joint, value):
    """Take the full turns that bring a joint nearest to the middle of its limits."""
    return value + 2.0 * math.pi * math.floor((limits[2, joint] - value) / (2.0 * math.pi) + 0.5)


@njit(**STRICT)
def _within(limits, joint, value):
    return limits[0, joint] <= value <= limits[1, joint]


@njit(**STRICT)
def _outside(limits, joint, s, c):
    """Whether the sine and cosine of a joint's angle say that no turn of it is inside the limits.

    The turn nearest to the middle is inside when it is no further from it than half the range.
    """
    return c * limits[3, joint] + s * limits[4, joint] < limits[5, joint]


@njit(**STRICT)
def _unit(y, x):
    """Return sine and cosine of ``atan2(y, x)``."""
    length = math.sqrt(y * y + x * x)
    if length == 0.0:
        return 0.0, 1.0
    return y / length, x / length


@njit(**STRICT)
def _misses(forward, q, T):
    """Whether forward kinematics is further from the pose than the tolerances allow."""
    n = q.shape[0]
    x, y, p = _column(forward, 2 * n + 1, 0), _column(forward, 2 * n + 1, 1), (0.0, 0.0, 0.0)
    for j in range(n - 1, -1, -1):
        axis, s, c = _row(forward, j), math.sin(q[j]), math.cos(q[j])
        x, y = _turn(axis, s, c, x), _turn(axis, s, c, y)
        p = _turn(axis, s, c, _plus(p, _row(forward, n + j + 1)))
    d = _minus(_plus(p, _row(forward, n)), _column(T, 0, 3))
    dx, dy = _minus(x, _column(T, 0, 0)), _minus(y, _column(T, 0, 1))
    # The columns of two rotations an angle apart differ by at most that angle, and two columns by
    # at least that angle together.
    turn = math.sqrt(_dot(dx, dx) + _dot(dy, dy))
    return not (math.sqrt(_dot(d, d)) <= forward[2 * n + 4, 0] and turn <= forward[2 * n + 4, 1])


@njit(**STRICT)
def _turn(axis, s, c, v):
    """Rotate v about a unit axis by the angle of that sine and cosine (Rodrigues)."""
    along = _dot(axis, v) * (1.0 - c)
    w = _cross(axis, v)
    return (
        c * v[0] + s * w[0] + along * axis[0],
        c * v[1] + s * w[1] + along * axis[1],
        c * v[2] + s * w[2] + along * axis[2],
    )


@njit(**STRICT)
def _angle(axis, a, b):
    """Subproblem 1: y and x of the angle ``atan2(y, x)`` about an axis that turns a into b."""
    return _dot(axis, _cross(a, b)), _dot(a, b) - _dot(axis, a) * _dot(axis, b)


@njit(**STRICT)
def _perpendicular(v):
    """Return a unit vector across v."""
    w = (0.0, -v[2], v[1]) if abs(v[0]) < 0.6 else (v[2], 0.0, -v[0])
    length = math.sqrt(_dot(w, w))
    return (w[0] / length, w[1] / length, w[2] / length)


@njit(**STRICT)
def _back(R, v):
    """Return Rᵀ v."""
    return (
        R[0][0] * v[0] + R[1][0] * v[1] + R[2][0] * v[2],
        R[0][1] * v[0] + R[1][1] * v[1] + R[2][1] * v[2],
        R[0][2] * v[0] + R[1][2] * v[1] + R[2][2] * v[2],
    )


@njit(**STRICT)
def _row(a, i):
    return (a[i, 0], a[i, 1], a[i, 2])


@njit(**STRICT)
def _column(a, i, j):
    return (a[i, j], a[i + 1, j], a[i + 2, j])


@njit(**STRICT)
def _vec(a, i):
    return (a[i], a[i + 1], a[i + 2])


@njit(**STRICT)
def _plus(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@njit(**STRICT)
def _minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@njit(**STRICT)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**STRICT)
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
