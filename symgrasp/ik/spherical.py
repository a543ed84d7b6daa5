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

import numpy as np

from symgrasp.ik.branches import BRANCHES, solve_batch, solve_range
from symgrasp.ik.chain import CLEARLY, Chain, structures
from symgrasp.ik.closed_form import ClosedFormIK, Solutions, Tolerance
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["SphericalIK"]


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
        return structures(ik.arm, ik.locked, ik.phi) is not None

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
        solve_batch(*self.chain, T, *found)
        return found

    def _solve(self, chain: Chain, T_base_tool: Array, first: int, last: int) -> Solutions:
        T = np.ascontiguousarray(T_base_tool, dtype=float)
        q, exists, inside = self._room(last - first)
        solve_range(*chain, T, first, last, q, exists, inside)
        sample, branch = np.nonzero(exists)
        return Solutions(q[exists], sample + first, branch, inside[exists])

    def _room(self, *shape: int) -> tuple[Array, np.ndarray, np.ndarray]:
        """Return arrays for compiled code to write to: a Ctrl-C while numba wraps up results crashes."""
        q = np.empty((*shape, BRANCHES, self.arm.dof))
        return q, np.empty(q.shape[:-1], dtype=bool), np.empty(q.shape[:-1], dtype=bool)

    def _chain(self, phi: Array) -> Chain:
        arm = self.arm
        rows = structures(arm, self.locked, phi)
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
