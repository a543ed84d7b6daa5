"""The closed form of arms with a spherical triple of joints, compiled: Panda, iiwa, PR2, TALOS, TIAGo.

Six joints, or seven with one locked: the axes of three meet in a point S at one end, one joint is in the
middle, and the axes of two meet in a point W at the other end. Numbered from the end with the triple (an
arm with a spherical wrist is read backwards, ``G⁻¹ = e6⁻¹ … e1⁻¹``), the displacement of the tool from its
pose at zero is

    G = e1 e2 e3 · e4 · e5 e6,     ek = rotation by qk about the line (hk, ok),

    |G⁻¹ S − W| = |e4⁻¹ S − W|                     the middle joint: two values
    R5⁻¹ (e4⁻¹ S − W) = R6 (G⁻¹ S − W)             the pair: two values
    R1 R2 R3 = R_G R6⁻¹ R5⁻¹ R4⁻¹                  the triple: two values

which are the subproblems 3, 2 and 4 of Paden and Kahan, eight branches in all.
"""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.chain import AXES, CENTRE, CENTRE_SEEN, MIDDLE, P0, PHI, R0, SLACK, TRIPLE, WRIST, WRIST_SEEN
from symgrasp.ik.joints import (
    ROOT_TOLERANCE,
    aligned_below,
    miss,
    nearest_turn,
    note_blur,
    outside,
    sine,
    tool_motion,
    turn_between,
    within,
    write_branch,
)
from symgrasp.ik.vectors import (
    STRICT,
    column,
    cross,
    dot,
    minus,
    perpendicular,
    plus,
    rotate,
    row,
    subproblem1,
    times,
    transposed_times,
    unit,
    vec,
)

__all__ = ["reach", "spherical_branches"]

CERTAIN = 1e-7
"""A cosine, or the square of a sine, that is beyond a limit by this is so however it was computed."""


@njit(**STRICT)
def spherical_branches(g, joint, limits, T, inside_only, q, exists, inside, missing, free):
    """Solve one pose (4, 4); see `symgrasp.ik.branches.branches_at` for arguments and result.

    Missing (B,) is `Memory.missing`, free (2,) `Memory.free`.
    """
    if inside_only:
        sure, reaches = _sure_reach(g, joint, limits, T)
        if sure:
            return reaches
    R, t, c = reach(g, joint, T)
    a = vec(g, CENTRE_SEEN)
    # Where possible sines and cosines are computed without their angles: most branches are dropped at a joint
    # limit before an angle is needed.
    middle, sm, cm = g[MIDDLE], g[MIDDLE + 3], g[MIDDLE + 4]
    s = sine(c, g[SLACK])
    if s < 0.0:
        miss(missing, 0, 8, 1, 1.0 - c * c)
        return False
    note_blur(s * s, g[SLACK], free)
    offset = math.atan2(s, c)
    for i in range(2):
        if i == 0:
            q4, s4, c4 = -(middle + offset), -(sm * c + cm * s), cm * c - sm * s
        else:
            q4, s4, c4 = offset - middle, s * cm - c * sm, cm * c + sm * s
        if inside_only and outside(limits, joint[3], s4, c4):
            continue
        q4 = nearest_turn(limits, joint[3], q4)
        if inside_only and not within(limits, joint[3], q4):
            continue
        u = minus(rotate(vec(g, AXES + 9), -s4, c4, a), vec(g, WRIST_SEEN))  # e4⁻¹ S − W
        _pair(g, joint, limits, R, t, u, q4, s4, c4, i, inside_only, q, exists, inside, missing, free)
    return True


@njit(**STRICT)
def reach(g, joint, T):
    """Subproblem 3, |R4⁻¹ a − b| = |t|: return R_G, t = G⁻¹ S − W, and the cosine that joint 4 needs.

    Beyond ±1 the pose (4, 4) is out of reach.
    """
    R, p = tool_motion(g, joint[7], T)
    t = minus(transposed_times(R, minus(vec(g, CENTRE), p)), vec(g, WRIST))
    return R, t, (-0.5 * dot(t, t) - g[MIDDLE + 2]) / g[MIDDLE + 1]


@njit(**STRICT)
def _sure_reach(g, joint, limits, T):
    """Decide from the distance |t| alone, without R_G, whether joint 4 is out of reach or outside its limits.

    With T = G T0, T = (R, p) and T0 = (R0, p0) it is ``|Rᵀ (S − p) + R0ᵀ (p0 − W)|``, or of an arm that is
    read backwards ``|R R0ᵀ (S − p0) + p − W|``.

    Returns:
        Whether it is certain, whatever the rounding, that no branch is inside the limits; and if so,
        whether one is in reach.
    """
    R0T = (_third(g, R0), _third(g, R0 + 1), _third(g, R0 + 2))
    p0, S, W, p = vec(g, P0), vec(g, CENTRE), vec(g, WRIST), column(T, 0, 3)
    if joint[7]:
        x, y = times(R0T, minus(S, p0)), minus(p, W)
        t = plus((dot(row(T, 0), x), dot(row(T, 1), x), dot(row(T, 2), x)), y)
    else:
        x, y = minus(S, p), times(R0T, minus(p0, W))
        t = plus((dot(column(T, 0, 0), x), dot(column(T, 0, 1), x), dot(column(T, 0, 2), x)), y)
    c = (-0.5 * dot(t, t) - g[MIDDLE + 2]) / g[MIDDLE + 1]
    rest = 1.0 - c * c
    if rest < -(CERTAIN + g[SLACK]):
        return True, False
    if rest < CERTAIN + g[SLACK]:
        return False, False
    s, sm, cm = math.sqrt(rest), g[MIDDLE + 3], g[MIDDLE + 4]
    one = (cm * c - sm * s) * limits[3, joint[3]] - (sm * c + cm * s) * limits[4, joint[3]]
    other = (cm * c + sm * s) * limits[3, joint[3]] + (s * cm - c * sm) * limits[4, joint[3]]
    return max(one, other) < limits[5, joint[3]] - CERTAIN, True


