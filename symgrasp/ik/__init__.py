"""Inverse kinematics: all configurations of a pose at sampled redundancy values."""

from collections.abc import Callable, Sequence

import numpy as np

from symgrasp.ik.arm_ik import ArmIK, Lock, Solutions
from symgrasp.ik.compiled import CompiledIK, InterpretedIK
from symgrasp.ik.families import chain_geometries
from symgrasp.ik.locking import joint_to_lock
from symgrasp.ik.pitched import GridSolvers, PitchedIK
from symgrasp.ik.torso import Solver, TorsoIK, over_torso
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = [
    "ArmIK",
    "CompiledIK",
    "GridSolvers",
    "InterpretedIK",
    "PitchedIK",
    "Solutions",
    "Solver",
    "TorsoIK",
    "over_torso",
    "redundancy_of",
    "solver_for",
]


def solver_for(
    arm: Arm,
    samples: int,
    torso: Sequence[int] | None = None,
    more: Sequence[float] = (),
    trying: Callable[[], None] = lambda: None,
) -> Solver:
    """Return the solver of an arm.

    Args:
        arm: the arm; a pitched one for the grasps of a row, see `Arm.grasping`.
        samples: number of redundancy samples; a 6-joint arm always has one.
        torso: the samples of the robot's torso to try; all of them if None.
        more: values of the redundancy (rad) that are tried after the samples; none of a pitched arm.
        trying: called while the solvers of every sample of the torso are made; may raise `Cancelled`.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.
    """
    if arm.pitched:
        return PitchedIK(arm, samples, _compiled)

    def alone(own: Arm) -> CompiledIK:
        trying()
        ik = CompiledIK(own, samples)
        trying()
        return ik.at(np.append(ik.phi, more)) if len(more) else ik

    return over_torso(arm, alone, torso)


def redundancy_of(arm: Arm, q: Array) -> float | None:
    """Return the redundancy (rad) of a configuration (n,) of an arm; None of those of five or six joints."""
    alone = arm if arm.robot.torso is None else arm.at(0)
    if len(alone.joint_names) == 5:
        return None
    locked = joint_to_lock(alone)
    return None if locked is None else float(q[locked - alone.dof])


def _compiled(arm: Arm, lock: Lock) -> CompiledIK | None:
    fits = chain_geometries(arm, lock.joint, lock.phi) is not None
    return CompiledIK(arm, len(lock.phi), lock=lock) if fits else None
