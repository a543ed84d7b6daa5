"""Closed-form inverse kinematics: all branches of a pose at sampled redundancy values."""

from symgrasp.ik.closed_form import ClosedFormIK, Solutions
from symgrasp.ik.compiled import CompiledIK
from symgrasp.robot.robot import Arm

__all__ = ["ClosedFormIK", "CompiledIK", "Solutions", "solver_for"]


def solver_for(arm: Arm, samples: int) -> ClosedFormIK:
    """Return the fastest solver of an arm: compiled where its axes allow, EAIK otherwise.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.

    Raises:
        UrdfError: no closed form is known for the arm, whichever joint is locked.
    """
    general = ClosedFormIK(arm, samples)
    return CompiledIK(arm, samples) if CompiledIK.fits(general) else general
