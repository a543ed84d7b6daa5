"""Plans in the formats of other tools: CSV, ROS joint trajectories, task space regions."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import yaml

from symgrasp.plan.plan import Hold, Plan
from symgrasp.robot.pitch import holds_at
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene

__all__ = ["EXPORTS", "to_csv", "to_trajectories", "to_tsr"]

SECONDS_PER_TASK = 1
"""Trajectories get a point a task, this far apart; a plan says where to be, not how fast."""


def to_csv(plan: Plan) -> str:
    """Return a line for each joint of each arm in each task: step, task, arm, joint, value (rad or m).

    Steps count the plan's tasks from 1: a regrasp visits the task where the object stands twice.
    """
    buffer = io.StringIO()
    rows = csv.writer(buffer, lineterminator="\n")
    rows.writerow(["step", "task", "arm", "joint", "value"])
    for step, task in enumerate(plan.tasks, start=1):
        for hold in task.holds:
            for name, value in {**hold.joints, **hold.hand_joints}.items():
                rows.writerow([step, task.name, hold.arm, name, repr(value)])
    return buffer.getvalue()


def to_trajectories(plan: Plan) -> str:
    """Return JSON shaped like ROS ``trajectory_msgs/JointTrajectory``, one message an arm.

    Each task is a point of the arms that hold the object in it. The points are goals for a motion
    planner such as MoveIt, not a motion to be played.
    """
    trajectories: dict[str, dict[str, Any]] = {}
    for k, task in enumerate(plan.tasks, start=1):
        for hold in task.holds:
            message = trajectories.setdefault(
                hold.arm, {"header": {"frame_id": "world"}, "joint_names": list(hold.joints), "points": []}
            )
            point = {
                "positions": list(hold.joints.values()),
                "velocities": [],
                "accelerations": [],
                "effort": [],
                "time_from_start": {"sec": k * SECONDS_PER_TASK, "nanosec": 0},
            }
            message["points"].append(point)
    return json.dumps(trajectories, indent=2, ensure_ascii=False) + "\n"


def to_tsr(plan: Plan) -> str:
    """Return the family of each grasp as task space regions in YAML, one document a grasp.

    A region holds every tool pose ``T_world_object · T_ref_tsr · Rz(yaw)·Trans(0, 0, z) · Tw_e``
    with z and yaw inside Bw (rows x, y, z, roll, pitch, yaw): the whole turn about the object's
    axis, and the heights around the grasp, inside its margin in every task, that the hand can hold
    with the same opening. A margin that is counted in cells ends with the last feasible cell, half a
    cell before the middle of the infeasible one.
    """
    scene = Scene.from_content(plan.scene.content, "plan: scene.content")
    tightest: dict[tuple[str, float, float, float], Hold] = {}
    for hold in (hold for task in plan.tasks for hold in task.holds):
        key = hold.arm, hold.grasp.h, hold.grasp.roll, hold.grasp.pitch
        if _room_along(scene, hold) < _room_along(scene, tightest.setdefault(key, hold)):
            tightest[key] = hold
    regions = [_region(plan, scene, hold) for hold in tightest.values()]
    return yaml.safe_dump_all(regions, sort_keys=False, allow_unicode=True)


def _region(plan: Plan, scene: Scene, hold: Hold) -> dict[str, Any]:
    arm = scene.arm(hold.arm)
    radius = float(scene.profile.radius(hold.grasp.h))
    low, high = _height_range(scene, arm, hold)
    free, pitch = [0.0, 0.0], hold.grasp.pitch
    pitched = f", pitched by {np.rad2deg(pitch):.1f}°" if pitch else ""
    return {
        "name": f"{plan.scene.name}: {hold.arm}",
        "description": f"Grasps of {scene.file.object.name} with the {arm.hand.name} hand{pitched}",
        "task": "grasp",
        "subject": arm.hand.name,
        "reference": scene.file.object.name,
        "T_ref_tsr": np.eye(4).tolist(),
        "Tw_e": arm.hand.tool_pose(np.eye(4), 0.0, 0.0, hold.grasp.roll, radius, pitch).tolist(),
        "Bw": [free, free, [low, high], free, free, [-np.pi, np.pi]],
        "preshape": [hold.opening],
    }


def _room_along(scene: Scene, hold: Hold) -> float:
    """Return how far (m) a grasp may be off along the axis in cells that are feasible, or as is proven."""
    return hold.margin_along - (0.5 * scene.manifold.dh if hold.margins == "cells" else 0.0)


def _height_range(scene: Scene, arm: Arm, hold: Hold) -> tuple[float, float]:
    """Return the heights (m) around a grasp, inside its margin, that the same opening can hold."""
    profile, hand, h = scene.profile, arm.hand, hold.grasp.h
    radius = float(profile.radius(h))

    def same(height: float) -> bool:
        if not profile.h_min <= height <= profile.h_max or not hand.pads_rest(profile, height):
            return False
        if hold.grasp.pitch and not holds_at(hand, profile, height, hold.grasp.pitch):
            return False
        return abs(float(profile.radius(height)) - radius) <= hand.radius_tolerance

    ends = []
    for sign in (-1.0, 1.0):
        steps = h + sign * np.linspace(0.0, _room_along(scene, hold), 101)
        reached = next((k for k, height in enumerate(steps) if not same(float(height))), len(steps))
        ends.append(float(steps[max(reached - 1, 0)]))
    return ends[0], ends[1]


EXPORTS: Mapping[str, Callable[[Plan], str]] = {
    "csv": to_csv,
    "trajectory": to_trajectories,
    "tsr": to_tsr,
}
"""Name of the format → what writes it."""
