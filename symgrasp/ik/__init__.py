"""Inverse kinematics: all configurations of a pose at sampled redundancy values."""

from collections.abc import Sequence

from symgrasp.ik.arm_ik import ArmIK, Solutions
from symgrasp.ik.closed_form import ClosedFormIK
from symgrasp.ik.compiled import CompiledIK
from symgrasp.ik.torso import Solver, TorsoIK, over_torso
from symgrasp.robot.robot import Arm

__all__ = [
    "ArmIK",
    "ClosedFormIK",
    "CompiledIK",
    "Solutions",
    "Solver",
    "TorsoIK",
    "independent_solver",
    "over_torso",
    "solver_for",
]


def solver_for(arm: Arm, samples: int, torso: Sequence[int] | None = None) -> Solver:
    """Return the fastest solver of an arm: compiled where its axes allow, EAIK otherwise.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        torso: the samples of the robot's torso to try; all of them if None.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.
    """
    return over_torso(arm, lambda alone: _solver(alone, samples), torso)


def _solver(arm: Arm, samples: int) -> ArmIK:
    general = ClosedFormIK(arm, samples)
    return CompiledIK(arm, samples) if CompiledIK.fits(general) else general


def independent_solver(arm: Arm, samples: int) -> ArmIK:
    """Return the solver to check the others with, for an arm without a torso: EAIK's where it has one."""
    general = ClosedFormIK(arm, samples)
    return general if general.knows_arm else CompiledIK(arm, samples)
