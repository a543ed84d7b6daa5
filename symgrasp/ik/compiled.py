"""The compiled inverse kinematics as a solver."""

from __future__ import annotations

from typing import Self

import numpy as np

from symgrasp.compiling import interpreted
from symgrasp.ik.arm_ik import ArmIK, Lock, Solutions, Tolerance
from symgrasp.ik.branches import branch_count, new_memory, solve_range
from symgrasp.ik.chain import COSINE_TOLERANCE, Chain
from symgrasp.ik.families import EXACT, chain_geometries, further_geometries
from symgrasp.ik.pair.geometry import MEETING_PAIR
from symgrasp.ik.self_motion import BARELY
from symgrasp.poses import Array
from symgrasp.robot.robot import AZIMUTH, Arm

__all__ = ["CompiledIK", "InterpretedIK"]

FAMILIES = ("closed form, spherical triple", "closed form, three parallel axes", "search, two axes that meet")
"""What the families of `Chain` are called."""

LEEWAY = 0.3
"""How far (rad) outside its limits a joint may be where Newton's method starts: near singular poses
Newton's method moves joints that far."""


class CompiledIK(ArmIK):
    """The inverse kinematics of arms of one of the compiled families.

    Args:
        arm: the arm.
        samples: number of redundancy samples; a 6-joint arm always has one.
        tolerance: largest error of a solution.
        lock: the joint to lock, and where; the one that suits the arm best if None, over all its range.

    Raises:
        UrdfError: no inverse kinematics is known for the arm, whichever joint is locked.

    Attributes:
        chain: the arm's geometry at every redundancy sample, for compiled code.
    """

    _solve_range = staticmethod(solve_range)

    def __init__(
        self, arm: Arm, samples: int, tolerance: Tolerance | None = None, lock: Lock | None = None
    ) -> None:
        super().__init__(arm, samples, tolerance, lock)
        self._known = self.phi
        self.chain = self._pack_chain(self.phi)

    @property
    def family(self) -> str:
        """What the inverse kinematics of the arm is called."""
        return FAMILIES[int(self.chain.joint[8])] + (", rounded axes" if self.chain.joint[9] else "")

    @property
    def searches(self) -> bool:
        """Whether configurations are searched for, because there is no closed form."""
        return bool(self.chain.joint[8] == MEETING_PAIR)

    @property
    def complete(self) -> bool:
        """Whether every configuration at the samples is found: by a closed form of the true axes."""
        return self.everywhere and not (self.searches or bool(self.chain.joint[9]))

    @property
    def everywhere(self) -> bool:
        """Whether no redundancy sample is left out because axes are parallel there."""
        return bool(np.isfinite(self.chain.geometry).all())

    def at(self, phi: Array) -> Self:
        """Return the solver of the same arm at other samples (K,) of its redundancy (rad)."""
        other = super().at(phi)
        rows = further_geometries(self.arm, self.locked, self._known, phi)
        if rows is not None:
            other.chain = self.chain._replace(geometry=np.array([row.packed() for row in rows]))
        else:
            chain = self._pack_chain(np.concatenate([self._known, phi]))
            other.chain = chain._replace(geometry=chain.geometry[len(self._known) :])
        return other

    def solve(self, T_base_tool: Array) -> Solutions:
        """Return every configuration that reaches a pose (4, 4), at every redundancy sample."""
        return self._solve(T_base_tool, 0, len(self.phi))

    def solve_sample(self, T_base_tool: Array, sample: int) -> Solutions:
        """Return every configuration that reaches a pose (4, 4) at one redundancy sample."""
        found = self._solve(T_base_tool, sample, sample + 1)
        return found._replace(sample=np.zeros_like(found.sample))

    def _solve(self, T_base_tool: Array, first: int, last: int) -> Solutions:
        """Return the solutions of a pose (4, 4) at the redundancy samples from first to before last."""
        T = np.ascontiguousarray(T_base_tool, dtype=float)
        # The compiled code fills arrays made here: a Ctrl-C while numba wraps up results would crash.
        q = np.empty((last - first, branch_count(self.chain), self.arm.dof))
        exists, inside = np.empty(q.shape[:-1], dtype=bool), np.empty(q.shape[:-1], dtype=bool)
        self._solve_range(self.chain, T, first, last, q, exists, inside, new_memory(self.arm.dof))
        sample, branch = np.nonzero(exists)
        return Solutions(q[exists], sample + first, branch, inside[exists])

    def _pack_chain(self, phi: Array) -> Chain:
        """Pack the arm's geometry at values (K,) of its redundancy (rad) into arrays."""
        arm = self.arm
        found = chain_geometries(arm, self.locked, phi)
        assert found is not None  # or there would be no joint to lock
        precision, rows = found
        locked = -1 if self.locked is None else self.locked
        free = [j for j in range(arm.dof) if j != locked]
        backwards = rows[0].backwards
        closed_form = rows[0].family != MEETING_PAIR
        rounded = closed_form and precision is not EXACT
        tolerance = [self.tolerance.position, self.tolerance.rotation, 0.0]
        return Chain(
            geometry=np.array([row.packed() for row in rows]),
            joint=np.array(
                [
                    *(free[::-1] if backwards else free),
                    locked,
                    backwards,
                    rows[0].family,
                    rounded,
                    AZIMUTH if arm.pitched else -1,
                ]
            ),
            limits=_limits(arm, 0.0),
            leeway=_limits(arm, LEEWAY if rounded or not closed_form else BARELY),
            forward=np.concatenate([arm.H, arm.P, arm.R0, [tolerance]]),
            fixed=np.arange(arm.dof) == locked,
        )


class InterpretedIK(CompiledIK):
    """The same inverse kinematics, with nothing to compile: a sample takes a fraction of a millisecond."""

    _solve_range = staticmethod(interpreted(solve_range))


def _limits(arm: Arm, leeway: float) -> Array:
    """Return the limits of an arm as `Chain.limits` has them, wider by some leeway (rad)."""
    lower, upper = arm.lower - leeway, arm.upper + leeway
    bounded = np.isfinite(lower) & np.isfinite(upper)
    middle = np.zeros(arm.dof)
    middle[bounded] = 0.5 * (arm.lower[bounded] + arm.upper[bounded])
    half = np.minimum(np.where(bounded, 0.5 * (upper - lower), np.inf), np.pi)
    least = np.cos(half) - COSINE_TOLERANCE
    return np.array([lower, upper, middle, np.cos(middle), np.sin(middle), least])
