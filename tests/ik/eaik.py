"""The inverse kinematics of arms by EAIK, an independent library, to check the compiled one with."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from eaik.IK_HP import HPRobot

from symgrasp.ik import CompiledIK, PitchedIK, Solver, over_torso
from symgrasp.ik.arm_ik import ArmIK, Lock, Solutions
from symgrasp.poses import Array, pose_error
from symgrasp.robot.robot import Arm

__all__ = ["EaikIK", "independent_solver"]

OPPOSITE_COSINE = -1.0 + 1e-9
"""Axes the cosine of whose angle is below this point in opposite directions."""


class EaikIK(ArmIK):
    """All branches of the inverse kinematics of an arm, by EAIK.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        tolerance: largest error of a solution.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.
    """

    @property
    def family(self) -> str:
        """What the inverse kinematics of the arm is called."""
        return "closed form of EAIK"

    @property
    def complete(self) -> bool:
        """True: what EAIK solves has a closed form."""
        return True

    @cached_property
    def knows_arm(self) -> bool:
        """Whether EAIK has a closed form for the arm, with the joint locked that is locked."""
        return all(solver.hasKnownDecomposition() for solver in self._solvers)

    @cached_property
    def _solvers(self) -> list[HPRobot]:
        """EAIK's solvers, one for each redundancy sample."""
        locks = [[] if self.locked is None else [(self.locked, float(phi))] for phi in self.phi]
        return [HPRobot(self._signs[:, None] * self.arm.H, self.arm.P, lock) for lock in locks]

    @cached_property
    def _signs(self) -> Array:
        """Signs (n,) of the joints for EAIK, which loses every pose where axes in a row are opposite."""
        signs = np.ones(self.arm.dof)
        free = [j for j in range(self.arm.dof) if j != self.locked]
        for before, j in pairwise(free):
            if signs[before] * (self.arm.H[before] @ self.arm.H[j]) < OPPOSITE_COSINE:
                signs[j] = -1.0
        return signs

    def at(self, phi: Array) -> Self:
        """Return the solver of the same arm at other samples (K,) of its redundancy (rad)."""
        other = super().at(phi)
        vars(other).pop("_solvers", None)  # those of the old samples
        return other

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), at every redundancy sample."""
        return self._collect(T_base_tool, self._solvers)

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""
        return self._collect(T_base_tool, [self._solvers[sample]])

    def _collect(self, T_base_tool: Array, solvers: list[HPRobot]) -> Solutions:
        """Return what solvers find for a pose (4, 4), without answers that miss it."""
        target = np.array(T_base_tool, dtype=float)
        target[:3, :3] = target[:3, :3] @ self.arm.R0.T  # EAIK's tool frame is parallel to the base at zero
        found = [self._signs * np.reshape(solver.IK(target).Q, (-1, self.arm.dof)) for solver in solvers]
        counts = [len(q) for q in found]
        q = np.concatenate(found)
        sample = np.repeat(np.arange(len(solvers)), counts)
        branch = np.concatenate([np.arange(n) for n in counts]) if counts else np.zeros(0, dtype=int)
        # EAIK returns least-squares answers where a pose is out of reach; forward kinematics tells them
        # from solutions.
        position, rotation = pose_error(self.arm.tool_pose(q), T_base_tool)
        exact = (position <= self.tolerance.position) & (rotation <= self.tolerance.rotation)
        q, inside = self.arm.within_limits(q[exact])
        here = self.arm.in_cell(q)
        return Solutions(q[here], sample[exact][here], branch[exact][here], inside[here])


def independent_solver(arm: Arm, samples: int, torso: Sequence[int] | None = None) -> Solver:
    """Return EAIK's solver of an arm where it has one; see `symgrasp.ik.solver_for` for the rest."""
    if arm.pitched:
        return PitchedIK(arm, samples, lambda own, lock: _alone(own, len(lock.phi), lock))
    return over_torso(arm, lambda alone: _alone(alone, samples), torso)


def _alone(arm: Arm, samples: int, lock: Lock | None = None) -> ArmIK:
    general = EaikIK(arm, samples, lock=lock)
    return general if general.knows_arm else CompiledIK(arm, samples, lock=lock)
