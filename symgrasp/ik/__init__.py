"""Closed-form inverse kinematics: all branches of a pose at sampled redundancy values."""

from collections.abc import Sequence

from symgrasp.ik.closed_form import ClosedFormIK, Solutions
from symgrasp.ik.compiled import CompiledIK
from symgrasp.ik.torso import Solver, TorsoIK, over_torso
from symgrasp.robot.robot import Arm

__all__ = ["ClosedFormIK", "CompiledIK", "Solutions", "Solver", "TorsoIK", "over_torso", "solver_for"]


def solver_for(arm: Arm, samples: int, torso: Sequence[int] | None = None) -> Solver:
    """Return the fastest solver of an arm: compiled where its axes allow, EAIK otherwise.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        torso: the samples of the robot's torso to try; all of them if None.

    Raises:
        UrdfError: no closed form is known for the arm, whichever joint is locked.
    """
    return over_torso(arm, lambda alone: _solver(alone, samples), torso)


def _solver(arm: Arm, samples: int) -> ClosedFormIK:
    general = ClosedFormIK(arm, samples)
    return CompiledIK(arm, samples) if CompiledIK.fits(general) else general
