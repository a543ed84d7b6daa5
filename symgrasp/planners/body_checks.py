"""Whether arms that hold an object together are free, robot by robot and pair by pair of robots."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import combinations

from symgrasp.poses import Array
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import support_margins
from symgrasp.world import BulletWorld

__all__ = ["BodyChecks"]


class BodyChecks:
    """Checks configurations of all arms that hold an object, by PyBullet.

    Whether a robot collides with itself, the object or an obstacle depends on its own arms alone, and whether
    two robots meet on the arms of both. Each is checked once, however many combinations it is a part of.

    Args:
        world: a world of the scene.
        arms: the arms; all other joints are at home.
        T_world_object: pose (4, 4) of the object.

    Attributes:
        count: how many such checks were made.
    """

    def __init__(self, world: BulletWorld, arms: Sequence[Arm], T_world_object: Array) -> None:
        self.count = 0
        self._world, self._arms, self._pose = world, arms, T_world_object
        self._known: dict[Hashable, bool] = {}
        robots = world.scene.robots
        own = {name: [k for k, arm in enumerate(arms) if arm.robot.name == name] for name in robots}
        self._parts = [((name,), tuple(own[name])) for name in robots]
        self._parts += [((a, b), tuple(sorted(own[a] + own[b]))) for a, b in combinations(robots, 2)]

    def conflict(self, configurations: Sequence[ArmConfiguration]) -> tuple[int, ...] | None:
        """Return arms, as indices, that cannot take their configurations together.

        They are those of a robot that collides or falls, or of two robots that meet, whatever all other arms
        do; none where it does not depend on the arms.

        Args:
            configurations: one an arm.

        Returns:
            The arms, or None where nothing collides and no robot falls.
        """
        values = [(c.q.tobytes(), c.opening) for c in configurations]
        placed = False
        for robots, arms in self._parts:
            key = robots, tuple(values[k] for k in arms)
            if key not in self._known:
                if not placed:
                    self._world.set_object(self._pose)
                    self._world.set_arms(configurations)
                    placed = True
                self.count += 1
                self._known[key] = self._is_free(robots, configurations)
            if not self._known[key]:
                return arms
        return None

    def _is_free(self, robots: tuple[str, ...], configurations: Sequence[ArmConfiguration]) -> bool:
        """Whether a robot stands, free of all but other robots, or whether two robots do not meet."""
        robot, *others = robots
        if others:
            return not self._world.robots_meet(robot, *others)
        margins = support_margins(self._world.scene, self._pose, configurations)
        return margins.get(robot, 0.0) >= 0 and not self._world.robot_collides(robot, self._arms)
