"""The closed form of arms with three parallel joints in a row, compiled: UR3, UR5, UR10, Z1.

Six joints, or seven with one locked: joint 1, then 2, 3 and 4 parallel, then 5 and 6, whose axes mostly meet
in a point W (or the same read backwards). The displacement of the tool from its pose at zero is

    G = e1 · e2 e3 e4 · e5 e6,     ek = rotation by qk about the line (hk, ok).

What turns about lines parallel to h2 keeps its coordinate along h2, so with O2, O3, O4 on the axes, in the
plane of W perpendicular to h2, and R24 = R2 R3 R4,

    h2 · e1⁻¹ G W = h2 · W                          joint 1: two values
    h2 · R1⁻¹ R_G h6 = h2 · R5 h6                   joint 5: two values
    R6 (R_G⁻¹ R1 h2) = R5⁻¹ h2                      joint 6
    R24 = R1⁻¹ R_G R6⁻¹ R5⁻¹                        the sum of joints 2, 3 and 4
    |e3 O4 − O2| = |e1⁻¹ G W − R24 (W − O4) − O2|   joint 3: two values, then joint 2

which are the subproblems 4, 4, 1, 1, 3 and 1 of Paden and Kahan, eight branches in all. Where the axes of
joints 5 and 6 do not meet, W is the point of the last one that is nearest to the other, and O5 the nearest of
the other. Then the first two equations are

    h2 · (e1⁻¹ G W − O5) = h2 · R5 (W − O5),     h2 · R1⁻¹ R_G h6 = h2 · R5 h6,

linear in cosine and sine of joint 5, whose squares sum up to 1 at four values of joint 1 (subproblem 6 of
A. Elias and J. Wen, IK-Geo: Unified robot inverse kinematics using subproblem decomposition, 2025).
"""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.chain import (
    AXES,
    BASE,
    BEND,
    ELBOW,
    FOREARM,
    HAND,
    MEETING,
    OFFSET,
    PARALLEL_PHI,
    PARALLEL_SLACK,
    SHOULDER,
    SKEW,
    TURN,
)
from symgrasp.ik.joints import (
    FAMILY,
    ROOT_TOLERANCE,
    aligned_below,
    nearest_turn,
    note_blur,
    outside,
    sine,
    tool_motion,
    turn_between,
    within,
    write_branch,
)
from symgrasp.ik.roots import find_roots, size2, start_circle_quartic
from symgrasp.ik.vectors import (
    STRICT,
    cross,
    dot,
    minus,
    perpendicular,
    plus,
    rotate,
    subproblem1,
    times,
    transposed_times,
    unit,
    vec,
)

__all__ = ["parallel_branches"]


@njit(**STRICT)
def parallel_branches(g, joint, limits, T, inside_only, q, exists, inside, work, free):
    """Solve one pose (4, 4); see `symgrasp.ik.branches.branches_at` for arguments and result.

    Work is memory for nine complex numbers, free (2,) `Memory.free`.
    """
    R, p = tool_motion(g, joint[7], T)
    if g[SKEW]:
        return _skew_branches(g, joint, limits, R, p, inside_only, q, exists, inside, work, free)
    h1, h2 = vec(g, AXES), vec(g, AXES + 3)
    base, wrist = vec(g, BASE), vec(g, MEETING)
    a = minus(plus(times(R, wrist), p), base)  # G W, seen from joint 1
    # Subproblem 4 for −q1: h2·R1⁻¹ a = sy sin(−q1) + sx cos(−q1) + part
    part = dot(h1, a) * dot(h1, h2)
    sy, sx = dot(h2, cross(h1, a)), dot(h2, a) - part
    length = math.sqrt(sy * sy + sx * sx)
    aligned, needed = aligned_below(g[PARALLEL_SLACK]), dot(h2, minus(wrist, base)) - part
    if length < aligned and abs(needed) < aligned:  # W is on the axis of joint 1, wherever that turns
        free[1] = FAMILY
        if not math.isnan(free[0]):
            sy, sx, length, needed = math.sin(free[0]), math.cos(free[0]), 1.0, 1.0
    c = needed / length
    s = sine(c, g[PARALLEL_SLACK])
    if not s >= 0.0:
        return False
    sm, cm = sy / length, sx / length
    for i in range(2):
        way = s if i == 0 else -s
        s1, c1 = -(sm * c + cm * way), cm * c - sm * way
        if inside_only and outside(limits, joint[0], s1, c1):
            continue
        q1 = nearest_turn(limits, joint[0], math.atan2(s1, c1))
        if inside_only and not within(limits, joint[0], q1):
            continue
        seen = plus(rotate(h1, -s1, c1, a), base)  # e1⁻¹ G W
        _wrist(g, joint, limits, R, seen, q1, s1, c1, 4 * i, inside_only, q, exists, inside, free)
    return True


