"""Inverse kinematics of arms of five joints, whose hand may be pitched.

Pitch and azimuth, within the cell, are two values more than the grasp leaves: configurations that hold an
object in a row are curves over azimuth and pitch. They are found where they cross the middle of the cell, and
where one value, the pitch itself or that of a joint, has one of some samples. Both are needed: at an upright
object, an arm whose other joints move in an upright plane comes from one azimuth alone, with any pitch; along
a lying one it comes from all azimuths with hardly any pitch.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from symgrasp.ik.arm_ik import ArmIK, Lock, Solutions, centres
from symgrasp.ik.locking import joint_to_lock
from symgrasp.ik.torso import Solver
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array
from symgrasp.robot.pitch import STEEPEST
from symgrasp.robot.robot import AZIMUTH, PITCH, Arm

__all__ = ["GridSolvers", "PitchedIK"]


class PitchedIK:
    """The configurations of a pitched arm: in the middle of a cell, and at samples of one value.

    Sample 0 is the middle of the cell; sample 1 + k is that of index k. Of an arm whose hand is held at a
    pitch, sample 1 is that pitch, anywhere within the cell, and in the middle it is met up to `SAME_PITCH`:
    an arm that holds an upright object from above has one pitch at all azimuths, up to its URDF's rounding.

    Args:
        arm: the arm, for the grasps of a row; see `Arm.grasping`.
        samples: number of samples; where the pitch is held there is one.
        solver: makes the solver of the arm with a value locked, None where there is none.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever value is locked.

    Attributes:
        arm: that arm.
        phi: (1 + samples,) azimuth 0, and the values that are sampled.
        parts: the two solvers, each with the samples that it has. The first is missing where no closed form
            is known, the second where no sample is inside the limits.
    """

    def __init__(self, arm: Arm, samples: int, solver: Callable[[Arm, Lock], ArmIK | None]) -> None:
        self.arm = arm
        if arm.pitch_value is None:
            locked = joint_to_lock(arm)
            assert locked is not None
            # Rows differ in the limits of the pitch, but samples mean the same in all of them.
            limits = (-STEEPEST, STEEPEST) if locked == PITCH else (arm.lower[locked], arm.upper[locked])
            phi = centres(*limits, samples)
        else:
            locked, phi = PITCH, np.array([arm.pitch_value])
        inside = np.flatnonzero((phi >= arm.lower[locked]) & (phi <= arm.upper[locked]))
        self.phi = np.append(0.0, phi)
        middle = solver(arm, Lock(AZIMUTH, np.zeros(1)))
        sampled = solver(arm, Lock(locked, phi[inside] if len(inside) else phi))
        found = [(middle, np.zeros(1, dtype=int)), (sampled, 1 + inside)]
        self.parts = [(ik, numbers) for ik, numbers in found if ik is not None and len(numbers)]
        self._complete = all(ik is not None and ik.complete for ik, _ in found)

    @property
    def family(self) -> str:
        """What the inverse kinematics of the arm is called."""
        return "five joints: " + "; ".join(dict.fromkeys(ik.family for ik, _ in self.parts))

    @property
    def complete(self) -> bool:
        """Whether every configuration at the samples is found, in any row."""
        return self._complete

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) of the grasp frame, by sample."""
        found = [_numbered(ik.solve(T_base_tool), numbers) for ik, numbers in self.parts]
        if not found:
            index = np.empty(0, dtype=int)
            return Solutions(np.empty((0, self.arm.dof)), index, index, np.empty(0, dtype=bool))
        return Solutions(*(np.concatenate(part) for part in zip(*found, strict=True)))

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one sample."""
        for ik, numbers in self.parts:
            if sample in numbers:
                own = int(np.flatnonzero(numbers == sample)[0])
                return _numbered(ik.solve_sample(T_base_tool, own), numbers[own : own + 1])
        raise ValueError(f"sample {sample} is outside of the limits of the grasp")


def _numbered(found: Solutions, numbers: np.ndarray) -> Solutions:
    return found._replace(sample=numbers[found.sample])


class GridSolvers:
    """The solvers of an arm for the grasps of a grid: one, or several of a pitched arm.

    Args:
        arm: the arm.
        manifold: the grid.
        solver: makes the solver of an arm; see `Arm.grasping`.

    Attributes:
        arm: that arm.
        manifold: that grid.
        at: returns the solver for the grasps of a row and roll.
    """

    def __init__(self, arm: Arm, manifold: Manifold, solver: Callable[[Arm], Solver]) -> None:
        self.arm, self.manifold, self._solver = arm, manifold, solver
        self._known: dict[tuple[float, ...], Solver] = {}
        self.at = cache(self._at)

    def _at(self, row: int, roll: int) -> Solver:
        """Return the solver for the grasps of a row and roll."""
        arm = self.arm.grasping(self.manifold, row, roll)
        key = (*arm.P.ravel().tolist(), *arm.lower.tolist(), *arm.upper.tolist(), arm.pitch_value or 0.0)
        if key not in self._known:
            self._known[key] = self._solver(arm)
        return self._known[key]
