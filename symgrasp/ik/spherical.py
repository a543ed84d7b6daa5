"""Closed-form inverse kinematics of arms with a spherical triple of joints, compiled by numba.

With one joint locked (or with six joints), many arms have three joints whose axes meet in a point S at
one end, one joint in the middle, and two joints whose axes meet in a point W at the other end: Panda,
iiwa, PR2, TALOS, TIAGo. Numbered from the end with the triple (an arm with a spherical wrist is read
backwards, ``G⁻¹ = e6⁻¹ … e1⁻¹``), the displacement of the tool from its pose at zero is

    G = e1 e2 e3 · e4 · e5 e6,     ek = rotation by qk about the line (hk, ok),

    |G⁻¹ S − W| = |e4⁻¹ S − W|                     the middle joint: two values
    R5⁻¹ (e4⁻¹ S − W) = R6 (G⁻¹ S − W)             the pair: two values
    R1 R2 R3 = R_G R6⁻¹ R5⁻¹ R4⁻¹                  the triple: two values

which are the subproblems 3, 2 and 4 of Paden and Kahan, eight branches in all. Each branch is
computed by itself, in plain IEEE arithmetic: the answer at a pose and a redundancy value does not
depend on what else is asked.
"""

from __future__ import annotations

import numpy as np

from symgrasp.ik.branches import BRANCHES, solve_range
from symgrasp.ik.chain import COSINE_TOLERANCE, Chain, chain_geometries
from symgrasp.ik.closed_form import ClosedFormIK, Solutions, Tolerance
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["SphericalIK"]


class SphericalIK(ClosedFormIK):
    """`ClosedFormIK` for arms with a spherical triple, compiled: the same solutions, much faster.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        tolerance: largest error of a solution.

    Raises:
        UrdfError: no closed form is known for the arm, whichever joint is locked.
        ValueError: a closed form is known, but it is not of this family; see `fits`.

    Attributes:
        chain: the arm's geometry at every redundancy sample, for compiled code.
    """

    def __init__(self, arm: Arm, samples: int, tolerance: Tolerance | None = None) -> None:
        super().__init__(arm, samples, tolerance)
        self.chain = self._pack_chain()

    @staticmethod
    def fits(ik: ClosedFormIK) -> bool:
        """Whether an arm has a spherical triple and a pair, with the joint locked that its solver locks."""
        return chain_geometries(ik.arm, ik.locked, ik.phi) is not None

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), at every redundancy sample."""
        return self._solve(T_base_tool, 0, len(self.phi))

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""
        found = self._solve(T_base_tool, sample, sample + 1)
        return found._replace(sample=np.zeros_like(found.sample))

    def _solve(self, T_base_tool: Array, first: int, last: int) -> Solutions:
        """Return the solutions of a pose (4, 4) at the redundancy samples from first to before last."""
        T = np.ascontiguousarray(T_base_tool, dtype=float)
        # The compiled code fills arrays made here: a Ctrl-C while numba wraps up results would crash.
        q = np.empty((last - first, BRANCHES, self.arm.dof))
        exists, inside = np.empty(q.shape[:-1], dtype=bool), np.empty(q.shape[:-1], dtype=bool)
        solve_range(*self.chain, T, first, last, q, exists, inside)
        sample, branch = np.nonzero(exists)
        return Solutions(q[exists], sample + first, branch, inside[exists])

    def _pack_chain(self) -> Chain:
        """Pack the arm's geometry at every redundancy sample into arrays."""
        arm = self.arm
        rows = chain_geometries(arm, self.locked, self.phi)
        if rows is None:
            raise ValueError(f"{arm.name}: no spherical triple and pair of joints that meet")
        locked = -1 if self.locked is None else self.locked
        free = [j for j in range(arm.dof) if j != locked]
        backwards = rows[0].backwards
        bounded = np.isfinite(arm.lower) & np.isfinite(arm.upper)
        lower, upper = np.where(bounded, arm.lower, -np.pi), np.where(bounded, arm.upper, np.pi)
        middle = 0.5 * (lower + upper)
        half = np.minimum(0.5 * (upper - lower), np.pi)
        least = np.cos(half) - COSINE_TOLERANCE
        tolerance = [self.tolerance.position, self.tolerance.rotation, 0.0]
        return Chain(
            geometry=np.array([np.concatenate([np.ravel(part) for part in row[1:]]) for row in rows]),
            joint=np.array([*(free[::-1] if backwards else free), locked, backwards]),
            limits=np.array([arm.lower, arm.upper, middle, np.cos(middle), np.sin(middle), least]),
            forward=np.concatenate([arm.H, arm.P, arm.R0, [tolerance]]),
        )
