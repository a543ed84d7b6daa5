"""Self-motion of an arm at a singular pose: moving joints into their limits while the tool stays. Compiled.

At a singular pose the joints that move the tool nowhere have a combination along which they turn freely. The
steps are those of Newton's method (`symgrasp.ik.newton`) with an equation for each joint outside its limits
that moves it onto the limit, of so little weight w that it only counts along such combinations:

    dq = (Jᵀ J + w² D + μ I)⁻¹ (Jᵀ e + w² D r),

with D = diag(1 where a joint is outside, else 0) and r the way back to the limits. At other poses the joints
stay where they are, up to about w².
"""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.joints import onto_limits, settle
from symgrasp.ik.newton import (
    LEAST_DAMPING,
    POLISHED,
    linearise,
    normal_equations,
    polish_in,
    solve_normal,
)
from symgrasp.ik.vectors import STRICT

__all__ = [
    "BARELY",
    "CLOSE",
    "PULLS",
    "VERY_CLOSE",
    "barely_into_limits",
    "family_into_limits",
    "find_free_way",
    "into_limits",
]

WEIGHT2 = 1e-6
"""Square of the weight w (m/rad, or none)."""

DAMPING = 1e-13
"""Least damping μ, far below w², so that joints reach their limits up to 1e-7 of the way in one step; further
from the pose it is |e|²."""

NEAR = 1e-3
"""Error (m and rad) of the tool up to which it is told whether there is a way back to the limits."""

LARGEST_STEP = 0.5
"""Largest way back (rad) in one step: families are curved."""

PULLS = 12
"""Steps, at most, of an arm whose tool is almost at the pose."""

CLOSE = 1e-7
"""Error (m and rad) of the tool that is small enough beside a singular pose, where the last digits of it
depend on joints being outside."""

VERY_CLOSE = 5e-11
"""The same where joints are off by little, so that none is moved by more."""

MEMBERS = 16
"""Members of a family, a turn of the joint that turns furthest in all, from which one inside is sought."""

SINGULAR2 = 1e-8
"""Square of the singular value (m/rad, or none) of J below which there is a family."""

BARELY = 1e-5
"""How far (rad) beyond its limits a joint may be that the rounding of a pose has put there: poses of maps are
rounded to 1e-9 rad (see `symgrasp.object.manifold`), and joints change by more beside singular poses."""

LEAST_GAIN, WAITS = 0.9, 3
"""Where the largest way back does not shrink to this share in a step, from this step on, there is none."""


@njit(**STRICT)
def into_limits(chain, q, T, steps, close, J, A):
    """Move an arm inside its limits with the tool at a pose.

    Args:
        chain: the arm.
        q: (n,) joint values (rad), changed in place.
        T: tool pose (4, 4) in the base.
        steps: steps, at most.
        close: error (m and rad) of the tool that is small enough, `CLOSE` at a singular pose.
        J, A: memory (n, 6) and (n, n + 1).

    Returns:
        Whether it is inside the limits, and the tool within `POLISHED` of the pose, or, where that leads
        outside again or is not enough, ``close``.
    """
    limits, before = chain.limits, math.inf
    for step in range(steps):
        fits = settle(limits, q)
        if fits:
            onto_limits(limits, q)
        free, move, turn, twist = linearise(chain.forward, chain.fixed, q, T, J)
        error = max(move, turn)
        if fits and (error <= min(POLISHED, close) or (step >= WAITS and error <= close)):
            return True
        furthest = 0.0
        normal_equations(J, twist, free, max(move * move + turn * turn, DAMPING), A)
        k = 0
        for j in range(q.shape[0]):
            if not chain.fixed[j]:
                back = min(max(q[j], limits[0, j]), limits[1, j]) - q[j]
                if back != 0.0:
                    furthest = max(furthest, abs(back))
                    A[k, k] += WEIGHT2
                    A[k, free] += WEIGHT2 * min(max(back, -LARGEST_STEP), LARGEST_STEP)
                k += 1
        if step >= WAITS and error < NEAR and furthest > LEAST_GAIN * before:
            return False
        before = furthest
        solve_normal(A, free)
        k = 0
        for j in range(q.shape[0]):
            if not chain.fixed[j]:
                q[j] += A[k, free]
                k += 1
    return False


