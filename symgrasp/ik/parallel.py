"""The closed form of arms with three parallel joints in a row, compiled: UR3, UR5, UR10, Z1.

Six joints, or seven with one locked: joint 1, then 2, 3 and 4 parallel, then 5 and 6 whose axes meet in a
point W (or the same read backwards). The displacement of the tool from its pose at zero is

    G = e1 · e2 e3 e4 · e5 e6,     ek = rotation by qk about the line (hk, ok).

What turns about lines parallel to h2 keeps its coordinate along h2, so with O2, O3, O4 on the axes, in the
plane of W perpendicular to h2, and R24 = R2 R3 R4,

    h2 · e1⁻¹ G W = h2 · W                          joint 1: two values
    h2 · R1⁻¹ R_G h6 = h2 · R5 h6                   joint 5: two values
    R6 (R_G⁻¹ R1 h2) = R5⁻¹ h2                      joint 6
    R24 = R1⁻¹ R_G R6⁻¹ R5⁻¹                        the sum of joints 2, 3 and 4
    |e3 O4 − O2| = |e1⁻¹ G W − R24 (W − O4) − O2|   joint 3: two values, then joint 2

which are the subproblems 4, 4, 1, 1, 3 and 1 of Paden and Kahan, eight branches in all.
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
    PARALLEL_PHI,
    PARALLEL_SLACK,
    SHOULDER,
    TURN,
)
from symgrasp.ik.joints import nearest_turn, outside, sine, tool_motion, within, write_branch
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
def parallel_branches(g, joint, limits, T, inside_only, q, exists, inside):
    """Solve one pose (4, 4); see `symgrasp.ik.branches.branches_at` for arguments and result."""
    R, p = tool_motion(g, joint[7], T)
    h1, h2 = vec(g, AXES), vec(g, AXES + 3)
    base, wrist = vec(g, BASE), vec(g, MEETING)
    a = minus(plus(times(R, wrist), p), base)  # G W, seen from joint 1
    # Subproblem 4 for −q1: h2·R1⁻¹ a = sy sin(−q1) + sx cos(−q1) + part
    part = dot(h1, a) * dot(h1, h2)
    sy, sx = dot(h2, cross(h1, a)), dot(h2, a) - part
    length = math.sqrt(sy * sy + sx * sx)
    c = (dot(h2, minus(wrist, base)) - part) / length
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
        _wrist(g, joint, limits, R, seen, q1, s1, c1, 4 * i, inside_only, q, exists, inside)
    return True


@njit(**STRICT)
def _wrist(g, joint, limits, R, seen, q1, s1, c1, branch, inside_only, q, exists, inside):
    """Joints 5 and 6, and the sum of joints 2, 3 and 4, for a value of joint 1."""
    h1, h2, h5, h6 = vec(g, AXES), vec(g, AXES + 3), vec(g, AXES + 12), vec(g, AXES + 15)
    middle, length, part = vec(g, TURN)
    sm, cm = g[TURN + 3], g[TURN + 4]
    c = (dot(h2, rotate(h1, -s1, c1, times(R, h6))) - part) / length
    s = sine(c, g[PARALLEL_SLACK])
    if s < 0.0:
        return
    before = transposed_times(R, rotate(h1, s1, c1, h2))  # R_G⁻¹ R1 h2
    side = perpendicular(h2)
    for i in range(2):
        way = s if i == 0 else -s
        s5, c5 = sm * c + cm * way, cm * c - sm * way
        if inside_only and outside(limits, joint[4], s5, c5):
            continue
        q5 = nearest_turn(limits, joint[4], middle + math.atan2(way, c))
        if inside_only and not within(limits, joint[4], q5):
            continue
        y6, x6 = subproblem1(h6, before, rotate(h5, -s5, c5, h2))
        s6, c6 = unit(y6, x6)
        if inside_only and outside(limits, joint[5], s6, c6):
            continue
        q6 = nearest_turn(limits, joint[5], math.atan2(y6, x6))
        if inside_only and not within(limits, joint[5], q6):
            continue
        turned = rotate(h1, -s1, c1, times(R, rotate(h6, -s6, c6, rotate(h5, -s5, c5, side))))
        y, x = subproblem1(h2, side, turned)
        sum_s, sum_c = unit(y, x)
        t = minus(minus(seen, rotate(h2, sum_s, sum_c, vec(g, HAND))), vec(g, SHOULDER))
        total = math.atan2(y, x)
        _elbow(g, joint, limits, t, total, q1, q5, q6, branch + 2 * i, inside_only, q, exists, inside)


@njit(**STRICT)
def _elbow(g, joint, limits, t, total, q1, q5, q6, branch, inside_only, q, exists, inside):
    """Subproblem 3: |R3 (O4 − O3) − (O2 − O3)| = |t| gives joint 3, then joints 2 and 4; write the branch."""
    h2, h3, h4 = vec(g, AXES + 3), vec(g, AXES + 6), vec(g, AXES + 9)
    middle, length, part = vec(g, BEND)
    sm, cm = g[BEND + 3], g[BEND + 4]
    c = (-0.5 * dot(t, t) - part) / length
    s = sine(c, g[PARALLEL_SLACK])
    if s < 0.0:
        return
    from_shoulder = minus(vec(g, ELBOW), vec(g, SHOULDER))
    for i in range(2):
        way = s if i == 0 else -s
        s3, c3 = sm * c + cm * way, cm * c - sm * way
        if inside_only and outside(limits, joint[2], s3, c3):
            continue
        y2, x2 = subproblem1(h2, plus(rotate(h3, s3, c3, vec(g, FOREARM)), from_shoulder), t)
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
