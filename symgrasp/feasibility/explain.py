"""Every candidate configuration of one cell, checked in PyBullet: why a map says what it says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import CLEARANCE_LIMIT, Cell, rests_on_samples
from symgrasp.feasibility.creation.map_draft import without_candidates
from symgrasp.feasibility.fit import fit
from symgrasp.ik import Solver
from symgrasp.ik.retreat import retreated
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array, inverse
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.world import BulletWorld, Collision

__all__ = ["CandidateResult", "Explanation", "LimitViolation", "RetreatFailure", "explain_cell"]


class RetreatFailure(StrEnum):
    """Why an arm cannot follow the retreat any further at the same φ."""

    REACH = "out of reach"
    NOT_FOUND = "not found"
    LIMITS = "joint limits"
    BRANCH = "only by changing branch"


class LimitViolation(NamedTuple):
    """A joint outside its limits.

    Attributes:
        joint: its name.
        value: its value (rad), with the full turns that bring it nearest to its range.
        limit: the limit (rad) that it breaks.
    """

    joint: str
    value: float
    limit: float

    @property
    def excess(self) -> float:
        """By how much (rad)."""
        return abs(self.value - self.limit)

    def __str__(self) -> str:
        side = "above" if self.value > self.limit else "below"
        excess, limit = math.degrees(self.excess), math.degrees(self.limit)
        return f"{self.joint} {excess:.1f}° {side} {limit:.1f}°"


@dataclass(frozen=True, eq=False)
class CandidateResult:
    """A candidate configuration of a cell, and what its check found.

    Attributes:
        reason: the stage at which it failed, or FEASIBLE.
        q: (n,) joint values at the grasp.
        phi: redundancy value (rad).
        sample: its index.
        branch: branch of the closed form.
        violations: the joints outside their limits, furthest first; for JOINT_LIMITS.
        collisions: all pairs that are closer than they may be, those of the stage first, deepest
            first; for a collision, and for one on the retreat.
        retreat: how far (m) from the grasp the retreat ended, the whole length if FEASIBLE.
        failure: why the arm could not follow the retreat, None where it could.
        ended: (n,) joint values where it ended: those of the collisions.
        pitch: pitch (rad) of the hand of an arm of five joints, positive with the palm above; None of others.
        imbalance: how far (m) the centre of mass is outside of the robot's support, at the grasp or where the
            retreat ended, if that is what failed, else 0.
        clearance: distance (m) at the grasp of all pairs that are checked at least, at most
            `CLEARANCE_LIMIT`; for FEASIBLE, else None.
    """

    reason: Reason
    q: Array
    phi: float
    sample: int
    branch: int
    violations: tuple[LimitViolation, ...]
    collisions: tuple[Collision, ...]
    retreat: float
    failure: RetreatFailure | None
    ended: Array
    clearance: float | None
    pitch: float | None = None
    imbalance: float = 0.0

    @property
    def where(self) -> str:
        """Say which candidate it is: redundancy and branch, and the pitch where there is one."""
        pitch = "" if self.pitch is None else f"  pitch {math.degrees(self.pitch):6.1f}°"
        return f"φ {math.degrees(self.phi):7.1f}°  branch {self.branch}{pitch}"

    @property
    def why(self) -> str:
        """Say in one line what decided it."""
        if self.clearance is not None:
            most = " or more" if self.clearance >= CLEARANCE_LIMIT else ""
            return f"{1e3 * self.clearance:.1f} mm clear{most}"
        parts = [str(joint) for joint in self.violations]
        parts += [f"{c.a} and {c.b} {1e3 * c.depth:.1f} mm too close" for c in self.collisions]
        parts += [str(self.failure)] if self.failure else []
        if self.imbalance:
            parts.append(f"centre of mass {1e3 * self.imbalance:.1f} mm outside of the support")
        text = ", ".join(parts)
        return (
            f"after {1e3 * self.retreat:.0f} mm: {text}" if self.reason == Reason.APPROACH_BLOCKED else text
        )

    def _rank(self) -> tuple[float, ...]:
        """Sort key: the furthest stage first, then the one that came closest to being free."""
        deepest = max(
            (c.depth for c in self.collisions if c.reason == self.collisions[0].reason), default=0.0
        )
        excess = max((joint.excess for joint in self.violations), default=0.0)
        return (-self.reason, -self.retreat, deepest, excess, self.imbalance, -(self.clearance or 0.0))


@dataclass(frozen=True, eq=False)
class Explanation:
    """All candidates of a cell, checked.

    Attributes:
        cell: the cell.
        reason: what Algorithm 1 says of it.
        candidates: its candidates, best first: the furthest stage, then the closest to being free.
            Empty where the hand rules the cell out, and where no configuration reaches it or is found.
        phi: (K,) redundancy samples (rad), with candidates or without.
        opening: opening of the hand (m).
        T_world_tool: tool pose (4, 4).
        rests_on: what it rests on that the cell is feasible or infeasible, see `FeasibilityMap.rests_on`.
    """

    cell: Cell
    reason: Reason
    candidates: tuple[CandidateResult, ...]
    phi: Array
    opening: float
    T_world_tool: Array
    rests_on: str = ""

    def __str__(self) -> str:
        """The reason, how many candidates have which, and a line for each."""
        counts = ", ".join(f"{count} {reason.label}" for reason, count in self.counts().items())
        lines = [f"{self.reason.legend}: {len(self.candidates)} candidates{counts and ': ' + counts}"]
        lines += [f"rests on {self.rests_on}"] if self.rests_on else []
        lines += [f"  {c.where}  {c.reason.label:18}  {c.why}" for c in self.candidates]
        return "\n".join(lines)

    @property
    def best(self) -> CandidateResult | None:
        """The candidate that came furthest."""
        return self.candidates[0] if self.candidates else None

    @property
    def unreachable(self) -> int:
        """Number of redundancy samples at which no configuration that reaches the tool pose was found."""
        if self.reason < Reason.UNREACHABLE:
            return 0
        return len(self.phi) - len({c.sample for c in self.candidates})

    def counts(self) -> dict[Reason, int]:
        """Return how many candidates each reason has, the furthest first."""
        reasons = [c.reason for c in self.candidates]  # already in that order
        return {reason: reasons.count(reason) for reason in dict.fromkeys(reasons)}


def explain_cell(
    world: BulletWorld,
    ik: Solver,
    task: Task,
    manifold: Manifold,
    cell: Cell,
    progress: Progress | None = None,
) -> Explanation:
    """Check every candidate of one cell, also those after the first feasible one.

    Args:
        world: a world of the scene's robots, obstacles and object; it stays as it is.
        ik: the inverse kinematics of the arm, for the grasps of the cell's row and roll.
        task: the task.
        manifold: the grid.
        cell: the cell.
        progress: called with the finished share; may raise `Cancelled`.
    """
    arm = ik.arm
    tools = arm.hand.tool_poses(manifold, task.T_world_object)
    h = float(manifold.h[cell.row])
    opening = arm.hand.opening(float(manifold.profile.radius(h)))
    reason, candidates = fit(arm.hand, manifold.profile, h), []
    if reason is None:
        T_base_tool = inverse(arm.robot.T_world_base) @ tools[cell]
        with world.preserving_state():
            world.margin = world.scene.settings.margin
            world.set_arms(())
            world.set_object(task.T_world_object)
            checker = CandidateChecker(world, arm, ik, world.scene.settings.approach, holders=task.arms)
            found = _results(checker, T_base_tool, opening, progress)
            if arm.pitched:
                found = (replace(c, pitch=arm.pitch_and_azimuth(c.q, cell.roll)[0]) for c in found)
            candidates = sorted(found, key=CandidateResult._rank)
        reason = candidates[0].reason if candidates else without_candidates(ik)
    if progress and not candidates:
        progress(1.0)
    return Explanation(
        cell, reason, tuple(candidates), ik.phi, opening, tools[cell], _rests_on(reason, len(ik.phi))
    )


def _rests_on(reason: Reason, samples: int) -> str:
    """Say what a reason rests on of which no more than samples of the redundancy are known."""
    if reason == Reason.FEASIBLE:
        return "its witness"
    return "a proof" if reason < Reason.UNREACHABLE else rests_on_samples(samples)


def _results(
    checker: CandidateChecker, T_base_tool: Array, opening: float, progress: Progress | None
) -> Iterator[CandidateResult]:
    """Yield the checked candidates of a tool pose (4, 4), by φ, then by branch."""
    solutions = checker.ik.solve(T_base_tool)
    for k, (q, inside) in enumerate(zip(solutions.q, solutions.inside, strict=True)):
        sample, branch = int(solutions.sample[k]), int(solutions.branch[k])
        if inside:
            yield _checked(checker, T_base_tool, q, sample, branch, opening)
        else:
            yield _outside_limits(checker, q, sample, branch)
        if progress:
            progress((k + 1) / len(solutions.q))


def _outside_limits(checker: CandidateChecker, q: Array, sample: int, branch: int) -> CandidateResult:
    return CandidateResult(
        reason=Reason.JOINT_LIMITS,
        q=q,
        phi=float(checker.ik.phi[sample]),
        sample=sample,
        branch=branch,
        violations=_violations(checker.arm, q),
        collisions=(),
        retreat=0.0,
        failure=None,
        ended=q,
        clearance=None,
    )


def _checked(
    checker: CandidateChecker, T_base_tool: Array, q: Array, sample: int, branch: int, opening: float
) -> CandidateResult:
    """Check a candidate inside the limits, and measure all its collisions or its clearance."""
    world, arm = checker.world, checker.arm
    check = checker.check(T_base_tool, q, sample, opening)
    collisions, failure, clearance = (), None, None
    if check.collision:
        world.set_arm(arm, check.q, opening)
        collisions = tuple(world.arm_collisions(arm))
    elif check.reason == Reason.APPROACH_BLOCKED and not check.imbalance:
        failure = _failure(checker.ik, retreated(T_base_tool, check.retreat), sample)
    elif check.reason == Reason.FEASIBLE:
        world.set_arm(arm, q, opening)
        clearance = world.clearance(arm, CLEARANCE_LIMIT)
    return CandidateResult(
        reason=check.reason,
        q=q,
        phi=float(checker.ik.phi[sample]),
        sample=sample,
        branch=branch,
        violations=(),
        collisions=collisions,
        retreat=check.retreat,
        failure=failure,
        ended=check.q,
        clearance=clearance,
        imbalance=check.imbalance,
    )


def _violations(arm: Arm, q: Array) -> tuple[LimitViolation, ...]:
    """Return the joints of a configuration (n,) that are outside their limits, furthest first."""
    limits = np.where(q < arm.lower, arm.lower, arm.upper)
    outside = np.flatnonzero(~arm.value_inside(q))
    found = [LimitViolation(arm.value_names[j], float(q[j]), float(limits[j])) for j in outside]
    return tuple(sorted(found, key=lambda joint: -joint.excess))


def _failure(ik: Solver, T_base_tool: Array, sample: int) -> RetreatFailure:
    """Return why no configuration at a tool pose (4, 4) continues the one before."""
    solutions = ik.solve_sample(T_base_tool, sample)
    if not len(solutions.q):
        return RetreatFailure.REACH if ik.complete else RetreatFailure.NOT_FOUND
    return RetreatFailure.BRANCH if solutions.inside.any() else RetreatFailure.LIMITS
