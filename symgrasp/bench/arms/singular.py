"""Which poses the inverse kinematics reaches inside the limits: of random configurations and singular ones.

Where axes align, joints share their work, and a pose has infinitely many configurations, of which some may be
inside the limits and others not. So it counts whether the pose is reached inside the limits at all, by any
configuration, with the joint that is locked at its value.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from symgrasp.bench.arms.ik import bare_arm, random_configurations, sampled_solver
from symgrasp.ik import ArmIK, solver_for
from symgrasp.poses import Array, pose_error
from symgrasp.robot.catalogue import CATALOGUE, CatalogueArm, CatalogueRobot
from symgrasp.robot.robot import Arm

__all__ = [
    "NEAR_ZERO",
    "REACHED",
    "SingularRow",
    "configuration_sets",
    "measure",
    "reached",
    "run",
    "summary",
]

NEAR_ZERO = (1e-3, 1e-6, 1e-9, 0.0)
"""How far from zero (rad) a joint is at most, where it is set to about zero."""

REACHED = 1e-6
"""Largest error (m and rad) of the tool at a configuration that reaches a pose."""

SHARE = 0.02
"""Configurations of every joint and distance from zero, as a share of the random ones."""


@dataclass(frozen=True)
class SingularRow:
    """Poses of an arm, and how many of them are reached inside the limits.

    Attributes:
        name: the robot and its arm.
        counts: for each set of configurations its name, how many poses it has and how many are reached.
    """

    name: str
    counts: tuple[tuple[str, int, int], ...]

    def line(self) -> str:
        """Return the row as one line of text."""
        parts = (f"{name}: {found} of {poses}" for name, poses, found in self.counts)
        return f"{self.name:18} {', '.join(parts)}"


def run(poses: int) -> Iterator[SingularRow]:
    """Measure the first arm of every robot of the catalogue, with that many random configurations of each."""
    for robot in CATALOGUE:
        yield measure(robot, robot.arms[0], poses)


def summary(rows: Sequence[SingularRow]) -> Iterator[str]:
    """Yield the sums over all arms, a line for each set of configurations."""
    for sets in zip(*(row.counts for row in rows), strict=True):
        poses, found = sum(count[1] for count in sets), sum(count[2] for count in sets)
        yield f"{sets[0][0]}: {found} of {poses} reached inside the limits, {100 * found / poses:.4f} %"


def measure(robot: CatalogueRobot, which: CatalogueArm, poses: int) -> SingularRow:
    """Measure one arm.

    Raises:
        InputError: the package of the robot is not installed.
        UrdfError: nothing solves the arm.
    """
    arm = bare_arm(robot, which)
    ik = sampled_solver(solver_for(arm, 1))
    sets = configuration_sets(ik.arm, poses, max(1, round(SHARE * poses)), 0)
    counts = tuple((name, len(q), int(np.count_nonzero(reached(ik, q)))) for name, q in sets)
    return SingularRow(robot.name if len(robot.arms) == 1 else f"{robot.name} {which.name}", counts)


def configuration_sets(arm: Arm, poses: int, each: int, seed: int) -> Iterator[tuple[str, Array]]:
    """Yield sets of configurations (m, n) inside the limits of an arm, with their names.

    Args:
        arm: the arm.
        poses: number of random configurations.
        each: number of configurations of every joint and distance from zero, of every joint and limit, and
            so on.
        seed: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    joints = [j for j in range(arm.dof) if arm.lower[j] <= 0.0 <= arm.upper[j]]

    def more() -> Array:
        return random_configurations(arm, each, int(rng.integers(2**32)))

    yield "random", random_configurations(arm, poses, seed)
    for most in NEAR_ZERO:
        rows = []
        for j in joints:
            q = more()
            q[:, j] = np.clip(rng.uniform(-most, most, each), arm.lower[j], arm.upper[j])
            rows.append(q)
        yield f"one within {most:g}", np.concatenate(rows)
    rows = []
    for _ in range(arm.dof):
        q = more()
        zero = rng.random(q.shape) < 0.5
        zero[:, [j for j in range(arm.dof) if j not in joints]] = False
        rows.append(np.where(zero, 0.0, q))
    yield "several at 0", np.concatenate(rows)
    rows = []
    for j in range(arm.dof):
        for limit in {float(arm.lower[j]), float(arm.upper[j])}:
            if np.isfinite(limit):
                q = more()
                q[:, j] = limit
                rows.append(q)
    yield "one at a limit", np.concatenate(rows)


def reached(ik: ArmIK, q: Array) -> np.ndarray:
    """Return which of the poses at m configurations (m, n) are reached inside the limits.

    The locked joint, of seven, has its value there; the poses are those of forward kinematics.
    """
    arm = ik.arm
    T = arm.tool_pose(q)
    at = ik if ik.locked is None else ik.at(q[:, ik.locked])
    found = np.zeros(len(q), dtype=bool)
    for k in range(len(q)):
        solutions = at.solve_sample(T[k], 0 if ik.locked is None else k)
        inside = solutions.q[solutions.inside]
        if len(inside):
            position, rotation = pose_error(arm.tool_pose(inside), T[k])
            within = ((inside >= arm.lower) & (inside <= arm.upper)).all(axis=1)
            found[k] = bool((within & (position <= REACHED) & (rotation <= REACHED)).any())
    return found
