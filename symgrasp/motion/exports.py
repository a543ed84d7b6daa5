"""Motions in the formats of other tools: ROS actions, and a table over time."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from symgrasp.errors import PlanError
from symgrasp.motion.moveit import to_planning_scene, to_srdf
from symgrasp.motion.record import from_plan
from symgrasp.motion.segments import Motion
from symgrasp.page import page_module
from symgrasp.plan.motion_record import MotionRecord
from symgrasp.plan.plan import Plan
from symgrasp.poses import quat_wxyz
from symgrasp.scene.scene import Scene

__all__ = ["MOTION_EXPORTS", "to_actions", "to_html", "to_table"]


def to_actions(plan: Plan) -> str:
    """Return JSON with the goals of ROS actions for each arm, all counted from one start.

    ``trajectory`` is shaped like that of ``control_msgs/FollowJointTrajectory``: positions, velocities and
    times of the whole motion; between two points that are apart in time the arm rests. ``gripper`` lists
    when a hand begins to move, how long it takes, and the goal like ``control_msgs/GripperCommand``, whose
    position is the distance (m) between the finger pads, with the values of the hand's joints beside it.

    Raises:
        PlanError: the plan has no motion.
    """
    record = _record(plan)
    scene = Scene.from_content(plan.scene.content, "plan: scene.content")
    arms = {}
    for name, joints in record.joint_names.items():
        points: list[dict[str, Any]] = []
        commands = []
        start = 0.0
        for segment in record.segments:
            rows = zip(
                segment.times, segment.joints.get(name, ()), segment.velocities.get(name, ()), strict=False
            )
            for t, positions, velocities in rows:
                stamp = _stamp(start + t)
                if not points or points[-1]["time_from_start"] != stamp:  # a segment begins where one ended
                    points.append(_point(positions, velocities, stamp))
            if name in segment.gripper:
                opening = segment.gripper[name][1]
                command = {
                    "time_from_start": _stamp(start),
                    "duration": _stamp(segment.times[-1]),
                    "goal": {"command": {"position": opening, "max_effort": 0.0}},
                    "joints": scene.arm(name).hand.joint_values(opening),
                }
                commands.append(command)
            start += segment.times[-1]
        trajectory = {"header": {"frame_id": "world"}, "joint_names": list(joints), "points": points}
        arms[name] = {"trajectory": trajectory, "gripper": commands}
    return json.dumps(arms, indent=1, ensure_ascii=False) + "\n"


def _point(
    positions: tuple[float, ...], velocities: tuple[float, ...], stamp: dict[str, int]
) -> dict[str, Any]:
    return {
        "positions": list(positions),
        "velocities": list(velocities),
        "accelerations": [],
        "effort": [],
        "time_from_start": stamp,
    }


def _stamp(seconds: float) -> dict[str, int]:
    """Return a time (s) as ROS writes it."""
    nanoseconds = round(seconds * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def to_table(plan: Plan) -> str:
    """Return a line of CSV for each moment: time (s), segment, kind, all joints, and the object's pose.

    The columns of joints are called ``robot/joint`` (rad or m), those of the object ``object/x`` to
    ``object/qz`` (m, wxyz quaternion).

    Raises:
        PlanError: the plan has no motion.
    """
    _record(plan)
    motion = from_plan(plan, Scene.from_content(plan.scene.content, "plan: scene.content"))
    assert motion is not None
    buffer = io.StringIO()
    rows = csv.writer(buffer, lineterminator="\n")
    joints = [f"{name}/{j}" for name, robot in motion.scene.robots.items() for j in robot.model.joint_names]
    pose = [f"object/{part}" for part in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    rows.writerow(["time", "segment", "kind", *joints, *pose])
    for t, k in _moments(motion):
        state = motion.at(t)
        values = np.concatenate(list(state.values.values()))
        placed = [*state.T_world_object[:3, 3], *quat_wxyz(state.T_world_object)]
        numbers = [repr(float(number)) for number in (*values, *placed)]
        rows.writerow([repr(t), k + 1, motion.segments[k].kind, *numbers])
    return buffer.getvalue()


def _moments(motion: Motion) -> list[tuple[float, int]]:
    """Return the times (s) of all rows with the index of the segment that they begin or are in."""
    found: list[tuple[float, int]] = []
    for k, (start, segment) in enumerate(zip(motion.starts, motion.segments, strict=False)):
        assert segment.times is not None
        found += [(float(start + t), k) for t in segment.times[:-1]]
    return [*found, (motion.duration, len(motion.segments) - 1)]


def to_html(plan: Plan) -> str:
    """Return an HTML document that plays the motion in 3D; it needs no server and no network.

    Raises:
        PlanError: the plan has no motion.
        SymgraspError: the page is not installed.
    """
    _record(plan)
    scene = Scene.from_content(plan.scene.content, "plan: scene.content")
    return page_module("server.notebook").plan_document(plan, scene, plan.maps(scene))


def _record(plan: Plan) -> MotionRecord:
    if plan.motion is None:
        raise PlanError("plan", "motion", None, "a plan with a motion: symgrasp plan … --motion")
    return plan.motion


MOTION_EXPORTS: Mapping[str, Callable[[Plan], str]] = {
    "motion": to_actions,
    "motion-csv": to_table,
    "html": to_html,
    "moveit-scene": to_planning_scene,
    "srdf": to_srdf,
}
"""Name of the format → what writes it."""
