"""A scene to start from, for a robot that has none: its arms, and a can where one of them reaches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import yaml

from symgrasp.errors import SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.found_arms import FoundArm
from symgrasp.hands.measure import hand_yaml
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.poses import Array, inverse, translation
from symgrasp.robot.hand import Hand
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import check_homes, open_world, with_free_homes

__all__ = ["robot_content", "scene_content", "starter_scene"]

RADIUS, HEIGHT = 0.025, 0.12
"""Radius and height (m) of the can, unless the hand needs another."""

FAR = 100.0
"""Where the can stands (m) while no place is known for it."""

SAMPLES = 20_000
"""Number of random configurations in which the arm is looked at."""

UPRIGHT = 0.94
"""Cosine of the angle by which the object may be out of upright in them: 20°."""

TRIALS = 8
"""Number of poses for which a coarse map is computed."""

ENOUGH = 0.3
"""No further pose is tried after one with this share of feasible cells."""

COARSE = (4, 16)
"""Heights and angles of that map."""

FEW = 8
"""Number of redundancy samples of it: where the can stands best is told by few."""


def robot_content(
    name: str, urdf: str, arms: Sequence[FoundArm], reading: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return a robot as scene files have it.

    Args:
        name: its name.
        urdf: the reference to its URDF.
        arms: its arms, all with joints and a hand.
        reading: further keys of the entry, which say how the file is read.
    """
    return {"name": name, "urdf": urdf, **(reading or {}), "arms": [_arm_entry(arm) for arm in arms]}


def scene_content(robot: dict[str, Any], arm: FoundArm) -> dict[str, Any]:
    """Return the content of a scene with a robot, and a can for an arm that stands far away."""
    assert arm.hand is not None
    name, (radius, height) = robot["name"], _can(arm.hand)
    return {
        "schema_version": 1,
        "name": name,
        "description": f"{name} and a can, to start from",
        "robots": [robot],
        "object": {"name": "can", "profile": [[0.0, radius], [height, radius]]},
        "tasks": [{"name": "hold", "arms": [arm.name], "pose": {"position": [FAR, 0.0, 0.0]}}],
        "map": {"heights": 12, "angles": 36},
    }


def starter_scene(
    name: str, urdf: str, arms: Sequence[FoundArm], reading: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the content of a scene with a robot, and a can that stands where its first arm reaches it best.

    Args:
        name: the robot's name.
        urdf: the reference to its URDF.
        arms: its arms, that which is to reach the can first.
        reading: further keys of the entry, which say how the file is read.

    Raises:
        SceneError: the arm reaches no can, or the robot hits itself whatever the arm does.
        SymgraspError: a scene with that robot cannot be loaded.
    """
    content = scene_content(robot_content(name, urdf, arms, reading), arms[0])
    scene = with_free_homes(Scene.from_content(content))
    check_homes(scene)
    home = scene.file.robots[0].home
    if home is not None:
        content["robots"][0]["home"] = dict(home) if isinstance(home, dict) else list(home)
    best, place = 0, None
    with open_world(scene.with_settings(redundancy=FEW)) as world:
        maker, arm = MapMaker(world), scene.arm(arms[0].name)
        grid = Manifold(scene.profile, *COARSE)
        for position in _places(arm, scene.profile):
            task = Task("hold", (arm.name,), translation(position))
            found = int(maker.map(task=task, manifold=grid).feasible.sum())
            if found > best:
                best, place = found, position
            if best > ENOUGH * 2 * np.prod(COARSE):
                break
    if place is None:
        raise SceneError(name, f"arm {arms[0].name}", TRIALS, "a place where it reaches an upright can")
    content["tasks"][0]["pose"] = {"position": [round(float(v), 3) for v in place]}
    return content


def _can(hand: Hand) -> tuple[float, float]:
    """Return the radius and the height (m) of a can that a hand can hold."""
    radius = RADIUS if hand.spans(RADIUS) else round(0.5 * hand.max_opening - hand.clearance, 3)
    return radius, max(HEIGHT, round(2 * hand.pad_width, 2))


def _arm_entry(arm: FoundArm) -> dict[str, Any]:
    """Return an arm as scene files have it."""
    entry: dict[str, Any] = {"name": arm.name, "joints": [arm.joints[0], arm.joints[-1]]}
    hand = arm.hand
    assert hand is not None
    if not arm.named:
        inline = yaml.safe_load(hand_yaml(hand))["hand"]
        return {**entry, "hand": inline}
    position, turn = arm.mount
    mount: dict[str, Any] = {"link": arm.tool, "prefix": f"{arm.name}_"}
    if any(position) or any(turn):
        mount["pose"] = {"position": list(position), "rpy_deg": list(turn)}
    return {**entry, "hand": hand.name, "mount": mount}


def _places(arm: Arm, can: Profile) -> list[Array]:
    """Return positions (3,) of an upright can that the arm holds from the side in random configurations."""
    rng = np.random.default_rng(0)
    bounded = np.isfinite(arm.upper - arm.lower)
    lower, upper = np.where(bounded, arm.lower, -np.pi), np.where(bounded, arm.upper, np.pi)
    q = rng.uniform(lower, upper, (SAMPLES, arm.dof))
    # Far from their limits, so that there is room for other grasps.
    margin = (np.minimum(q - lower, upper - q) / (upper - lower)).min(axis=1)
    T = arm.world_tool_pose(q)
    upright = np.abs(T[:, 2, 0]) > UPRIGHT
    order = np.argsort(-np.where(upright, margin, -1.0))[:TRIALS]
    T_tool_axis = inverse(arm.hand.tool_pose(np.eye(4), 0.0, 0.0, 0.0, float(can.radius(0.0))))
    axis = (T @ T_tool_axis)[:, :3, 3]
    return [axis[k] - [0.0, 0.0, can.h_max / 2] for k in order if upright[k]]
