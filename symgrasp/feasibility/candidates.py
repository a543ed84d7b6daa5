"""The candidate configurations of one tool pose, and the check of each in PyBullet.

Lines 5 to 9 of Algorithm 1: every redundancy sample, every branch of the closed form, inside the
limits, free of collision, and free along the straight retreat where the scene asks for one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.ik import Solver
from symgrasp.ik.retreat import retreat_distances, retreat_turns, retreated
from symgrasp.poses import Array, inverse
from symgrasp.reason import Reason
from symgrasp.robot.limits import moved_onto_limits
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import Load, load_of_hand, support_margin
from symgrasp.world import BulletWorld, Collision, NearBodies

__all__ = ["Candidate", "CandidateChecker", "CheckResult"]


class Candidate(NamedTuple):
    """A configuration that reaches the tool pose.

    Attributes:
        q: (n,) joint values.
        phi: redundancy value (rad).
        sample: its index.
        branch: branch of the closed form.
        reason: the stage at which it failed, or FEASIBLE.
        collision: the deepest collision of that stage, None where it is not a collision.
    """

    q: Array
    phi: float
    sample: int
    branch: int
    reason: Reason
    collision: Collision | None


class CheckResult(NamedTuple):
    """What the check of a candidate inside the joint limits found.

    Attributes:
        reason: the stage at which it failed, or FEASIBLE.
        collision: the deepest collision of that stage, None where it is not a collision.
        retreat: how far (m) from the grasp that was, along the retreat; the whole length if FEASIBLE.
        q: (n,) joint values there, or the last ones before the arm could not follow.
        imbalance: how far (m) the centre of mass is outside of the robot's support there, where that is what
            failed, else 0.
    """

    reason: Reason
    collision: Collision | None
    retreat: float
    q: Array
    imbalance: float = 0.0


class CandidateChecker:
    """Checks candidate configurations of an arm in a world, whose object must be in place.

    Args:
        world: where collisions are asked.
        arm: the arm.
        ik: its inverse kinematics.
        approach: length (m) of the straight retreat against the approach that must be free too.
        near: returns the bodies that may collide at joint values (n,) that reach a tool pose (4, 4) in
            the frame of the robot's base, and the links of the arm's robot that may collide with other
            bodies; only those are checked. All bodies are checked if None.
        holders: names of all arms that hold the object, of which each bears a part; the arm alone if it is
            not among them.
    """

    def __init__(
        self,
        world: BulletWorld,
        arm: Arm,
        ik: Solver,
        approach: float,
        near: Callable[[Array, Array], tuple[NearBodies, Collection[str]]] | None = None,
        holders: Sequence[str] = (),
    ) -> None:
        self.world, self.arm, self.ik, self._near = world, arm, ik, near
        self.holders = tuple(holders)
        self._retreat = retreat_distances(approach).tolist()
        self._turns = retreat_turns(arm.velocity, approach)

    def candidates(self, T_base_tool: Array, opening: float) -> Iterator[Candidate]:
        """Yield the candidates of a tool pose (4, 4), by φ, then by branch, each checked when asked for.

        Args:
            T_base_tool: tool pose in the frame of the robot's base.
            opening: opening (m) of the hand.
        """
        solutions = self.ik.solve(T_base_tool)
        for k, q in enumerate(solutions.q):
            sample, branch = int(solutions.sample[k]), int(solutions.branch[k])
            reason, collision = Reason.JOINT_LIMITS, None
            if solutions.inside[k]:
                reason, collision, *_ = self.check(T_base_tool, q, sample, opening)
            yield Candidate(q, float(self.ik.phi[sample]), sample, branch, reason, collision)

    def check(self, T_base_tool: Array, q: Array, sample: int, opening: float) -> CheckResult:
        """Check a candidate inside the limits: balance and collisions, at the grasp and along the retreat.

        At the grasp the robot bears the object; where a retreat is asked for, it must stand with an empty
        hand too, there and all along it.

        Args:
            T_base_tool: tool pose (4, 4) in the frame of the robot's base.
            q: (n,) joint values that reach it.
            sample: their redundancy sample, which the retreat keeps.
            opening: opening (m) of the hand.
        """
        if imbalance := self._imbalance(q, opening, T_base_tool):
            return CheckResult(Reason.OUT_OF_BALANCE, None, 0.0, q, imbalance)
        collision = self._collision(T_base_tool, q, opening)
        if collision:
            return CheckResult(collision.reason, collision, 0.0, q)
        if self._retreat and (imbalance := self._imbalance(q, opening)):
            return CheckResult(Reason.APPROACH_BLOCKED, None, 0.0, q, imbalance)
        for distance in self._retreat:
            T = retreated(T_base_tool, distance)
            follow = self._follow(T, q, sample)
            if follow is None:
                return CheckResult(Reason.APPROACH_BLOCKED, None, distance, q)
            q = follow
            if imbalance := self._imbalance(q, opening):
                return CheckResult(Reason.APPROACH_BLOCKED, None, distance, q, imbalance)
            collision = self._collision(T, q, opening)
            if collision:
                return CheckResult(Reason.APPROACH_BLOCKED, collision, distance, q)
        return CheckResult(Reason.FEASIBLE, None, self._retreat[-1] if self._retreat else 0.0, q)

    def _load(self, T_base_tool: Array) -> Load:
        """Return what the arm's robot bears of the object that a hand at a tool pose (4, 4) holds."""
        T = self.world.object_pose
        height = float((inverse(T) @ self.arm.robot.T_world_base @ T_base_tool)[2, 3])
        return load_of_hand(self.world.scene, self.arm, self.holders, T, height)

    def _imbalance(self, q: Array, opening: float, T_base_tool: Array | None = None) -> float:
        """Return how far (m) the robot's centre of mass is outside of its support; 0 where it stands.

        Args:
            q: (n,) joint values.
            opening: opening (m) of the hand.
            T_base_tool: the tool pose (4, 4) at which it bears the object, if it does.
        """
        robot = self.arm.robot
        if robot.support is None:
            return 0.0
        loads = [] if T_base_tool is None else [self._load(T_base_tool)]
        return max(0.0, -float(support_margin(robot, self.arm.robot_values(q, opening), loads)))

    def _collision(self, T_base_tool: Array, q: Array, opening: float) -> Collision | None:
        near, links = self._near(q, T_base_tool) if self._near else (None, None)
        if near is not None and not near:
            return None
        self.world.set_arm(self.arm, q, opening)
        return self.world.first_collision(self.arm, near, links)

    def _follow(self, T_base_tool: Array, q: Array, sample: int) -> Array | None:
        """Return the configuration at the same φ that continues q to the next pose, if any does."""
        solutions = self.ik.solve_sample(T_base_tool, sample)
        choices = solutions.q[solutions.inside]
        if not len(choices):
            return None
        # A joint that turns further than once around goes on from where it is, where its limits allow.
        near = choices + 2 * np.pi * np.round((q - choices) / (2 * np.pi))
        choices = moved_onto_limits(near, self.arm.lower, self.arm.upper, choices)
        turns = np.abs(choices - q)
        nearest = int(turns.max(axis=1).argmin())
        return choices[nearest] if np.all(turns[nearest] <= self._turns) else None
