"""Solving at any value of the redundancy, not only at a solver's own samples."""

from __future__ import annotations

import copy

from symgrasp.ik import ArmIK, Solutions
from symgrasp.poses import Array


def solve_at(ik: ArmIK, T_base_tool: Array, phi: float) -> Solutions:
    """Return every configuration that reaches a pose (4, 4) with the locked joint at ``phi`` (rad).

    Asked of a solver of the same kind for an arm whose locked joint can take that value only; the
    solutions have the limits of the true arm.
    """
    arm = copy.copy(ik.arm)
    arm.lower, arm.upper = arm.lower.copy(), arm.upper.copy()
    if ik.locked is not None:
        arm.lower[ik.locked] = arm.upper[ik.locked] = phi
    found = type(ik)(arm, 1).solve(T_base_tool)
    q, inside = ik.arm.within_limits(found.q)
    return Solutions(q, found.sample, found.branch, inside)
