"""The inverse kinematics of the robots of the catalogue: how much of it is found, and how fast."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

from symgrasp.errors import InputError, SymgraspError
from symgrasp.ik import ArmIK, PitchedIK, Solver, solver_for
from symgrasp.poses import Array, inverse
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE, CatalogueArm, CatalogueRobot
from symgrasp.robot.hand import Hand
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot

__all__ = ["IkRow", "bare_arm", "measure", "random_configurations", "recall", "run", "sampled_solver"]

SAMPLES = 16
"""Redundancy samples of a pose that is timed."""

TIMED = 500
"""Poses that are timed."""

SSIK_POSES = 20
"""Poses that ssik is asked for as well."""

SAME = 1e-3
"""Joint values closer than this (rad), whole turns aside, are the same solution: near singular poses they are
known less well than the pose."""

BARE = Hand("none", (), (), {}, 0.0, 0.1, 0.0, 0.01)
"""No hand: of an arm's inverse kinematics it is not a part."""


@dataclass(frozen=True)
class IkRow:
    """What was measured of an arm.

    Attributes:
        name: the robot and its arm.
        problem: why nothing was measured; empty where it was.
        family: of its inverse kinematics.
        locked: name of the joint that is locked, or None.
        poses: number of random configurations.
        found: how many of them were found.
        ssik: how many of ssik's solutions were found, and of how many; None where ssik was not asked.
        microseconds: CPU time (µs) for a pose and redundancy sample.
    """

    name: str
    problem: str = ""
    family: str = ""
    locked: str | None = None
    poses: int = 0
    found: int = 0
    ssik: tuple[int, int] | None = None
    microseconds: float = 0.0

    def line(self) -> str:
        """Return the row as one line of text."""
        if self.problem:
            return f"{self.name:18} {self.problem}"
        share = 100 * self.found / self.poses
        theirs = "ssik: not asked" if self.ssik is None else f"ssik: {self.ssik[0]} of {self.ssik[1]} found"
        return (
            f"{self.name:18} {self.family:46} locked: {self.locked or 'none':24} "
            f"recall {share:7.3f} % of {self.poses}, {self.microseconds:6.2f} µs, {theirs}"
        )


def run(poses: int) -> Iterator[IkRow]:
    """Measure the first arm of every robot of the catalogue with random configurations inside the limits."""
    for robot in CATALOGUE:
        yield measure(robot, robot.arms[0], poses)


def measure(robot: CatalogueRobot, which: CatalogueArm, poses: int) -> IkRow:
    """Measure one arm; where its robot is not installed, or nothing solves it, the row says so."""
    name = robot.name if len(robot.arms) == 1 else f"{robot.name} {which.name}"
    try:
        arm = bare_arm(robot, which)
        ik = sampled_solver(solver_for(arm, SAMPLES))
    except SymgraspError as error:
        return IkRow(name, problem=error.expected if isinstance(error, InputError) else str(error))
    q = random_configurations(arm, poses, 0)
    T = arm.tool_pose(q[:TIMED])
    for pose in T[:3]:
        ik.solve(pose)  # what is compiled or built at the first time does not count
    start = process_time()
    for pose in T:
        ik.solve(pose)
    seconds = process_time() - start
    return IkRow(
        name=name,
        family=ik.family,
        locked=None if ik.locked is None else arm.value_names[ik.locked],
        poses=poses,
        found=recall(ik, q),
        ssik=_against_ssik(ik, which),
        microseconds=1e6 * seconds / (len(T) * len(ik.phi)),
    )


def bare_arm(robot: CatalogueRobot, which: CatalogueArm) -> Arm:
    """Return an arm of the catalogue without its hand, the other joints of the robot at their defaults.

    Raises:
        InputError: the package of the robot is not installed.
        UrdfError: its URDF is not one, or the arm has not five to seven revolute joints.
    """
    path = resolve(robot.urdf, Path())
    if path is None:
        raise InputError(robot.name, "urdf", robot.urdf, f"pip install {robot.package}")
    model = RobotModel(path, follow_up_axis=robot.follow_up_axis)
    chain = [joint.name for joint in model.chain(which.tool)]
    first, last = (chain.index(joint) for joint in which.joints)
    others = frozenset(chain[:first] + chain[last + 1 :])
    return Arm(
        which.name, Robot(robot.name, model, np.eye(4), model.default_values()), which.tool, BARE, others
    )


def random_configurations(arm: Arm, count: int, seed: int) -> Array:
    """Return configurations (count, n) inside the limits, of joints that turn further within half a turn."""
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    return np.random.default_rng(seed).uniform(lower, upper, (count, arm.dof))


def recall(ik: ArmIK, q: Array) -> int:
    """Return how many of m configurations (m, n) are among the solutions at their own pose and redundancy."""
    T = ik.arm.tool_pose(q)
    at = ik if ik.locked is None else ik.at(q[:, ik.locked])
    found = 0
    for k, row in enumerate(q):
        solutions = at.solve_sample(T[k], 0 if ik.locked is None else k)
        apart = (solutions.q[solutions.inside] - row + np.pi) % (2 * np.pi) - np.pi
        found += bool(np.abs(apart).max(axis=1, initial=0.0).min(initial=np.inf) < SAME)
    return found


def sampled_solver(ik: Solver) -> ArmIK:
    """Return the solver at samples of one value: of a pitched arm a part of its own; without a torso."""
    own = ik.parts[-1][0] if isinstance(ik, PitchedIK) else ik
    assert isinstance(own, ArmIK)
    return own


def _against_ssik(ik: ArmIK, which: CatalogueArm) -> tuple[int, int] | None:
    """Return how many of ssik's solutions of some poses are found, and of how many.

    None without ssik, and for pitched arms, which it does not know.
    """
    try:
        import ssik
    except ImportError:
        return None
    arm = ik.arm
    if arm.pitched:
        return None
    model = arm.robot.model
    first = next(joint for joint in model.chain(which.tool) if joint.name == which.joints[0])
    base = model.link_names[first.parent]
    T_parent = model.forward(arm.robot.home)[first.parent]
    poses = arm.tool_pose(random_configurations(arm, SSIK_POSES, 1))
    try:
        other = ssik.Manipulator.from_urdf(model.path, base=base, ee=which.tool)
        found = [[np.asarray(s.q) for s in other.solve(inverse(T_parent) @ T)] for T in poses]
    except Exception:  # ssik does not know every arm, and has no one exception that says so
        return None
    theirs: Sequence[Array] = [q for at_pose in found for q in at_pose]
    if not theirs:
        return 0, 0
    q, inside = arm.within_limits(np.array(theirs))
    return recall(ik, q[inside]), int(inside.sum())
