"""What a feasibility map depends on besides the arm and the task, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from symgrasp.object.profile import Profile
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.format import MapSettings
from symgrasp.scene.parts import Obstacle

__all__ = ["map_content"]


def map_content(
    robots: Mapping[str, Robot],
    arms: Mapping[str, Arm],
    object_name: str,
    profile: Profile,
    mass: float,
    obstacles: Sequence[Obstacle],
    settings: MapSettings,
) -> dict[str, Any]:
    """Write down what decides the maps of a scene; files are told by their SHA-256.

    Names are part of it, because maps name the bodies that collide. So is every robot and arm: the
    parked ones stand in the way of the one that grasps.

    Args:
        robots: name → robot.
        arms: name → arm, over all robots.
        object_name: what the object is called.
        profile: its r(h).
        mass: its mass (kg).
        obstacles: the fixed bodies.
        settings: how finely maps are computed, and the distances that must be kept.

    Returns:
        Plain data for JSON; lengths in m, angles in rad.
    """
    return {
        "robots": [_robot(robot) for robot in robots.values()],
        "arms": [_arm(arm) for arm in arms.values()],
        "object": {"name": object_name, "profile": profile.points.tolist(), "mass": mass},
        "obstacles": [_obstacle(obstacle) for obstacle in obstacles],
        "map": settings.model_dump(exclude_none=True),
    }


def _robot(robot: Robot) -> dict[str, Any]:
    return {
        "name": robot.name,
        "model": robot.model.sha256,
        "base": robot.T_world_base.tolist(),
        "home": robot.home.tolist(),
        "velocity": robot.velocity.tolist(),
        "support": None if robot.support is None else robot.support.tolist(),
        "torso": robot.torso and {"joints": robot.torso.joint_names, "values": robot.torso.values.tolist()},
    }


def _arm(arm: Arm) -> dict[str, Any]:
    return {
        "name": arm.name,
        "robot": arm.robot.name,
        "tool": arm.tool,
        "joints": arm.joint_names,
        "hand": asdict(arm.hand),
    }


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    return {
        "name": obstacle.name,
        "kind": obstacle.kind,
        "size": obstacle.size,
        "pose": obstacle.T_world_obstacle.tolist(),
        "file": obstacle.file_sha256,
    }
