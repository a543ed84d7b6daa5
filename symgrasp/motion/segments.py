"""What a motion is: a row of segments, and where everything is at each moment of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Literal

import numpy as np

from symgrasp.poses import Array, inverse
from symgrasp.scene.scene import Scene

__all__ = ["Kind", "Motion", "MotionState", "Opening", "Segment"]

Kind = Literal["reach", "approach", "close", "lift", "carry", "lower", "open", "retreat", "home"]

Opening = tuple[float | None, float]
"""Opening (m) of a hand at the start and at the end of a segment; None where it starts as at home."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a motion in which the same arms move, and the same arms hold the object.

    Attributes:
        kind: what it is for.
        arms: names of the arms that move, or whose hands do; all others stay where they are.
        joints: arm → values (n, dof) (rad or m) of ``arm.joint_names`` along the path, which is straight
            between two rows. All arms have the same n; where only hands move, n is 2 and both rows are equal.
        times: (n,) s from the segment's start, strictly increasing from 0; None before timing.
        gripper: arm → opening of its hand, of which the hand's joints follow as `Hand.joint_values` says;
            they move in proportion to time. Hands without an entry stay as they are.
        held_by: names of the arms in whose hands the object is fixed; not those that close or open them.
        task_from: the task at whose pose the object is at the start.
        task_to: the same at the end.
        clearance: smallest distance (m) proven along it of bodies that may not touch; while the object is
            lifted or lowered, it may touch what it rests on.
        room: how far (m) any point may be off the path, besides, before the object sinks into what it rests
            on, or a robot falls.
        tilt_room: by what angle (rad) the object may tilt further than it does along the path.
    """

    kind: Kind
    arms: tuple[str, ...]
    joints: Mapping[str, Array]
    times: Array | None = None
    gripper: Mapping[str, Opening] = field(default_factory=dict)
    held_by: tuple[str, ...] = ()
    task_from: str = ""
    task_to: str = ""
    clearance: float = 0.0
    room: float = np.inf
    tilt_room: float = np.inf

    @property
    def duration(self) -> float:
        """How long (s) it takes."""
        assert self.times is not None, "not timed"
        return float(self.times[-1])


@dataclass(frozen=True, eq=False)
class MotionState:
    """Where everything is at one moment.

    Attributes:
        values: robot → values (N,) of all its joints.
        T_world_object: pose (4, 4) of the object.
        segment: index of the segment.
    """

    values: Mapping[str, Array]
    T_world_object: Array
    segment: int


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of all arms of a scene. It begins with all robots at home.

    Attributes:
        scene: the scene.
        poses: (4, 4) of the object in the tasks of the plan, turned as that says; at the first one it starts.
        segments: one after the other, at least one.
    """

    scene: Scene
    poses: Sequence[Array]
    segments: tuple[Segment, ...]

    @cached_property
    def starts(self) -> tuple[float, ...]:
        """When (s) each segment starts, and at last when the motion ends."""
        return tuple(accumulate((s.duration for s in self.segments), initial=0.0))

    @property
    def duration(self) -> float:
        """How long (s) the motion takes."""
        return self.starts[-1]

    def at(self, t: float) -> MotionState:
        """Return the state at a time (s); before the start the first one, after the end the last."""
        k = int(np.searchsorted(self.starts[1:-1], t, side="right"))
        segment = self.segments[k]
        assert segment.times is not None
        local = float(np.clip(t - self.starts[k], 0.0, segment.duration))
        row = np.interp(local, segment.times, np.arange(len(segment.times)))
        return self.state(k, float(row), local / segment.duration)

    def state(self, index: int, row: float, share: float) -> MotionState:
        """Return the state between two rows of a segment, timed or not.

        Args:
            index: of the segment.
            row: of its joint values, fractions between two of them.
            share: how much of the movement of the hands is done, 0 to 1.
        """
        segment, start = self.segments[index], self._start_values[index]
        pose = self._start_poses[index]
        values = {name: robot.copy() for name, robot in start.items()}
        for name, path in segment.joints.items():
            arm = self.scene.arms[name]
            before = min(int(row), len(path) - 1)
            after = min(before + 1, len(path) - 1)
            values[arm.robot.name][arm.indices] = path[before] + (row - before) * (path[after] - path[before])
        for name, opening in segment.gripper.items():
            self._set_hand(values, start, name, opening, share)
        return MotionState(values, self._moved(segment, start, values) @ pose, index)

    def _set_hand(
        self,
        values: Mapping[str, Array],
        start: Mapping[str, Array],
        name: str,
        opening: Opening,
        share: float,
    ) -> None:
        """Set the joints of a hand in ``values``, where they were ``start`` when the segment started."""
        arm = self.scene.arms[name]
        first, last = opening
        target = arm.hand.joint_values(last if first is None else first + share * (last - first))
        for joint, value in target.items():
            k = arm.robot.model.joint_names.index(joint)
            was = start[arm.robot.name][k]
            values[arm.robot.name][k] = was + share * (value - was) if first is None else value

    def _moved(self, segment: Segment, start: Mapping[str, Array], values: Mapping[str, Array]) -> Array:
        """Return how (4, 4), in the world, a segment has moved the object since joint values ``start``."""
        if not segment.held_by:
            return np.eye(4)
        holder = segment.held_by[0]
        return self._tool(holder, values) @ inverse(self._tool(holder, start))

    def _tool(self, name: str, values: Mapping[str, Array]) -> Array:
        """Return ``T_world_tool`` (4, 4) of an arm."""
        return self.scene.arms[name].tool_at(values[self.scene.arms[name].robot.name])

    @cached_property
    def _start_values(self) -> tuple[Mapping[str, Array], ...]:
        """Of each segment, robot → values of its joints where it starts."""
        values = {name: robot.home for name, robot in self.scene.robots.items()}
        starts = []
        for segment in self.segments:
            starts.append(values)
            values = {name: robot.copy() for name, robot in values.items()}
            for name, path in segment.joints.items():
                arm = self.scene.arms[name]
                values[arm.robot.name][arm.indices] = path[-1]
            for name, opening in segment.gripper.items():
                self._set_hand(values, starts[-1], name, opening, 1.0)
        return tuple(starts)

    @cached_property
    def _start_poses(self) -> tuple[Array, ...]:
        """Of each segment, the pose (4, 4) of the object where it starts."""
        pose, found = self.poses[0], []
        values = self._start_values
        for segment, start, end in zip(self.segments, values, (*values[1:], values[-1]), strict=True):
            if not segment.held_by:  # where it was put down, exactly: a task may be done at several turns
                pose = min(self.poses, key=lambda T, last=pose: float(np.abs(T - last).max()))
            found.append(pose)
            pose = self._moved(segment, start, end) @ pose
        return tuple(found)