@njit(**STRICT)
def barely_into_limits(chain, q, T, memory):
    """Move an arm of which joints are barely outside their limits onto them, with the tool at a pose.

    Args:
        chain: the arm.
        q: (n,) joint values (rad) at which the tool is at the pose; changed in place if they can be moved.
        T: tool pose (4, 4) in the base.
        memory: `symgrasp.ik.branches.Memory`.

    Returns:
        Whether they were: all joints are inside the limits, and the tool is within `POLISHED` of the pose.
    """
    limits, row = chain.limits, memory.row
    for j in range(q.shape[0]):
        row[j] = min(max(q[j], limits[0, j]), limits[1, j])
        if not abs(row[j] - q[j]) <= BARELY:
            return False
        memory.pinned[j] = chain.fixed[j] or row[j] != q[j]
    if not (polish_in(chain.forward, memory.pinned, row, T, memory.J, memory.A) and settle(limits, row)):
        return False
    for j in range(q.shape[0]):
        q[j] = row[j]
    return True


@njit(**STRICT)
def family_into_limits(chain, q, T, rows, J, A):
    """Look for a configuration inside the limits all along the family of one that is outside.

    The limits may be reached from one of its members where there is no straight way from another: because a
    joint has another full turn there, or the family is curved.

    Args:
        chain, T, J, A: see `into_limits`.
        q: (n,) joint values (rad) at which the tool is within `CLOSE` of the pose, or there is none; receives
            those inside the limits.
        rows: (3 or more, n) memory.

    Returns:
        Whether there is one.
    """
    member, free_way = rows[0], rows[1]
    for j in range(q.shape[0]):
        member[j], free_way[j] = q[j], 1.0 + 0.1 * j
    for _ in range(MEMBERS - 1):
        if not find_free_way(chain, member, T, free_way, SINGULAR2, J, A):
            return False
        for j in range(q.shape[0]):
            member[j] += 2.0 * math.pi / MEMBERS * free_way[j]
        polish_in(chain.forward, chain.fixed, member, T, J, A)
        trial = rows[2]
        for j in range(q.shape[0]):
            trial[j] = member[j]
        if into_limits(chain, trial, T, PULLS, CLOSE, J, A):
            for j in range(q.shape[0]):
                q[j] = trial[j]
            return True
    return False


@njit(**STRICT)
def find_free_way(chain, q, T, way, singular2, J, A):
    """Turn a way (n,) in joint space into the one that moves the tool least, of largest part 1.

    Args:
        chain, q, T, J, A: see `into_limits`.
        way: (n,) any way, receives the one.
        singular2: square of the singular value of J (m/rad, or none) below which the tool stays.

    Returns:
        Whether the tool is within `CLOSE` of the pose, and stays there.
    """
    for _ in range(2):  # inverse iteration
        free, move, turn, twist = linearise(chain.forward, chain.fixed, q, T, J)
        if not max(move, turn) <= CLOSE:
            return False
        normal_equations(J, twist, free, LEAST_DAMPING, A)
        before, k = 0.0, 0
        for j in range(q.shape[0]):
            if not chain.fixed[j]:
                A[k, free] = way[j]
                before = max(before, abs(way[j]))
                k += 1
        solve_normal(A, free)
        most, along, k = 0.0, 0.0, 0
        for j in range(q.shape[0]):
            part = 0.0
            if not chain.fixed[j]:
                part = A[k, free]
                k += 1
            along += part * way[j]
            way[j] = part
            most = max(most, abs(part))
        if not most * singular2 > before:
            return False
        for j in range(q.shape[0]):
            way[j] *= math.copysign(1.0 / most, along)
    return True
