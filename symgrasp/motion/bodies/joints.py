"""Which joints move with some arms and hands, and how they carry what hangs on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.collision.pieces import pose_rows
from symgrasp.errors import NoPlanError
from symgrasp.motion.bodies.state import State
from symgrasp.poses import Array, inverse
from symgrasp.robot.joint import Joint
from symgrasp.robot.robot import Arm, Robot

__all__ = ["MovingJoints"]


class MovingJoints:
    """The J joints that move with some arms and hands, in an order in which parents come first.

    Args:
        state: where everything is now.
        arms: the arms that move.
        hands: the arms whose hands open or close.
        still: arms that stand still: what they share with those that move, as a torso, keeps its values.

    Raises:
        NoPlanError: another joint follows one that moves.

    Attributes:
        joints: the joints with their robots.
        robots: the robots whose joints they are, by name.
        parent: (J,) index of the joint before, -1 for none.
        origin: (J, 12) frame of each at zero in that of its parent; of those without one in the world.
        axis: (J, 3) unit axes in the joint frames.
        slides: (J,) whether the joint is prismatic.
        limits: (2, J) lower and upper limits.
    """

    def __init__(
        self, state: State, arms: Sequence[Arm], hands: Sequence[Arm], still: Sequence[Arm] = ()
    ) -> None:
        self.joints = _joints(arms, hands)
        self.robots = {robot.name: robot for robot, _ in self.joints}
        self._check_followers()
        values = {name: state.values[name].copy() for name in self.robots}
        self._now = {name: _links(robot, values[name]) for name, robot in self.robots.items()}
        for robot, joint in self.joints:
            values[robot.name][joint.source] = 0.0
        self._zero = {name: _links(robot, values[name]) for name, robot in self.robots.items()}
        zero = [self._zero[robot.name][joint.child] for robot, joint in self.joints]
        self._frames = np.array(zero).reshape(-1, 4, 4)
        self.parent = np.full(len(self.joints), -1, dtype=np.int64)
        origin = self._frames.copy()
        for j, (robot, joint) in enumerate(self.joints):
            before = [b for b in robot.model.chain(robot.model.link_names[joint.child]) if b is not joint]
            self.parent[j] = self._last(robot.name, before)
            if self.parent[j] >= 0:
                origin[j] = inverse(self._frames[self.parent[j]]) @ self._frames[j]
        self.origin = pose_rows(origin)
        self.axis = np.array([joint.axis for _, joint in self.joints]).reshape(-1, 3)
        self.slides = np.array([joint.kind == "prismatic" for _, joint in self.joints], dtype=bool)
        kept = {(arm.robot.name, name) for arm in still for name in arm.joint_names}
        limits = [
            (state.values[robot.name][joint.source],) * 2
            if (robot.name, joint.name) in kept
            else (joint.lower, joint.upper)
            for robot, joint in self.joints
        ]
        self.limits = np.array(limits, dtype=float).reshape(-1, 2).T.copy()
        self._span = np.where(self.slides, np.abs(self.limits).max(axis=0), 0.0)

    def columns(self, arm: Arm) -> np.ndarray:
        """Return where the joints of an arm that moves are among them."""
        names = [(robot.name, joint.name) for robot, joint in self.joints]
        return np.array([names.index((arm.robot.name, name)) for name in arm.joint_names])

    def carrier(self, robot: Robot, link: str) -> int:
        """Return the last of the joints that moves a link, -1 if none does."""
        return self._last(robot.name, robot.model.chain(link))

    def common(self, a: int, b: int) -> int:
        """Return the last joint that carries what joints a and b carry, -1 if there is none."""
        above = set()
        while a >= 0:
            above.add(a)
            a = int(self.parent[a])
        while b >= 0 and b not in above:
            b = int(self.parent[b])
        return b

    def link_in_joint(self, j: int, link: str) -> Array:
        """Return the pose (4, 4) of a link in the frame of a joint that carries it."""
        robot, _ = self.joints[j]
        return inverse(self._frames[j]) @ self._zero[robot.name][robot.model.link_index(link)]

    def now_in_joint(self, j: int, T_world: Array) -> Array:
        """Return the pose (4, 4) in the frame of a joint of what is at a pose in the world now."""
        robot, joint = self.joints[j]
        return inverse(self._now[robot.name][joint.child]) @ T_world

    def levers(self, j: int, points: Array, rounding: float = 0.0) -> Array:
        """Return how far (J,) points that joint j carries move at most for each unit of each joint.

        Args:
            j: the joint.
            points: (k, 3) in its frame.
            rounding: radius (m) of balls around them that move, too.
        """
        lever = np.zeros(len(self.joints))
        lever[j] = (
            1.0 if self.slides[j] else np.linalg.norm(_across(points, self.axis[j]), axis=1).max() + rounding
        )
        away = np.linalg.norm(points, axis=1).max() + rounding + self._span[j]
        while self.parent[j] >= 0:
            step, j = self.origin[j, 9:], int(self.parent[j])
            lever[j] = 1.0 if self.slides[j] else np.linalg.norm(_across(step, self.axis[j])) + away
            away += np.linalg.norm(step) + self._span[j]
        return lever

    def _last(self, robot: str, chain: Sequence[Joint]) -> int:
        """Return which of the joints is the last in a chain of joints of a robot, -1 if none is."""
        names = [joint.name for joint in chain]
        own = [
            (names.index(joint.name), k)
            for k, (r, joint) in enumerate(self.joints)
            if r.name == robot and joint.name in names
        ]
        return max(own)[1] if own else -1

    def _check_followers(self) -> None:
        """Check that no other joint mimics one of those that move."""
        for robot in self.robots.values():
            sources = {joint.source for own, joint in self.joints if own is robot}
            names = {joint.name for own, joint in self.joints if own is robot}
            for joint in robot.model.joints:
                if joint.source in sources and joint.name not in names:
                    text = f"no motion of {robot.name} can be planned"
                    raise NoPlanError(f"{text}: {joint.name} follows a joint of its arm")


def _joints(arms: Sequence[Arm], hands: Sequence[Arm]) -> list[tuple[Robot, Joint]]:
    """Return the joints of some arms and hands with their robots, in the order of their chains; each once."""
    found: dict[tuple[str, str], tuple[Robot, Joint]] = {}
    for arm in arms:
        for joint in arm.robot.model.chain(arm.tool):
            if joint.name in arm.joint_names:
                found.setdefault((arm.robot.name, joint.name), (arm.robot, joint))
    for arm in hands:
        model = arm.robot.model
        sources = {model.joint_names.index(name) for name in arm.hand.joints}
        own = [joint for joint in model.joints if joint.source in sources]
        for joint in sorted(own, key=lambda j: len(model.chain(model.link_names[j.child]))):
            found.setdefault((arm.robot.name, joint.name), (arm.robot, joint))
    return list(found.values())


def _links(robot: Robot, values: Array) -> Array:
    """Return the poses (L, 4, 4) of the links of a robot in the world."""
    return robot.T_world_base @ robot.model.forward(values)


def _across(vectors: Array, axis: Array) -> Array:
    """Return the parts of vectors (..., 3) perpendicular to a unit axis."""
    return vectors - (vectors @ axis)[..., None] * axis
