"""Robots placed in the world, and their arms: the kinematic chains that grasp."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import InputError, UrdfError, one_of
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.object.profile import Profile
from symgrasp.poses import Array, from_rotation, inverse, rotation_about
from symgrasp.robot.hand import Hand
from symgrasp.robot.handprint import Handprint, handprint
from symgrasp.robot.joint import Joint
from symgrasp.robot.limits import values_inside
from symgrasp.robot.model import RobotModel
from symgrasp.robot.pitch import SAME_PITCH, STEEPEST, pitch_range
from symgrasp.robot.torso import Torso

__all__ = ["AZIMUTH", "DEFAULT_ACCELERATION", "PITCH", "Arm", "Robot"]

PITCH, AZIMUTH = 5, 6
"""Where pitch and azimuth are among the values of a pitched arm."""

DEFAULT_ACCELERATION = 2.0
"""Largest acceleration (rad/s² or m/s²) of joints where a scene states none: about the least that MoveIt's
configuration of the Panda gives a joint (1.875)."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot placed in the world.

    Attributes:
        name: its name in the scene.
        model: its URDF.
        T_world_base: pose (4, 4) of the root link.
        home: parked joint values (n,) of ``model.joint_names``.
        torso: the joints before the arms that maps sample; None where they stay at home.
        support: corners (k, 2) in the world, counterclockwise, of the convex area that its centre of mass
            must stay above; None where it cannot fall.
        acceleration: largest acceleration (rad/s² or m/s²) of its joints.
        fastest: largest speed (rad/s or m/s) of joints for which its URDF allows more.
    """

    name: str
    model: RobotModel
    T_world_base: Array
    home: Array
    torso: Torso | None = None
    support: Array | None = None
    acceleration: float = DEFAULT_ACCELERATION
    fastest: float = np.inf

    @property
    def velocity(self) -> Array:
        """Largest speeds (n,) (rad/s or m/s) of ``model.joint_names``."""
        return np.minimum(self.model.velocity, self.fastest)

    def at(self, sample: int) -> Robot:
        """Return the robot whose torso rests at a sample."""
        assert self.torso is not None
        home = self.home.copy()
        home[self.torso.indices] = self.torso.values[sample]
        return replace(self, home=home, torso=None)


class Arm:
    """The kinematic chain from a robot's base to a tool with a hand.

    All other joints of the robot stay at home, also prismatic joints of the chain and those that it
    shares with another arm. Kinematics is a product of exponentials read off the URDF:
    ``T_base_tool(q) = Trans(P0)·Rot(H0, q0)·Trans(P1)· … ·Rot(Hn-1, qn-1)·Trans(Pn)·R0``.
    Where the robot has a torso, its joints come first among the arm's, and `at` is the arm alone.

    Five joints cannot set all of a tool pose. Such an arm is `pitched`: two more values, as of joints
    beyond the tool, turn the *grasp frame*, which the grasp sets, against the tool. Their axes go through the
    point of the object's axis that the hand is at: the pitch turns about the tangent, which is the closing
    direction (y), so that the fingers stay at the same two points of the object; the azimuth about the axis
    of the object (x), within a cell of the map. `tool_pose` is then the pose of the grasp frame, and
    `grasping` is the arm with the axes and the limits that a grasp gives these two.

    Args:
        name: its name in the scene.
        robot: the robot that it belongs to.
        tool: the tool link.
        hand: the hand at the tool.
        shared: joints of the chain that are not the arm's: shared with another arm, or of the torso.

    Raises:
        UrdfError: the tool, a hand link or a hand joint is not in the URDF, the chain has not 5, 6 or
            7 revolute joints, or a joint has no limits; the robot of an arm of five has a torso or a support.

    Attributes:
        joint_names: its joints, from base to tool, those of the torso included.
        indices: (.,) their indices into the robot's joint values.
        pitched: whether it has five joints, and its n values are theirs, pitch and azimuth.
        pitch: pitch (rad) that the hand is held at, positive with the palm above; None where it is free.
        lower: limits (n,) of its values, -inf for a continuous joint.
        upper: limits (n,), inf for a continuous joint.
        H: unit axes (., 3) in the base frame at zero, of the joints after the torso, which is at home.
        P: offsets (. + 1, 3) between points on successive axes, at zero.
        R0: orientation (3, 3) of the tool at zero.
    """

    def __init__(
        self, name: str, robot: Robot, tool: str, hand: Hand, shared: frozenset[str] = frozenset()
    ) -> None:
        model = robot.model
        if tool not in model.link_names:
            raise UrdfError(model.path, "tool", tool, one_of(model.link_names, tool))
        for link in (*hand.links, *hand.touch_links):
            if link not in model.link_names:
                raise UrdfError(model.path, f"hand {hand.name}: link", link, one_of(model.link_names, link))
        for joint in hand.joints:
            if joint not in model.joint_names:
                raise UrdfError(
                    model.path, f"hand {hand.name}: joint", joint, one_of(model.joint_names, joint)
                )
        self.name, self.robot, self.tool, self.hand = name, robot, tool, hand
        self._shared = shared
        self._at: dict[int, Arm] = {}
        torso = robot.torso.joint_names if robot.torso else ()
        resting = {*shared, *hand.joints, *torso}
        joints = [
            j
            for j in model.chain(tool)
            if j.name in model.joint_names and j.kind != "prismatic" and j.name not in resting
        ]
        names = [j.name for j in joints]
        if len(joints) not in (5, 6, 7):
            raise UrdfError(model.path, f"arm {name}", names, _joints_expected(len(joints)))
        self.pitched, self.pitch, self._way = len(joints) == 5, None, 1.0
        if self.pitched and (torso or robot.support is not None):
            expected = f"6 or 7 revolute joints on a robot with a {'torso' if torso else 'support'}"
            raise UrdfError(model.path, f"arm {name}", names, expected)
        self.joint_names = (*torso, *(j.name for j in joints))
        model.check_limits((*self.joint_names, *hand.joints))
        self.indices = np.array([model.joint_names.index(n) for n in self.joint_names])
        for j in model.chain(tool):
            if j.source in self.indices[len(torso) :] and j.name not in self.joint_names:
                followed = model.joint_names[j.source]
                raise UrdfError(
                    model.path, f"joint {j.name}: mimic", followed, "an arm of independent joints"
                )
        self.lower, self.upper = model.lower[self.indices], model.upper[self.indices]
        self.H, self.P, self.R0 = self._screws(joints)
        if self.pitched:
            self.H = np.concatenate([self.H, self.R0[:, [1, 0]].T])
            self.P = np.concatenate([self.P, np.zeros((2, 3))])
            self.lower = np.append(self.lower, [-STEEPEST, -np.pi])
            self.upper = np.append(self.upper, [STEEPEST, np.pi])

    def _screws(self, joints: list[Joint]) -> tuple[Array, Array, Array]:
        """Return H, P and R0, with the joints of the arm at zero and all others at home."""
        q = self.robot.home.copy()
        q[self.indices[-len(joints) :]] = 0.0
        links = self.robot.model.forward(q)
        frames = [links[j.child] for j in joints]
        points = [np.zeros(3), *(frame[:3, 3] for frame in frames), links[self._tool_index][:3, 3]]
        H = np.array([frame[:3, :3] @ joint.axis for frame, joint in zip(frames, joints, strict=True)])
        return H, np.diff(points, axis=0), links[self._tool_index][:3, :3]

    def on(self, robot: Robot) -> Arm:
        """Return the arm as it is on the same robot at another place."""
        return Arm(self.name, robot, self.tool, self.hand, self._shared)

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of the attributes to pickle: another thread may cache one meanwhile."""
        return self.__dict__.copy()

    @cached_property
    def _tool_index(self) -> int:
        return self.robot.model.link_index(self.tool)

    @property
    def dof(self) -> int:
        """Number n of the values of a configuration: joints, and for a pitched arm pitch and azimuth."""
        return len(self.lower)

    @property
    def value_names(self) -> tuple[str, ...]:
        """What these values are called."""
        return (*self.joint_names, "pitch", "azimuth") if self.pitched else self.joint_names

    @property
    def velocity(self) -> Array:
        """Largest speeds (n,) (rad/s or m/s) of its values; those that move no joint have none."""
        return np.append(self.robot.velocity[self.indices], np.full(self.dof - len(self.indices), np.inf))

    @property
    def home(self) -> Array:
        """Parked values (n,) of the arm."""
        return np.append(self.robot.home[self.indices], np.zeros(self.dof - len(self.indices)))

    def grasping(self, manifold: Manifold, row: int, roll: int) -> Arm:
        """Return the arm for the grasps of a row and roll of a grid: itself unless it is pitched.

        Args:
            manifold: the grid.
            row: height index.
            roll: index into `ROLLS`.
        """
        return self.grasping_at(manifold.profile, float(manifold.h[row]), roll, 0.5 * manifold.dtheta)

    def grasping_at(self, profile: Profile, h: float, roll: int, azimuth: float) -> Arm:
        """Return the arm for the grasps at a height and roll: itself unless it is pitched.

        Args:
            profile: the object.
            h: the height (m).
            roll: index into `ROLLS`.
            azimuth: how far (rad) to either side of the grasp it may hold.
        """
        if not self.pitched:
            return self
        radius = float(profile.radius(h))
        low, high = pitch_range(self.hand, profile, h)
        axis = (float(self.hand.shift_at(radius)), self.hand.standoff(radius))
        if self.pitch is not None:
            low, high = max(low, self.pitch - SAME_PITCH), min(high, self.pitch + SAME_PITCH)
        other = self.pitching(axis, (low, high) if roll == 0 else (-high, -low), azimuth)
        other._way = _way(roll)
        return other

    def at_pitch(self, pitch: float) -> Arm:
        """Return a pitched arm whose hand is held at a pitch (rad), positive with the palm above."""
        assert self.pitched
        other = copy(self)
        other.pitch = pitch
        return other

    @property
    def pitch_value(self) -> float | None:
        """What stands for `pitch` among the values of a configuration (rad), for the roll of `grasping`."""
        return None if self.pitch is None else self._way * self.pitch

    def pitch_and_azimuth(self, q: Array, roll: int) -> tuple[float, float]:
        """Return how a pitched arm holds at values (n,): zeros for other arms.

        Args:
            q: its values.
            roll: index into `ROLLS`.

        Returns:
            The pitch (rad), positive with the palm above, and by how much (rad) the angle about the object's
            axis is larger than that of the grasp frame.
        """
        if not self.pitched:
            return 0.0, 0.0
        return _way(roll) * float(q[PITCH]), -_way(roll) * float(q[AZIMUTH])

    def pitching(self, axis: tuple[float, float], pitch: tuple[float, float], azimuth: float) -> Arm:
        """Return a pitched arm with other axes and limits of pitch and azimuth.

        Args:
            axis: y and z (m) of the tool frame where the axis of the object is.
            pitch: limits (rad) of the pitch about the tool's y.
            azimuth: largest azimuth (rad) to either side.
        """
        assert self.pitched
        other = copy(self)
        to_axis = self.R0[:, 1:] @ axis
        other.P = self.P.copy()
        other.P[5], other.P[7] = self.P[5:].sum(axis=0) + to_axis, -to_axis
        other.lower = np.append(self.lower[:5], [pitch[0], -azimuth])
        other.upper = np.append(self.upper[:5], [pitch[1], azimuth])
        return other

    def at(self, sample: int) -> Arm:
        """Return the arm alone, with the torso at a sample: its joints are those after the torso's."""
        if sample not in self._at:
            assert self.robot.torso is not None
            shared = self._shared | frozenset(self.robot.torso.joint_names)
            self._at[sample] = Arm(self.name, self.robot.at(sample), self.tool, self.hand, shared)
        return self._at[sample]

    def with_torso(self, sample: int, q: Array) -> Array:
        """Return joint values (..., n) of the arm, from those of the arm alone at a sample of the torso."""
        assert self.robot.torso is not None
        torso = self.robot.torso.values[sample]
        return np.concatenate([np.broadcast_to(torso, (*q.shape[:-1], len(torso))), q], axis=-1)

    def tool_pose(self, q: ArrayLike) -> Array:
        """Return ``T_base_tool`` (..., 4, 4) for values (..., n): of the grasp frame if pitched."""
        q = np.asarray(q, dtype=float)
        if self.robot.torso is not None:
            values = np.broadcast_to(self.robot.home, (*q.shape[:-1], len(self.robot.home))).copy()
            values[..., self.indices] = q
            return self.robot.model.link_pose(values, self.tool)
        rotation = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
        position = np.broadcast_to(self.P[0], (*q.shape[:-1], 3))
        for k, axis in enumerate(self.H):
            rotation = rotation @ rotation_about(axis, q[..., k])
            position = position + rotation @ self.P[k + 1]
        return from_rotation(rotation @ self.R0, position)

    def world_tool_pose(self, q: ArrayLike) -> Array:
        """Return ``T_world_tool`` (..., 4, 4) for joint values (..., n)."""
        return self.robot.T_world_base @ self.tool_pose(q)

    def tool_at(self, values: ArrayLike) -> Array:
        """Return ``T_world_tool`` (..., 4, 4) for values (..., N) of all joints of its robot."""
        return self.robot.T_world_base @ self.robot.model.link_pose(values, self.tool)

    def within_limits(self, q: ArrayLike) -> tuple[Array, np.ndarray]:
        """Add full turns to joint values (..., n) so that they are inside the limits, where possible.

        Each value is brought nearest to the middle of its range, which is inside whenever any full turn
        is. One beyond a limit by at most `LIMIT_TOLERANCE` is inside; where all are, it is moved onto the
        limit.

        Returns:
            The joint values (..., n) with the turns added, and whether all n are inside (...).
        """
        q = np.asarray(q, dtype=float)
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = np.where(
            bounded, 0.5 * (np.where(bounded, self.lower, 0) + np.where(bounded, self.upper, 0)), 0
        )
        q = q + 2 * np.pi * np.round((middle - q) / (2 * np.pi))
        inside = np.all(self.value_inside(q), axis=-1, keepdims=True)
        return np.where(inside, np.clip(q, self.lower, self.upper), q), inside[..., 0]

    def value_inside(self, q: Array) -> np.ndarray:
        """Whether values (..., n) are inside their limits, or beyond by at most `LIMIT_TOLERANCE`."""
        return values_inside(q, self.lower, self.upper)

    def in_cell(self, q: Array) -> np.ndarray:
        """Whether values (..., n) grasp in the cell that is meant: not with an azimuth beyond its edge."""
        if not self.pitched:
            return np.ones(q.shape[:-1], dtype=bool)
        return self.value_inside(q)[..., AZIMUTH]

    def robot_values(self, q: ArrayLike, opening: float | None = None) -> Array:
        """Return values (N,) of all the robot's joints: this arm at ``q`` (n,), the rest at home.

        Args:
            q: values of the arm; pitch and azimuth move no joint.
            opening: opening (m) of the hand; None leaves the hand at home.
        """
        values = self.robot.home.copy()
        values[self.indices] = np.asarray(q, dtype=float)[: len(self.indices)]
        if opening is not None:
            for joint, value in self.hand.joint_values(opening).items():
                values[self.robot.model.joint_names.index(joint)] = value
        return values

    def hand_hulls(self, opening: float, only: Sequence[str] | None = None) -> list[Array]:
        """Return the vertices (n, 3) of the hand's convex hulls in the tool frame at an opening (m).

        Args:
            opening: the opening (m).
            only: the links; those of the hand if None.

        Raises:
            InputError: no link of the hand has a collision shape.
        """
        model = self.robot.model
        links = model.forward(self.robot_values(self.home, opening))
        T_tool_base = inverse(links[self._tool_index])
        hulls = []
        for link in self.hand.links if only is None else only:
            pose = T_tool_base @ links[model.link_index(link)]
            hulls += [points @ pose[:3, :3].T + pose[:3, 3] for points in model.hulls(link)]
        if not hulls:
            raise InputError(model.path, f"hand {self.hand.name}", list(self.hand.links), "links with bodies")
        return hulls

    def handprint(
        self, manifold: Manifold, row: int, roll: int, pitch: float = 0.0, theta: float = 0.0
    ) -> Handprint:
        """Return the handprint of a grasp at column 0, with the opening for the radius at that row.

        Args:
            manifold: the grid.
            row: height index of the grasp.
            roll: index into `ROLLS`.
            pitch: pitch (rad) of the hand; see `Hand.tool_pose`.
            theta: by how much (rad) the angle about the axis is larger than that of the middle of the column.
        """
        radius = float(manifold.profile.radius(manifold.h[row]))
        hulls = self.hand_hulls(self.hand.opening(radius))
        T_object_tool = self.hand.tool_pose(np.eye(4), manifold.h[row], theta, ROLLS[roll], radius, pitch)
        return handprint(hulls, manifold, T_object_tool)


def _way(roll: int) -> float:
    """Return 1 where a turn about the tool's y raises the palm, -1 where it lowers it, by index of roll."""
    return 1.0 if roll == 0 else -1.0


def _joints_expected(count: int) -> str:
    """Return what is expected of an arm, and what it lacks that has not so many joints."""
    expected = f"5 to 7 revolute joints, not {count}"
    if count >= 5:
        return expected
    return f"{expected}; fewer set the position of the hand, but not the direction of its approach"