@njit(**STRICT)
def _third(g, i):
    """Return every third of nine entries of a vector, from i on: a column of a matrix."""
    return (g[i], g[i + 3], g[i + 6])


@njit(**STRICT)
def _pair(g, joint, limits, R, t, u, q4, s4, c4, i, inside_only, q, exists, inside, missing, free):
    """Subproblem 2: R5⁻¹ u = R6 t gives q5 and q6 for a value of the middle joint."""
    h4, h5, h6 = vec(g, AXES + 9), vec(g, AXES + 12), vec(g, AXES + 15)
    c = dot(h5, h6)
    across = 1.0 - c * c
    along5, along6 = dot(h5, u), dot(h6, t)
    alpha = (along5 - c * along6) / across
    beta = (along6 - c * along5) / across
    rest = (dot(u, u) - alpha * alpha - beta * beta - 2.0 * alpha * beta * c) / across
    slack = g[SLACK] * dot(u, u)
    if rest < -(ROOT_TOLERANCE + slack):
        miss(missing, 4 * i, 4, 2, rest / dot(u, u))
        return
    gamma = math.sqrt(max(rest, slack))
    aligned = aligned_below(g[SLACK])
    normal = cross(h5, h6)
    h3 = vec(g, AXES + 6)
    side = perpendicular(h3)
    v3, vside = rotate(h4, -s4, c4, h3), rotate(h4, -s4, c4, side)
    for j in range(2):
        out = gamma if j == 0 else -gamma
        z = (
            alpha * h5[0] + beta * h6[0] + out * normal[0],
            alpha * h5[1] + beta * h6[1] + out * normal[1],
            alpha * h5[2] + beta * h6[2] + out * normal[2],
        )
        y6, x6 = turn_between(h6, t, z, aligned, free)
        s6, c6 = unit(y6, x6)
        if inside_only and outside(limits, joint[5], s6, c6):
            continue
        y5, x5 = turn_between(h5, z, u, aligned, free)
        s5, c5 = unit(y5, x5)
        if inside_only and outside(limits, joint[4], s5, c5):
            continue
        q6 = nearest_turn(limits, joint[5], math.atan2(y6, x6))
        if inside_only and not within(limits, joint[5], q6):
            continue
        q5 = nearest_turn(limits, joint[4], math.atan2(y5, x5))
        if inside_only and not within(limits, joint[4], q5):
            continue
        # M = R_G R6⁻¹ R5⁻¹ R4⁻¹, applied to h3 and to a vector perpendicular to it
        M3 = times(R, rotate(h6, -s6, c6, rotate(h5, -s5, c5, v3)))
        Mside = times(R, rotate(h6, -s6, c6, rotate(h5, -s5, c5, vside)))
        branch = 4 * i + 2 * j
        _triple(
            g, joint, limits, M3, Mside, side, q4, q5, q6, branch, inside_only, q, exists, inside, missing,
            free,
        )  # fmt: skip


@njit(**STRICT)
def _triple(
    g, joint, limits, M3, Mside, side, q4, q5, q6, branch, inside_only, q, exists, inside, missing, free
):
    """Subproblem 4: R1 R2 R3 = M, so h1ᵀ R2 h3 = h1ᵀ M h3, gives q1, q2 and q3; write the branch."""
    h1, h2, h3 = vec(g, AXES), vec(g, AXES + 3), vec(g, AXES + 6)
    middle, length, part = vec(g, TRIPLE)
    sm, cm = g[TRIPLE + 3], g[TRIPLE + 4]
    c = (dot(h1, M3) - part) / length
    s = sine(c, g[SLACK])
    if s < 0.0:
        if math.isnan(free[0]):
            miss(missing, branch, 2, 3, 1.0 - c * c)
            return
        c, s = math.copysign(1.0, c), 0.0  # the nearest; see `turn_between`
    aligned = aligned_below(g[SLACK])
    note_blur(s * s, g[SLACK], free)
    for i in range(2):
        way = s if i == 0 else -s
        s2, c2 = sm * c + cm * way, cm * c - sm * way
        if inside_only and outside(limits, joint[1], s2, c2):
            continue
        y1, x1 = turn_between(h1, rotate(h2, s2, c2, h3), M3, aligned, free)
        s1, c1 = unit(y1, x1)
        if inside_only and outside(limits, joint[0], s1, c1):
            continue
        # q3 from R2⁻¹ R1⁻¹ M with the q1 found: where h1 and h3 align, q3 compensates for any q1.
        y3, x3 = subproblem1(h3, side, rotate(h2, -s2, c2, rotate(h1, -s1, c1, Mside)))
        q2 = nearest_turn(limits, joint[1], middle + math.atan2(way, c))
        if inside_only and not within(limits, joint[1], q2):
            continue
        q1 = nearest_turn(limits, joint[0], math.atan2(y1, x1))
        if inside_only and not within(limits, joint[0], q1):
            continue
        q3 = nearest_turn(limits, joint[2], math.atan2(y3, x3))
        if inside_only and not within(limits, joint[2], q3):
            continue
        inside[branch + i] = write_branch(joint, limits, g[PHI], (q1, q2, q3, q4, q5, q6), q[branch + i])
        exists[branch + i] = True
