"""Every way to change a plan file, value by value, and whether what a changed one says is true still."""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from symgrasp.errors import PlanError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.poses import from_position_quat, pose_error
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, check_tasks, open_world

STEP = 1e-3
"""By how much (m, rad) numbers are changed: a hundred times the largest tolerance."""

MAKING = ("versions", "planner")
"""What a plan says about its making, which says nothing about the world."""

LESS = ("clearance", "margin_along", "margin_around", "limit_slack", "conditioning")
"""What a plan says of a hold that is still true when it is smaller."""

GONE = object()
"""In place of a value that is left out."""


def nodes(node: Any, path: tuple = ()) -> Iterator[tuple[tuple, Any]]:
    """Yield path and value of everything in a document, the document itself left out."""
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield (*path, key), value
            yield from nodes(value, (*path, key))


def others(value: Any) -> Iterator[Any]:
    """Yield what may stand in the place of a value."""
    yield GONE
    yield None if value is not None else 0
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int | float):
        yield from (value + STEP, value - STEP, -value if value else 1, str(value), True, value + 1)
        if isinstance(value, int):
            yield float(value)
    elif isinstance(value, str):
        yield from (value + "x", "", 1)
    elif isinstance(value, dict):
        first = next(iter(value), None)
        yield {**value, "more": 1}
        yield dict(reversed(value.items()))
        yield {f"{key}x" if key == first else key: part for key, part in value.items()}
    elif isinstance(value, list):
        yield from (value[:-1], value[1:], value + value[-1:], value[::-1], value[1:] + value[:1])


def changed(content: dict, path: tuple, value: Any) -> dict:
    """Return a document with another value at a path; a scene is hashed again, as a forger would."""
    content = copy.deepcopy(content)
    node = content
    for key in path[:-1]:
        node = node[key]
    if value is GONE:
        del node[path[-1]]
    else:
        node[path[-1]] = value
    if path[:2] == ("scene", "content") and len(path) > 2:
        text = json.dumps(content["scene"]["content"], sort_keys=True)
        content["scene"]["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    return content


def tamperings(content: dict) -> Iterator[tuple[tuple, Any, dict]]:
    """Yield (path, new value, document) for every document that differs in one value."""
    for path, value in nodes(content):
        for other in others(value):
            try:
                same = json.dumps(other) == json.dumps(value)
            except TypeError:
                same = False
            if not same:
                yield path, other, changed(content, path, other)


def caught(content: dict, scene: Scene | None = None) -> bool:
    """Whether a document is refused, or does not hold."""
    try:
        return not verify(Plan.parse(json.dumps(content), "plan"), scene=scene).holds
    except PlanError as error:
        assert "\n" not in str(error)
        return True


def is_harmless(plan: Plan, other: Plan) -> bool:
    """Whether a changed plan says nothing false, without asking what verifies plans.

    It says the same but for its making, or less, or it is about another scene in which all of it is true.
    """
    if other.scene != plan.scene:
        return other.model_copy(update={"scene": plan.scene}) == plan and is_true(other)
    for task, now in zip(plan.tasks, other.tasks, strict=True):
        if task.balance.keys() != now.balance.keys():
            return False
        if any(stated > task.balance[robot] for robot, stated in now.balance.items()):
            return False
        for hold, held in zip(task.holds, now.holds, strict=True):
            for name in LESS:
                stated = getattr(held, name)
                if stated is not None and stated > getattr(hold, name):
                    return False
    if _without(plan) != _without(other):
        return False
    turns = [a.delta - b.delta for a, b in zip(plan.tasks, other.tasks, strict=True)]
    if max(abs(np.sin(0.5 * turn)) for turn in turns) > 1e-9:  # a full turn is none
        return False
    return all(max(pose_error(a, b)) < 1e-9 for a, b in zip(_poses(plan), _poses(other), strict=True))


def _without(plan: Plan) -> dict:
    """Return what a plan says but for poses, its making, and numbers that say less when they are smaller."""
    content = plan.model_dump(exclude=set(MAKING))
    for task in content["tasks"]:
        del task["object_pose"], task["object_pose_turned"], task["delta"], task["balance"]
        for hold in task["holds"]:
            for name in ("tool_pose", *LESS):
                del hold[name]
            # Of a joint at zero rounding leaves some 1e-16, of either sign.
            hold["joints"] = {joint: round(value, 12) for joint, value in hold["joints"].items()}
    return content


def _poses(plan: Plan) -> Iterator[np.ndarray]:
    """Yield every pose of a plan, as each of its two spellings."""
    for task in plan.tasks:
        poses = (task.object_pose, task.object_pose_turned, *(hold.tool_pose for hold in task.holds))
        for pose in poses:
            yield pose.array()
            yield from_position_quat(pose.position, pose.quat_wxyz)


def map_of(scene: Scene, arm: Arm, task: str, pitch: float) -> FeasibilityMap:
    """Return the map of an arm in a task: of one with five joints, with its hand at a pitch (rad)."""
    with open_world(scene) as world:
        maker = MapMaker(world)
        return maker.maps_at_pitches(arm.name, task, [pitch]) if arm.pitched else maker.map(arm.name, task)


def tool_in_world(arm: Arm, joints: dict[str, float]) -> np.ndarray:
    """Return the pose (4, 4) of an arm's tool by its URDF and joint values alone."""
    model, values = arm.robot.model, arm.robot.home.copy()
    for joint, value in joints.items():
        values[model.joint_names.index(joint)] = value
    return arm.robot.T_world_base @ model.forward(values)[model.link_index(arm.tool)]


def is_true(plan: Plan) -> bool:
    """Whether a plan is true of the scene in it: by the maps of that scene, and by its bodies."""
    scene = Scene.from_content(plan.scene.content)
    check_tasks(scene)
    with BulletWorld(scene) as world:
        for task in plan.tasks:
            arms = [scene.arm(hold.arm) for hold in task.holds]
            turned = task.object_pose_turned.array()
            world.set_object(turned)
            world.set_arms(
                (arm, [hold.joints[name] for name in arm.joint_names], hold.opening)
                for arm, hold in zip(arms, task.holds, strict=True)
            )
            if world.collisions(arms):
                return False
            for arm, hold in zip(arms, task.holds, strict=True):
                m = map_of(scene, arm, task.name, hold.grasp.pitch).shift(task.delta)
                cell = m.manifold.cell(hold.grasp.h, hold.grasp.theta)
                at = (0 if hold.grasp.roll == 0 else 1, *cell)
                reached = tool_in_world(arm, hold.joints)
                margin = m.margin(at)
                if (
                    max(pose_error(reached, hold.tool_pose.array())) > 1e-6
                    or not np.allclose(m.T_world_object, turned, atol=1e-6)
                    or hold.margin_along > margin.along + 1e-9
                    or hold.margin_around > margin.around + 1e-9
                    or hold.clearance > world.clearance(arm, 0.1, arms) + 1e-5
                ):
                    return False
    return True