@njit(**STRICT)
def _wrist(g, joint, limits, R, seen, q1, s1, c1, branch, inside_only, q, exists, inside, free):
    """Joint 5, then the others, for a value of joint 1."""
    h1, h2, h6 = vec(g, AXES), vec(g, AXES + 3), vec(g, AXES + 15)
    middle, length, part = vec(g, TURN)
    sm, cm = g[TURN + 3], g[TURN + 4]
    c = (dot(h2, rotate(h1, -s1, c1, times(R, h6))) - part) / length
    s = sine(c, g[PARALLEL_SLACK])
    if s < 0.0:
        return
    for i in range(2):
        way = s if i == 0 else -s
        s5, c5 = sm * c + cm * way, cm * c - sm * way
        if inside_only and outside(limits, joint[4], s5, c5):
            continue
        q5 = nearest_turn(limits, joint[4], middle + math.atan2(way, c))
        if inside_only and not within(limits, joint[4], q5):
            continue
        _hand(
            g, joint, limits, R, seen, q1, s1, c1, q5, s5, c5, branch + 2 * i, inside_only, q, exists,
            inside, free,
        )  # fmt: skip


@njit(**STRICT)
def _skew_branches(g, joint, limits, R, p, inside_only, q, exists, inside, work, free):
    """Joints 1 and 5 where the axes of joints 5 and 6 do not meet, then the others."""
    h1, h2, base, o5 = vec(g, AXES), vec(g, AXES + 3), vec(g, BASE), minus(vec(g, MEETING), vec(g, OFFSET))
    a, v = minus(plus(times(R, vec(g, MEETING)), p), base), times(R, vec(g, AXES + 15))
    part_a, part_v = dot(h1, a) * dot(h1, h2), dot(h1, v) * dot(h1, h2)
    # The parts along h2 that joint 5 has to make, as 1, cos q1 and sin q1.
    f = (part_a + dot(h2, minus(base, o5)) - g[SKEW + 1], dot(h2, a) - part_a, -dot(h2, cross(h1, a)))
    e = (part_v - g[SKEW + 2], dot(h2, v) - part_v, -dot(h2, cross(h1, v)))
    c0, c1, c2 = _combined(g[SKEW + 3], f, g[SKEW + 4], e)
    s0, s1, s2 = _combined(g[SKEW + 5], f, g[SKEW + 6], e)
    c, s = complex(0.5 * c1, -0.5 * c2), complex(0.5 * s1, -0.5 * s2)
    work[4], work[3] = c * c + s * s, 2.0 * (c0 * c + s0 * s)
    work[2] = c0 * c0 + s0 * s0 - 1.0 + 2.0 * (size2(c) + size2(s)) + 0.0j
    work[1], work[0] = work[3].conjugate(), work[4].conjugate()
    start_circle_quartic(work, 0, 5)
    find_roots(work, 0, 4, work[5:9])
    off = 2.0 * math.sqrt(ROOT_TOLERANCE + g[PARALLEL_SLACK])
    solvable = False
    for i in range(4):
        b = work[5 + i]
        if not abs(size2(b) - 1.0) < off:
            continue
        solvable = True
        # Two that all but coincide may be beside the circle: each starts on its own side.
        q1 = math.atan2(b.imag, b.real) + 0.5 * (size2(b) - 1.0)
        sin1, cos1 = math.sin(q1), math.cos(q1)
        q1 = nearest_turn(limits, joint[0], q1)
        if inside_only and not within(limits, joint[0], q1):
            continue
        sin5, cos5 = unit(s0 + s1 * cos1 + s2 * sin1, c0 + c1 * cos1 + c2 * sin1)
        q5 = nearest_turn(limits, joint[4], math.atan2(sin5, cos5))
        if inside_only and not within(limits, joint[4], q5):
            continue
        seen = plus(rotate(h1, -sin1, cos1, a), base)
        _hand(
            g, joint, limits, R, seen, q1, sin1, cos1, q5, sin5, cos5, 2 * i, inside_only, q, exists,
            inside, free,
        )  # fmt: skip
    return solvable


