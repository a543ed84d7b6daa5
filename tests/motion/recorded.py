"""A plan with a motion: pick, pour and place of the Panda, from a file with the corners of its paths."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from symgrasp.motion.record import with_motion
from symgrasp.motion.segments import Motion, Segment
from symgrasp.motion.times.timing import timed
from symgrasp.plan.plan import Plan
from symgrasp.scene.scene import Scene

__all__ = ["recorded_motion", "recorded_plan"]

FILE = Path(__file__).parent.parent / "data/pick_pour_place_motion.json"


@cache
def _read() -> tuple[Plan, Motion]:
    content = json.loads(FILE.read_text(encoding="utf-8"))
    plan = Plan.model_validate(content["plan"])
    scene = Scene.from_content(plan.scene.content)
    segments = []
    for entry in content["segments"]:
        joints = {name: np.array(rows) for name, rows in entry.pop("joints").items()}
        gripper = {name: tuple(opening) for name, opening in entry.pop("gripper").items()}
        held_by = tuple(entry.pop("held_by"))
        segments.append(Segment(arms=tuple(joints), joints=joints, gripper=gripper, held_by=held_by, **entry))
    poses = [task.object_pose_turned.array() for task in plan.tasks]
    return plan, timed(Motion(scene, poses, tuple(segments)))


def recorded_motion() -> Motion:
    """Return the motion, timed."""
    return _read()[1]


@cache
def recorded_plan() -> Plan:
    """Return the plan with the motion."""
    plan, motion = _read()
    return with_motion(plan, motion)
