"""Inverse kinematics: all configurations of a pose at sampled redundancy values."""

from collections.abc import Sequence

from symgrasp.ik.arm_ik import ArmIK, Lock, Solutions
from symgrasp.ik.closed_form import ClosedFormIK
from symgrasp.ik.compiled import CompiledIK
from symgrasp.ik.pitched import GridSolvers, PitchedIK
from symgrasp.ik.torso import Solver, TorsoIK, over_torso
from symgrasp.robot.robot import Arm

__all__ = [
    "ArmIK",
    "ClosedFormIK",
    "CompiledIK",
    "GridSolvers",
    "PitchedIK",
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
        arm: the arm; a pitched one for the grasps of a row, see `Arm.grasping`.
        samples: number of redundancy samples; a 6-joint arm always has one.
        torso: the samples of the robot's torso to try; all of them if None.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.
    """
    if arm.pitched:
        return PitchedIK(arm, samples, _compiled)
    return over_torso(arm, lambda alone: _solver(alone, samples), torso)


def _solver(arm: Arm, samples: int) -> ArmIK:
    general = ClosedFormIK(arm, samples)
    return CompiledIK(arm, samples) if CompiledIK.fits(general) else general


def _compiled(arm: Arm, lock: Lock) -> CompiledIK | None:
    fits = CompiledIK.fits(ClosedFormIK(arm, len(lock.phi), lock=lock))
    return CompiledIK(arm, len(lock.phi), lock=lock) if fits else None


def independent_solver(arm: Arm, samples: int, torso: Sequence[int] | None = None) -> Solver:
    """Return the solver to check the others with: EAIK's where it has one; see `solver_for` for the rest."""
    if arm.pitched:
        return PitchedIK(arm, samples, lambda own, lock: _independent(own, len(lock.phi), lock))
    return over_torso(arm, lambda alone: _independent(alone, samples), torso)


def _independent(arm: Arm, samples: int, lock: Lock | None = None) -> ArmIK:
    general = ClosedFormIK(arm, samples, lock=lock)
    return general if general.knows_arm else CompiledIK(arm, samples, lock=lock)