@njit(**STRICT)
def _combined(x, v, y, w):
    """Return x v + y w."""
    return x * v[0] + y * w[0], x * v[1] + y * w[1], x * v[2] + y * w[2]


@njit(**STRICT)
def _hand(g, joint, limits, R, seen, q1, s1, c1, q5, s5, c5, branch, inside_only, q, exists, inside, free):
    """Joint 6 and the sum of joints 2, 3 and 4, for values of joints 1 and 5."""
    h1, h2, h5, h6 = vec(g, AXES), vec(g, AXES + 3), vec(g, AXES + 12), vec(g, AXES + 15)
    before = transposed_times(R, rotate(h1, s1, c1, h2))  # R_G⁻¹ R1 h2
    y6, x6 = turn_between(h6, before, rotate(h5, -s5, c5, h2), aligned_below(g[PARALLEL_SLACK]), free)
    s6, c6 = unit(y6, x6)
    if inside_only and outside(limits, joint[5], s6, c6):
        return
    q6 = nearest_turn(limits, joint[5], math.atan2(y6, x6))
    if inside_only and not within(limits, joint[5], q6):
        return
    side = perpendicular(h2)
    turned = rotate(h1, -s1, c1, times(R, rotate(h6, -s6, c6, rotate(h5, -s5, c5, side))))
    y, x = subproblem1(h2, side, turned)
    sum_s, sum_c = unit(y, x)
    reach = plus(vec(g, HAND), rotate(h5, s5, c5, vec(g, OFFSET)))
    t = minus(minus(seen, rotate(h2, sum_s, sum_c, reach)), vec(g, SHOULDER))
    _elbow(g, joint, limits, t, math.atan2(y, x), q1, q5, q6, branch, inside_only, q, exists, inside, free)


@njit(**STRICT)
def _elbow(g, joint, limits, t, total, q1, q5, q6, branch, inside_only, q, exists, inside, free):
    """Subproblem 3: |R3 (O4 − O3) − (O2 − O3)| = |t| gives joint 3, then joints 2 and 4; write the branch."""
    h2, h3, h4 = vec(g, AXES + 3), vec(g, AXES + 6), vec(g, AXES + 9)
    middle, length, part = vec(g, BEND)
    sm, cm = g[BEND + 3], g[BEND + 4]
    c = (-0.5 * dot(t, t) - part) / length
    s = sine(c, g[PARALLEL_SLACK])
    if s < 0.0:
        if math.isnan(free[0]):
            return
        c, s = math.copysign(1.0, c), 0.0  # the nearest; see `turn_between`
    aligned = aligned_below(g[PARALLEL_SLACK])
    note_blur(s * s, g[PARALLEL_SLACK], free)
    from_shoulder = minus(vec(g, ELBOW), vec(g, SHOULDER))
    for i in range(2):
        way = s if i == 0 else -s
        s3, c3 = sm * c + cm * way, cm * c - sm * way
        if inside_only and outside(limits, joint[2], s3, c3):
            continue
        elbow_out = plus(rotate(h3, s3, c3, vec(g, FOREARM)), from_shoulder)
        y2, x2 = turn_between(h2, elbow_out, t, aligned, free)
        angle2, angle3 = math.atan2(y2, x2), middle + math.atan2(way, c)
        # h3 and h4 may point against h2.
        angle4 = dot(h2, h4) * (total - angle2 - dot(h2, h3) * angle3)
        q2 = nearest_turn(limits, joint[1], angle2)
        if inside_only and not within(limits, joint[1], q2):
            continue
        q3 = nearest_turn(limits, joint[2], angle3)
        if inside_only and not within(limits, joint[2], q3):
            continue
        q4 = nearest_turn(limits, joint[3], angle4)
        if inside_only and not within(limits, joint[3], q4):
            continue
        values = (q1, q2, q3, q4, q5, q6)
        inside[branch + i] = write_branch(joint, limits, g[PARALLEL_PHI], values, q[branch + i])
        exists[branch + i] = True
