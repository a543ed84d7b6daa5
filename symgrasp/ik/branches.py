"""Compiled closed forms: all inverse-kinematics branches at a tool pose and a redundancy value.

Each branch is computed by itself, in plain IEEE arithmetic: the answer at a pose and a redundancy value
does not depend on what else is asked.
"""

from __future__ import annotations

from symgrasp.compiling import njit
from symgrasp.ik.chain import THREE_PARALLEL
from symgrasp.ik.joints import misses
from symgrasp.ik.parallel import parallel_branches
from symgrasp.ik.spherical import spherical_branches
from symgrasp.ik.vectors import STRICT

__all__ = ["BRANCHES", "branches_at", "solve_range"]

BRANCHES = 8
"""Branches of every closed form here: three times two values."""


@njit(cache=True, error_model="numpy")
def solve_range(geometry, joint, limits, forward, T, first, last, q, exists, inside):
    """Solve a pose T (4, 4) at the redundancy values from first to before last; see `branches_at`."""
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
        inside_only: leave out branches outside the limits as early as possible; those that remain are
            bit for bit the same.
        q: (BRANCHES, n) receives the joint values.
        exists: (BRANCHES,) receives which branches reach the pose.
        inside: (BRANCHES,) receives which branches reach it inside the limits.

    Returns:
        False where the first equation of the closed form has no solution, limits or not, so that no branch
        reaches the pose.
    """
    for b in range(BRANCHES):
        exists[b] = False
        inside[b] = False
    if joint[8] == THREE_PARALLEL:
        solvable = parallel_branches(geometry[k], joint, limits, T, inside_only, q, exists, inside)
    else:
        solvable = spherical_branches(geometry[k], joint, limits, T, inside_only, q, exists, inside)
    for b in range(BRANCHES):
        if exists[b] and misses(forward, q[b], T):
            exists[b] = False
            inside[b] = False
    return solvable
