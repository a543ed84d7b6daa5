"""Arm configurations that hold an object together without the robots meeting."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from itertools import combinations, islice
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from symgrasp.engine.robot_pairs import COLLIDING, PlacedRobot, RobotPairs
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import CLEARANCE_LIMIT, Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.object.manifold import ROLLS
from symgrasp.planners.body_checks import BodyChecks
from symgrasp.planners.combinations import first_combination, members
from symgrasp.poses import Array, inverse
from symgrasp.reason import Reason
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.robot.posture import ease
from symgrasp.robot.robot import Arm
from symgrasp.world import BulletWorld

__all__ = ["ConfigurationFinder", "witnesses"]


def witnesses(
    arms: Sequence[Arm], maps: Sequence[FeasibilityMap], cells: Sequence[Cell]
) -> list[ArmConfiguration]:
    """Return every arm at the witness of its cell, which must be feasible."""
    configurations = []
    for arm, m, cell in zip(arms, maps, cells, strict=True):
        witness = m.witness(cell)
        assert witness is not None  # planners choose feasible cells
        configurations.append(ArmConfiguration(arm, witness.q, witness.opening))
    return configurations


class _Choices:
    """What an arm can choose from at a cell, with a torso at a sample.

    Attributes:
        configurations: those that reach the cell inside the limits, in the order of Algorithm 1.
        samples: their redundancy samples.
        left: the set of those not known to be infeasible; see `combinations`.
        checked: the set of those known to be feasible.
        placed: the robot in each, without what its other arms move.
    """

    def __init__(
        self, configurations: Sequence[ArmConfiguration], samples: Sequence[int], placed: PlacedRobot
    ) -> None:
        self.configurations, self.samples, self.placed = configurations, samples, placed
        self.left, self.checked = (1 << len(configurations)) - 1, 0


EASIEST = 8
"""Feasible configurations of a cell, the easiest first, of which one takes the place of its witness."""


class _At(NamedTuple):
    """Where an arm is to hold: index of the arm, its cell, and the sample of a torso that it shares."""

    arm: int
    cell: Cell
    torso: int | None


class ConfigurationFinder:
    """Finds configurations in which several arms hold their cells and nothing collides.

    Args:
        world: a world of the scene; the object is placed by `find`.
        arms: the arms.
        maps: one map an arm, in the same order, of one task.
        by_torso: arm → its maps at the samples of the torso that it shares with another arm of the task.
    """

    def __init__(
        self,
        world: BulletWorld,
        arms: Sequence[Arm],
        maps: Sequence[FeasibilityMap],
        by_torso: Mapping[str, Sequence[FeasibilityMap]] = MappingProxyType({}),
    ) -> None:
        self.world, self.arms, self.maps = world, arms, maps
        self._by_torso = by_torso
        self._known_checker = cache(self._make_checker)
        self._choices = cache(self._make_choices)
        self._pairs: dict[tuple[_At, _At], list[int]] = {}

    def maps_at(self, torso: Mapping[str, int]) -> list[FeasibilityMap]:
        """Return the maps of the arms, with the torso that some share at a sample.

        Args:
            torso: arm → sample, for those that share a torso.
        """
        return [
            self._by_torso[arm.name][torso[arm.name]] if arm.name in torso else m
            for arm, m in zip(self.arms, self.maps, strict=True)
        ]

    def find(
        self,
        cells: Sequence[Cell],
        torso: Mapping[str, int] = MappingProxyType({}),
        *,
        every: bool = True,
        trying: Callable[[], None] = lambda: None,
    ) -> list[ArmConfiguration] | None:
        """Return configurations, one an arm, that are free together, or None if there are none.

        An arm whose witness stands near a limit or a singular pose takes another one, see `_easier`.

        Args:
            cells: a feasible cell for every arm.
            torso: arm → sample of its torso, for those that share one.
            every: try all combinations of feasible configurations, not the witnesses alone.
            trying: called before every check that takes long; may raise `Cancelled`.
        """
        at = [_At(k, cells[k], torso.get(arm.name)) for k, arm in enumerate(self.arms)]
        found = witnesses(self.arms, self.maps_at(torso), cells)
        if every:
            found = [self._easier(*pair, trying) for pair in zip(at, found, strict=True)]
        if self.conflict(found) is None:
            return found
        return self._first_free(at, trying) if every else None

    def excluding(self, cells: Sequence[Cell], torso: Mapping[str, int]) -> Iterator[tuple[int, int]]:
        """Yield pairs of arms, as indices, that cannot hold their cells together, whatever all others do.

        Only those that share no torso, and that `find` came upon.

        Args:
            cells: a feasible cell for every arm, for which `find` has found nothing.
            torso: arm → sample of its torso, for those that share one.
        """
        at = [_At(k, cells[k], None) for k, arm in enumerate(self.arms) if arm.name not in torso]
        for a, b in combinations(at, 2):
            if (a, b) in self._pairs and self._exclude(a, b):
                yield a.arm, b.arm

    def conflict(self, configurations: Sequence[ArmConfiguration]) -> tuple[int, ...] | None:
        """Return arms that cannot take their configurations together; see `BodyChecks.conflict`."""
        return self._checks.conflict(configurations)

    @property
    def body_checks(self) -> int:
        """How often a robot, or a pair of robots, was checked in PyBullet."""
        return self._checks.count

    @cached_property
    def _checks(self) -> BodyChecks:
        return BodyChecks(self.world, self.arms, self.maps[0].T_world_object)

    @cached_property
    def _robot_pairs(self) -> RobotPairs:
        return RobotPairs(self.world)

    def _easier(self, at: _At, witness: ArmConfiguration, trying: Callable[[], None]) -> ArmConfiguration:
        """Return the one of the easiest configurations that has the largest product of ease and clearance.

        The witness of the map has the largest clearance, so where its ease is 1 it is the best.
        """
        arm = witness.arm
        if ease(arm, witness.q) >= 1:
            return witness
        configurations = self._choices(at).configurations
        eases = ease(arm, np.reshape([c.q for c in configurations], (-1, arm.dof)))
        order = (int(i) for i in np.argsort(-eases, kind="stable") if eases[i] > ease(arm, witness.q))
        feasible = (i for i in order if self._is_feasible(at, i, trying))
        free = [configurations[i] for i in islice(feasible, EASIEST)]
        self.world.set_object(self.maps[0].T_world_object)

        def worth(c: ArmConfiguration) -> float:
            trying()
            self.world.set_arms([c])
            return float(ease(arm, c.q)) * self.world.clearance(arm, CLEARANCE_LIMIT, self.arms)

        return max([witness, *free], key=worth)

    def _first_free(self, at: Sequence[_At], trying: Callable[[], None]) -> list[ArmConfiguration] | None:
        """Return the first free combination of the arms' feasible configurations, as a product lists them.

        What certainly meets is left out, and everything else checked when a combination needs it.
        """
        if any(self._exclude(a, b) for a, b in combinations(at, 2)):
            return None
        pairs = {(a.arm, b.arm): self._pairs[a, b] for a, b in combinations(at, 2)}
        choices = [self._choices(one) for one in at]
        excluded: defaultdict[tuple[int, ...], set[tuple[int, ...]]] = defaultdict(set)
        while True:
            picked = first_combination([own.left for own in choices], pairs, excluded)
            if picked is None:
                return None
            trying()
            if not all([self._is_feasible(one, i, trying) for one, i in zip(at, picked, strict=True)]):
                continue
            found = [own.configurations[i] for own, i in zip(choices, picked, strict=True)]
            arms = self.conflict(found)
            if arms is None:
                return found
            if len(arms) == 2:
                a, b = arms
                pairs[a, b][picked[a]] &= ~(1 << picked[b])
            elif len(arms) == 1:
                choices[arms[0]].left &= ~(1 << picked[arms[0]])
            elif arms:
                excluded[arms].add(tuple(picked[k] for k in arms))
            else:
                return None

    def _exclude(self, a: _At, b: _At) -> bool:
        """Whether no choices that are left to two arms go together."""
        if (a, b) not in self._pairs:
            self._pairs[a, b] = self._make_pairs(a, b)
        left = self._choices(b).left
        return not any(self._pairs[a, b][i] & left for i in members(self._choices(a).left))

    def _make_choices(self, at: _At) -> _Choices:
        arm = self.arms[at.arm]
        opening = float(self.maps[at.arm].opening[at.cell.row])
        found = self._checker(at, self._own_phi(at)).ik.solve(self._tool(at))
        inside = found.inside
        configurations = [ArmConfiguration(arm, q, opening) for q in found.q[inside]]
        values = [arm.robot_values(q, opening) for q in found.q[inside]]
        placed = self._robot_pairs.place(arm.robot, values, _moved_by_others(arm, self.arms))
        return _Choices(configurations, found.sample[inside].tolist(), placed)

    def _make_pairs(self, a: _At, b: _At) -> list[int]:
        """Return, for each choice of an arm, the set of those of another arm that it does not surely meet."""
        one, other = self._choices(a), self._choices(b)
        if self.arms[a.arm].robot.name == self.arms[b.arm].robot.name:
            return [other.left] * len(one.configurations)
        certain = self._robot_pairs.certify(one.placed, other.placed, self.world.scene.settings.margin)
        return [sum(1 << int(j) for j in np.flatnonzero(row != COLLIDING)) for row in certain]

    def _is_feasible(self, at: _At, choice: int, trying: Callable[[], None]) -> bool:
        """Whether a choice is feasible for the arm alone, the other robots at home; forget it if not."""
        own = self._choices(at)
        if not own.checked >> choice & 1:
            trying()
            for robot in self.world.scene.robots:
                self.world.park(robot)
            self.world.set_object(self.maps[at.arm].T_world_object)
            configuration, sample = own.configurations[choice], own.samples[choice]
            checker = self._checker(at, self._own_phi(at))
            result = checker.check(self._tool(at), configuration.q, sample, configuration.opening)
            if result.reason != Reason.FEASIBLE:
                own.left &= ~(1 << choice)
                return False
            own.checked |= 1 << choice
        return True

    def _tool(self, at: _At) -> Array:
        """Return the tool pose (4, 4) of a cell in the base of the arm's robot."""
        arm, m, cell = self.arms[at.arm], self.maps[at.arm], at.cell
        h, theta = m.manifold.h[cell.row], m.manifold.theta[cell.column]
        radius = float(m.manifold.profile.radius(h))
        roll, _ = m.roll_and_pitch(cell.roll)
        tool = arm.hand.tool_pose(m.T_world_object, h, theta, ROLLS[roll], radius)
        return inverse(arm.robot.T_world_base) @ tool

    def _checker(self, at: _At, more: tuple[float, ...] = ()) -> CandidateChecker:
        """Return the checker of an arm, of a pitched one for the row, roll and pitch of its cell.

        Args:
            at: the arm and its cell.
            more: values (rad) of the redundancy besides the samples.
        """
        m, cell = self.maps[at.arm], at.cell
        pitched = self.arms[at.arm].pitched
        grasp = (cell.row, *m.roll_and_pitch(cell.roll)) if pitched else None
        return self._known_checker(at.arm, at.torso, grasp, more)

    def _own_phi(self, at: _At) -> tuple[float, ...]:
        """Return the redundancy (rad) of the witness of a cell, where it is none of the samples."""
        if self.world.scene.settings.redundancy != "auto":
            return ()
        m = self.maps[at.arm] if at.torso is None else self._by_torso[self.arms[at.arm].name][at.torso]
        witness = m.witness(at.cell)
        if witness is None or witness.phi in self._checker(at).ik.phi:
            return ()
        return (witness.phi,)

    def _make_checker(
        self,
        k: int,
        torso: int | None,
        grasp: tuple[int, int, float] | None,
        more: tuple[float, ...],
    ) -> CandidateChecker:
        settings = self.world.scene.settings
        arm = self.arms[k]
        if grasp:
            row, roll, pitch = grasp
            arm = arm.at_pitch(pitch).grasping(self.maps[k].manifold, row, roll)
        ik = solver_for(arm, settings.samples, None if torso is None else [torso], more)
        holders = [own.name for own in self.arms]
        return CandidateChecker(self.world, arm, ik, settings.approach, holders=holders)


def _moved_by_others(arm: Arm, arms: Sequence[Arm]) -> set[str]:
    """Return the names of the links of an arm's robot that depend on joints of others of its arms."""
    model = arm.robot.model
    others = {
        joint
        for other in arms
        if other.robot.name == arm.robot.name and other.name != arm.name
        for joint in (*other.joint_names, *other.hand.joints)
    } - set(arm.joint_names)
    sources = {model.joint_names.index(joint) for joint in others}
    return {
        link for link in model.colliding_links() if sources.intersection(j.source for j in model.chain(link))
    }
