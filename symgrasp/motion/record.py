"""Motions as plan files have them, and back."""

from __future__ import annotations

import numpy as np

from symgrasp.motion.segments import Motion, Segment
from symgrasp.plan.motion_record import MotionRecord, SegmentRecord
from symgrasp.plan.plan import Plan
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

__all__ = ["from_plan", "to_record", "with_motion"]


def with_motion(plan: Plan, motion: Motion) -> Plan:
    """Return a plan with a timed motion."""
    return plan.model_copy(
        update={"schema_version": max(2, plan.schema_version), "motion": to_record(motion)}
    )


def to_record(motion: Motion) -> MotionRecord:
    """Write down a timed motion."""
    used = dict.fromkeys(name for segment in motion.segments for name in segment.joints)
    return MotionRecord(
        joint_names={name: motion.scene.arms[name].joint_names for name in used},
        duration=motion.duration,
        segments=tuple(_segment_record(segment) for segment in motion.segments),
    )


def _segment_record(segment: Segment) -> SegmentRecord:
    assert segment.times is not None, "not timed"
    times = segment.times
    return SegmentRecord(
        kind=segment.kind,
        task_from=segment.task_from,
        task_to=segment.task_to,
        held_by=segment.held_by,
        gripper=dict(segment.gripper),
        clearance=segment.clearance,
        times=tuple(times.tolist()),
        joints={name: _rows(path) for name, path in segment.joints.items()},
        velocities={name: _rows(_slopes(times, path)) for name, path in segment.joints.items()},
    )


def _rows(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())


def _slopes(times: Array, path: Array) -> Array:
    """Return the rates (n, dof) of a path: slopes of the parabolas through three rows, zero at both ends."""
    slopes = np.zeros_like(path)
    if len(path) > 2:
        slopes[1:-1] = np.gradient(path, times, axis=0)[1:-1]
    return slopes


def from_plan(plan: Plan, scene: Scene) -> Motion | None:
    """Return the motion of a plan, None where it has none.

    Args:
        plan: the plan.
        scene: its scene.
    """
    if plan.motion is None:
        return None
    poses = [task.object_pose_turned.array() for task in plan.tasks]
    segments = tuple(
        Segment(
            kind=segment.kind,
            arms=tuple(segment.joints),
            joints={name: np.array(rows) for name, rows in segment.joints.items()},
            times=np.array(segment.times),
            gripper=dict(segment.gripper),
            held_by=segment.held_by,
            task_from=segment.task_from,
            task_to=segment.task_to,
            clearance=segment.clearance,
        )
        for segment in plan.motion.segments
    )
    return Motion(scene, poses, segments)
