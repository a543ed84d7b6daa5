"""Whether poses of a plan are rigid, agree with each other and with the scene."""

from __future__ import annotations

import math

import numpy as np

from symgrasp.plan.plan import PlanTask, Pose
from symgrasp.plan.report import Report
from symgrasp.poses import Array, from_position_quat, pose_error, rotation_z
from symgrasp.scene.scene import Scene

__all__ = ["TOLERANCE", "check_pose", "check_poses", "same_pose"]

TOLERANCE = 1e-6
"""By how much (m, rad) poses may differ that should be the same."""


def check_poses(task: PlanTask, where: str, scene: Scene, report: Report) -> bool:
    """Check the poses of the object in a task; return whether they hold."""
    ok = all(
        check_pose(pose, f"{where}: {name}", report)
        for name, pose in (("object_pose", task.object_pose), ("object_pose_turned", task.object_pose_turned))
    )
    if task.name in scene.tasks:
        given = scene.tasks[task.name].T_world_object
        ok &= same_pose(task.object_pose.array(), given, f"{where}: object_pose", report)
    turned = task.object_pose.array() @ rotation_z(task.delta)
    return ok & same_pose(task.object_pose_turned.array(), turned, f"{where}: turned pose", report)


def check_pose(pose: Pose, where: str, report: Report) -> bool:
    """Check that a pose is rigid, and that its two spellings agree."""
    matrix = pose.array()
    rotation = matrix[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that no rotation has
        rigid = np.abs(rotation.T @ rotation - np.eye(3)).max() < TOLERANCE and np.linalg.det(rotation) > 0
    rigid &= np.array_equal(matrix[3], [0, 0, 0, 1])
    if not report.expect(rigid, f"{where}: the matrix is no rigid pose"):
        return False
    length = math.hypot(*pose.quat_wxyz)
    if not report.expect(abs(length - 1) < TOLERANCE, f"{where}: the quaternion has length {length:.7f}"):
        return False
    spelled = from_position_quat(pose.position, pose.quat_wxyz)
    return same_pose(spelled, matrix, f"{where}: quaternion", report)


def same_pose(a: Array, b: Array, where: str, report: Report, leeway: float = 0.0) -> bool:
    """Check that two poses (4, 4) are the same; ``where`` says what they are.

    They may differ by a leeway (rad, and m at a decimetre) beyond the tolerance.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of positions that no robot reaches
        distance, angle = (float(e) for e in pose_error(a, b))
    text = f"{where}: off by {1e3 * distance:.4f} mm and {np.rad2deg(angle):.5f}°"
    return report.expect(distance <= TOLERANCE + 0.1 * leeway and angle <= TOLERANCE + leeway, text)
