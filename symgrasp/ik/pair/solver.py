"""Arms of which the axes of the last two joints meet, compiled: Baxter, G1, Gen3, xArm and most others.

Six joints, or seven with one locked; the axes of joints 5 and 6 meet in a point W (or the same read
backwards). The displacement of the tool from its pose at zero is

    G = e1 e2 e3 e4 e5 e6,     ek = rotation by qk about the line (hk, ok),

so that with p = G W and m = R_G h6

    e2 e3 z(q4) = w(q1),                    z = e4 W,  w = e1⁻¹ p
    m(q1) · R2 R3 d(q4) = h5 · h6,          d = R4 h5,  R1 m(q1) = m.

For a value of q1 the first equation is one of three joints that reach a point. With the feet of the common
normal n of axes 2 and 3 as origins of w and z, a its length and α the angle of the axes,

    P = (|w|² − |z|² − a²) / 2a,   Q = (h2·w − cos α h3·z) / sin α,   P² + Q² = |z|² − (h3·z)²

for the coordinates P and Q of R3 z along n and h3 × n: a polynomial of degree 4 in b = exp(i q4) (D. L.
Pieper, The Kinematics of Manipulators under Computer Control, 1968); where axes 2 and 3 meet or are parallel,
two of degree 2. Where they are nearly parallel, the feet are far away and the digits are lost in distances
from there: then n leads from a point of axis 2 to what is nearest to it on axis 3, h2·n is not 0, and

    sin α Q = h2·w − a (h2·n) − cos α h3·z − (h2·n) P,   sin α = h2·(h3 × n),   cos α = h2·h3.

Its four complex roots give four residuals r of the second equation. Their product, times
ρ⁴ K for the poles at which q2 or q3 is infinite,

    N(q1) = ρ⁴ K r₁ r₂ r₃ r₄,   ρ² = |w|² − (h2·w)²,   K = |Res_b(z·n + i z·(h3 × n), P − i Q)|²,

is a trigonometric polynomial of degree 8, the number of solutions of a general arm being 16. Its real zeros
are found from 17 values (`symgrasp.ik.pair.zeros`); a solution is where one of the residuals vanishes, and
Newton's method on the arm itself ends each. Where N is faint, as between solutions that all but coincide, it
is found from other values, there: with ``tan((q1 − c) / 2) = s tan(θ / 2)`` for a centre c and a stretch s,
``N (cos²(θ/2) + s² sin²(θ/2))⁸`` is such a polynomial of θ, too.

Where z does not depend on q4 (a wrist whose axes meet), q1 and q4 change their parts: what is called outer
below is q4, and inner q1.
"""

from __future__ import annotations

from symgrasp.compiling import njit
from symgrasp.ik.joints import is_known, misses, nearest_turn, settle, spread_in, tool_motion
from symgrasp.ik.newton import polish_in
from symgrasp.ik.pair.geometry import PAIR_PHI, SHIFTED
from symgrasp.ik.pair.polynomial import equations_of, may_reach
from symgrasp.ik.pair.zeros import search_turn
from symgrasp.ik.self_motion import CLOSE, PULLS, barely_into_limits, family_into_limits, into_limits
from symgrasp.ik.vectors import STRICT

__all__ = ["PAIR_BRANCHES", "pair_branches"]

PAIR_BRANCHES = 16
"""Configurations of a pose and a redundancy value, at most."""

MORE_STARTS, MORE_STEPS = 24, 20
"""Joint values all over the range from which a singular pose is sought where nothing else leads inside the
limits, and steps from each."""

SAME = 1e-7
"""Largest difference (rad) of the joints of configurations that count as one."""


@njit(**STRICT)
def pair_branches(chain, k, T, inside_only, q, exists, inside, memory):
    """Solve one pose (4, 4); see `symgrasp.ik.branches.branches_at` for arguments and result.

    Unlike the closed forms, it checks itself that a configuration reaches the pose.
    """
    g = chain.geometry[k]
    R, p = tool_motion(g, chain.joint[7], T)
    equations = equations_of(g, R, p)
    if not may_reach(equations):
        return False
    memory.counts[0] = memory.counts[1] = 0
    memory.free[1] = g[SHIFTED]
    search_turn(chain, g, R, equations, memory, 0)
    # What is found inside the limits, and where, does not depend on what is searched outside.
    singular, own = memory.free[1] != 0.0, memory.counts[1]
    found, inner = _add_branches(chain, T, q, exists, inside, memory, (0, 0, memory.counts[0]), 0, singular)
    if singular or not inside_only:
        found, moved = _add_branches(chain, T, q, exists, inside, memory, (1, 0, own), found, singular)
        if singular and not (inner or moved) and found < q.shape[0]:
            found = _search_everywhere(chain, g, T, q, exists, inside, memory, found)
    if not inside_only:
        search_turn(chain, g, R, equations, memory, 1)
        starts = 1, own, memory.counts[1]
        found, _ = _add_branches(chain, T, q, exists, inside, memory, starts, found, False)
    return found > 0 or inside_only


@njit(**STRICT)
def _add_branches(chain, T, q, exists, inside, memory, starts, found, singular):
    """Add the configurations to which starts lead.

    Args:
        chain, T, q, exists, inside, memory: see `symgrasp.ik.branches.branches_at`.
        starts: which list of starts, the first of them, and the one after the last.
        found: how many configurations there are.
        singular: whether to move those into the limits that are outside.

    Returns:
        How many there are now, and whether one of those added is inside the limits.
    """
    beyond, first, last = starts
    reached = False
    for i in range(first, last):
        if found == q.shape[0]:
            break
        row, start = q[found], memory.starts[beyond, i]
        for j in range(row.shape[0]):
            row[j] = start[j]
        reaches = polish_in(chain.forward, chain.fixed, row, T, memory.J, memory.A)
        fits = reaches and settle(chain.limits, row) and not beyond
        if reaches and not (fits or beyond):
            fits = barely_into_limits(chain, row, T, memory)
        if singular and not fits:
            for j in range(row.shape[0]):
                memory.row[j] = start[j]
            if into_limits(chain, memory.row, T, PULLS, CLOSE, memory.J, memory.A):
                reaches = fits = True
                for j in range(row.shape[0]):
                    row[j] = memory.row[j]
            elif family_into_limits(chain, row, T, memory.q, memory.J, memory.A):
                reaches = fits = True
        if not reaches or misses(chain.forward, row, T) or is_known(q, 0, found, SAME):
            continue
        exists[found], inside[found] = True, fits
        found += 1
        reached |= fits
    return found, reached


@njit(**STRICT)
def _search_everywhere(chain, g, T, q, exists, inside, memory, found):
    """Look for a configuration inside the limits from joint values all over; return how many there are."""
    for i in range(MORE_STARTS):
        row = memory.row
        spread_in(chain.limits, i, row)
        if chain.joint[6] >= 0:
            row[chain.joint[6]] = nearest_turn(chain.limits, chain.joint[6], g[PAIR_PHI])
        if into_limits(chain, row, T, MORE_STEPS, CLOSE, memory.J, memory.A):
            for j in range(row.shape[0]):
                q[found, j] = row[j]
            exists[found] = inside[found] = True
            return found + 1
    return found
