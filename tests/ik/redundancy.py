"""Solving at any value of the redundancy, not only at a solver's own samples."""

from __future__ import annotations

import numpy as np

from symgrasp.ik import ArmIK, Solutions
from symgrasp.poses import Array


def solve_at(ik: ArmIK, T_base_tool: Array, phi: float) -> Solutions:
    """Return every configuration that reaches a pose (4, 4) with the locked joint at ``phi`` (rad)."""
    return (ik if ik.locked is None else ik.at(np.array([phi]))).solve(T_base_tool)
