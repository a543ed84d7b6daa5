"""Inverse kinematics: all configurations of a pose at sampled redundancy values."""

from collections.abc import Sequence

from symgrasp.ik.arm_ik import ArmIK, Lock, Solutions
from symgrasp.ik.chain import chain_geometries
from symgrasp.ik.compiled import CompiledIK
from symgrasp.ik.pitched import GridSolvers, PitchedIK
from symgrasp.ik.torso import Solver, TorsoIK, over_torso
from symgrasp.robot.robot import Arm

__all__ = [
    "ArmIK",
    "CompiledIK",
    "GridSolvers",
    "PitchedIK",
    "Solutions",
    "Solver",
    "TorsoIK",
    "over_torso",
    "solver_for",
]


def solver_for(arm: Arm, samples: int, torso: Sequence[int] | None = None) -> Solver:
    """Return the solver of an arm.

    Args:
        arm: the arm; a pitched one for the grasps of a row, see `Arm.grasping`.
        samples: number of redundancy samples; a 6-joint arm always has one.
        torso: the samples of the robot's torso to try; all of them if None.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.
    """
    if arm.pitched:
        return PitchedIK(arm, samples, _compiled)
    return over_torso(arm, lambda alone: CompiledIK(alone, samples), torso)


def _compiled(arm: Arm, lock: Lock) -> CompiledIK | None:
    fits = chain_geometries(arm, lock.joint, lock.phi) is not None
    return CompiledIK(arm, len(lock.phi), lock=lock) if fits else None
