"""Inverse kinematics of arms on a torso: the arm's own, at every sample of the torso."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from symgrasp.ik.arm_ik import Solutions
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["Solver", "TorsoIK", "over_torso"]


class Solver(Protocol):
    """What finds the configurations of an arm that reach a tool pose.

    Attributes:
        arm: the arm.
        phi: (K,) redundancy samples.
    """

    arm: Arm
    phi: Array

    @property
    def complete(self) -> bool:
        """Whether it finds every configuration, so that none found is a proof."""
        ...

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), at every redundancy sample."""
        ...

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""
        ...


class TorsoIK:
    """The configurations of an arm whose robot has a torso.

    Redundancy sample k of torso sample t is sample ``t · K + k``, for K samples of the arm alone.

    Args:
        arm: the arm.
        solver: makes the solver of the arm alone, see `Arm.at`.
        torso: the torso samples to try; all of them if None.

    Attributes:
        phi: (T · K,) redundancy values of the arm alone, for every torso sample.
    """

    def __init__(self, arm: Arm, solver: Callable[[Arm], Solver], torso: Sequence[int] | None = None) -> None:
        assert arm.robot.torso is not None
        count = len(arm.robot.torso)
        self.arm = arm
        self._solvers = {t: solver(arm.at(t)) for t in (range(count) if torso is None else torso)}
        own = next(iter(self._solvers.values())).phi
        self._samples = len(own)
        self.phi = np.tile(own, count)

    @property
    def complete(self) -> bool:
        """Whether it finds every configuration, so that none found is a proof."""
        return all(ik.complete for ik in self._solvers.values())

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), by torso sample, then by φ."""
        found = [self._extended(t, ik.solve(T_base_tool)) for t, ik in self._solvers.items()]
        return Solutions(*(np.concatenate(parts) for parts in zip(*found, strict=True)))

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""
        t, own = divmod(sample, self._samples)
        return self._extended(t, self._solvers[t].solve_sample(T_base_tool, own))

    def _extended(self, t: int, found: Solutions) -> Solutions:
        """Return solutions of the arm alone with the joint values of torso sample t before them."""
        return found._replace(q=self.arm.with_torso(t, found.q), sample=found.sample + t * self._samples)


def over_torso(arm: Arm, solver: Callable[[Arm], Solver], torso: Sequence[int] | None = None) -> Solver:
    """Return the solver of an arm, at every sample of the torso where its robot has one.

    Args:
        arm: the arm.
        solver: makes the solver of an arm without a torso.
        torso: the torso samples to try; all of them if None.
    """
    return solver(arm) if arm.robot.torso is None else TorsoIK(arm, solver, torso)
