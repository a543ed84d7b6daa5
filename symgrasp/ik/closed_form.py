"""Inverse kinematics of 6-joint arms, and of 7-joint arms with one joint locked, through EAIK.

Locking a joint turns a 7-joint arm into a 6-joint arm whose closed form EAIK finds from the
axes alone. The locked joint's value is the redundancy φ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from eaik.IK_HP import HPRobot

from symgrasp.errors import UrdfError
from symgrasp.ik.chain import chain_geometries
from symgrasp.poses import Array, pose_error
from symgrasp.robot.robot import Arm

__all__ = ["ClosedFormIK", "Solutions", "Tolerance"]

LOCK_PREFERENCE = (6, 2, 0, 4, 1, 5, 3)
"""Which of seven joints to lock, first choice first among those that leave a chain of the compiled family,
then among the others. Locking the last one keeps the arm's whole reach; locking the elbow (index 3) would
fix its distance."""

GENERIC_ANGLE = 0.3
"""Value (rad) at which locks are tried: the answer is the same at almost any value, but at zero axes may
happen to be parallel."""

OPPOSITE_COSINE = -1.0 + 1e-9
"""Axes the cosine of whose angle is below this point in opposite directions."""


@dataclass(frozen=True)
class Tolerance:
    """Largest error of the tool pose of a returned configuration.

    Attributes:
        position: distance (m).
        rotation: angle (rad).
    """

    position: float = 1e-6
    rotation: float = 1e-6


class Solutions(NamedTuple):
    """Candidate configurations of one pose, in the order of Algorithm 1: by φ, then by branch.

    Attributes:
        q: (m, n) joint values (rad), inside the limits where full turns can bring them there.
        sample: (m,) index of the redundancy sample.
        branch: (m,) index of the closed form's branch at that sample.
        inside: (m,) whether all joints are inside their limits.
    """

    q: Array
    sample: np.ndarray
    branch: np.ndarray
    inside: np.ndarray


class ClosedFormIK:
    """All branches of the inverse kinematics of an arm, by EAIK.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        tolerance: largest error of a solution.

    Raises:
        UrdfError: no closed form is known for the arm, whichever joint is locked.

    Attributes:
        locked: index of the locked joint, or None for a 6-joint arm.
        phi: (samples,) values of the locked joint: centres of equal parts of its range.
    """

    def __init__(self, arm: Arm, samples: int, tolerance: Tolerance | None = None) -> None:
        self.arm = arm
        self.tolerance = tolerance or Tolerance()
        self.locked = _lockable_joint(arm)
        if self.locked is None:
            self.phi = np.zeros(1)
        else:
            lower, upper = arm.lower[self.locked], arm.upper[self.locked]
            if not np.isfinite(upper - lower):
                lower, upper = -np.pi, np.pi
            self.phi = lower + (np.arange(samples) + 0.5) * (upper - lower) / samples

    @property
    def complete(self) -> bool:
        """Whether every configuration at the redundancy samples is found, up to rounding.

        A closed form finds all of them: what it does not reach is unreachable. A search may miss one: what it
        does not reach is *not found*.
        """
        return True

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
        return Solutions(q, sample[exact], branch[exact], inside)


def _lockable_joint(arm: Arm) -> int | None:
    """Return the index of the joint to lock, or None for a 6-joint arm.

    Raises:
        UrdfError: EAIK knows no closed form, whichever joint is locked.
    """
    choices = [None] if arm.dof == 6 else list(LOCK_PREFERENCE)
    phi = np.array([GENERIC_ANGLE])
    for joint in sorted(choices, key=lambda joint: chain_geometries(arm, joint, phi) is None):
        locks = [] if joint is None else [(joint, GENERIC_ANGLE)]
        if HPRobot(arm.H, arm.P, locks).hasKnownDecomposition():
            return joint
    raise UrdfError(
        arm.robot.model.path,
        f"arm {arm.name}",
        list(arm.joint_names),
        "joints whose axes have a closed-form inverse kinematics (a spherical wrist or shoulder)",
    )
