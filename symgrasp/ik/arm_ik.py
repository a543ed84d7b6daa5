"""What every inverse kinematics of an arm has in common: the samples of its redundancy, and its answers.

Locking a joint turns a 7-joint arm into a 6-joint arm. The locked joint's value is the redundancy φ.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from symgrasp.ik.locking import joint_to_lock
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["ArmIK", "Lock", "Solutions", "Tolerance", "centres", "one_turn"]


@dataclass(frozen=True)
class Tolerance:
    """Largest error of the tool pose of a returned configuration.

    Attributes:
        position: distance (m).
        rotation: angle (rad).
    """

    position: float = 1e-6
    rotation: float = 1e-6


class Lock(NamedTuple):
    """A joint that is locked at samples.

    Attributes:
        joint: its index.
        phi: (samples,) its values (rad).
    """

    joint: int
    phi: Array


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


class ArmIK(ABC):
    """Every configuration of an arm that reaches a pose, at samples of its redundancy.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        tolerance: largest error of a solution.
        lock: the joint to lock, and where; the one that suits the arm best if None, over all its range.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.

    Attributes:
        locked: index of the locked joint, or None for a 6-joint arm.
        phi: (samples,) values of the locked joint: centres of equal parts of its range, of one turn at most.
    """

    def __init__(
        self, arm: Arm, samples: int, tolerance: Tolerance | None = None, lock: Lock | None = None
    ) -> None:
        self.arm = arm
        self.tolerance = tolerance or Tolerance()
        self.locked = lock.joint if lock else joint_to_lock(arm)
        if lock:
            self.phi = lock.phi
        elif self.locked is None:
            self.phi = np.zeros(1)
        else:
            self.phi = centres(arm.lower[self.locked], arm.upper[self.locked], samples)

    def at(self, phi: Array) -> Self:
        """Return the solver of the same arm at other samples (K,) of its redundancy (rad)."""
        other = copy(self)
        other.phi = phi
        return other

    @property
    def everywhere(self) -> bool:
        """Whether no redundancy sample is left out because nothing can be computed there."""
        return True

    @property
    @abstractmethod
    def family(self) -> str:
        """What the inverse kinematics of the arm is called."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether every configuration at the redundancy samples is found, up to rounding.

        A closed form finds all of them: what it does not reach is unreachable. A search may miss one: what it
        does not reach is *not found*.
        """

    @abstractmethod
    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), at every redundancy sample."""

    @abstractmethod
    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""


def centres(lower: float, upper: float, samples: int) -> Array:
    """Return the centres (samples,) of equal parts of a joint's range (rad); of a turn without limits."""
    lower, upper = one_turn(lower, upper)
    return lower + (np.arange(samples) + 0.5) * (upper - lower) / samples


def one_turn(lower: float, upper: float) -> tuple[float, float]:
    """Return a joint's range (rad), or a turn of it where it is larger or has no limits."""
    if not np.isfinite(upper - lower):
        return -np.pi, np.pi
    if upper - lower > 2 * np.pi:  # what is a full turn apart is the same to the other joints
        middle = 0.5 * (lower + upper)
        return middle - np.pi, middle + np.pi
    return lower, upper
