"""Write down what a planner decided: grasps become poses, joint values, clearances and margins."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Literal, NamedTuple

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS, wrap
from symgrasp.plan.plan import (
    CLEARANCE_LIMIT,
    FRAMES,
    UNITS,
    Grasp,
    Hold,
    Plan,
    Planner,
    PlanTask,
    Pose,
    SceneRecord,
)
from symgrasp.poses import Array, rotation_z
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.robot.posture import conditioning, limit_slack
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import support_margins
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld

__all__ = ["ERROR", "Held", "rounded_down", "with_configurations", "write_plan", "write_task"]


ERROR = 1e-5
"""By how much (m) a clearance may differ in another world: PyBullet reads URDFs in single precision."""

LAST_DIGIT = 1e-6
"""Numbers are rounded down to this (m, rad or a ratio)."""


class Held(NamedTuple):
    """An arm that holds the object in a task.

    Attributes:
        configuration: its joint values and hand opening.
        map: its map of the task.
        cell: where on that map it holds.
        grasp: the same on the turned object, so the grasp itself.
        offset: by how much (rad) the angle of the grasp is larger than that of the middle of this cell.
    """

    configuration: ArmConfiguration
    map: FeasibilityMap
    cell: Cell
    grasp: Cell
    offset: float = 0.0


def write_task(world: BulletWorld, task: Task, delta: float, held: Sequence[Held]) -> PlanTask:
    """Write one task.

    Args:
        world: a world of the scene; object and arms end where the plan puts them.
        task: the task.
        delta: turn (rad) of the object about its axis.
        held: the arms that hold the object.
    """
    turned = task.T_world_object @ rotation_z(delta)
    world.set_object(turned)
    world.set_arms(h.configuration for h in held)
    arms = [h.configuration.arm for h in held]
    margins = support_margins(world.scene, turned, [h.configuration for h in held])
    entries = []
    for (arm, q, opening), m, cell, grasp, offset in held:
        along, around = m.margins[cell].tolist()
        h, theta = float(m.manifold.h[grasp.row]), float(m.manifold.theta[grasp.column])
        theta = float(wrap(theta + offset)) if offset else theta
        own, pitch = m.roll_and_pitch(grasp.roll)
        roll, radius = ROLLS[own], float(m.manifold.profile.radius(h))
        pitched, _ = arm.pitch_and_azimuth(q, own)  # the same up to `SAME_PITCH`
        entries.append(
            Hold(
                arm=arm.name,
                robot=arm.robot.name,
                grasp=Grasp(h=h, theta=theta, roll=roll, pitch=pitch),
                tool_pose=Pose.of(arm.hand.tool_pose(turned, h, theta, roll, radius, pitched)),
                joints=dict(zip(arm.joint_names, q[: len(arm.joint_names)].tolist(), strict=True)),
                hand_joints=arm.hand.joint_values(opening),
                opening=opening,
                margin_along=along,
                margin_around=around,
                margins="proven" if m.margins_proven else "cells",
                **_of_configuration(world, arm, q, arms),
            )
        )
    return PlanTask(
        name=task.name,
        object_pose=Pose.of(task.T_world_object),
        delta=delta,
        object_pose_turned=Pose.of(turned),
        holds=tuple(entries),
        balance={robot: rounded_down(margin - ERROR) for robot, margin in margins.items()},
    )


def with_configurations(
    world: BulletWorld, plan: Plan, configurations: Sequence[Mapping[str, Array]]
) -> Plan:
    """Return a plan with other configurations of the same grasps.

    Args:
        world: a world of the scene, which stays as it is.
        plan: the plan.
        configurations: for each task, arm → joint values (dof,).
    """
    scene, tasks = world.scene, []
    with world.preserving_state():
        for task, chosen in zip(plan.tasks, configurations, strict=True):
            turned = task.object_pose_turned.array()
            held = [ArmConfiguration(scene.arm(h.arm), chosen[h.arm], h.opening) for h in task.holds]
            arms = [own.arm for own in held]
            world.set_object(turned)
            world.set_arms(held)
            holds = []
            for hold, (arm, q, _) in zip(task.holds, held, strict=True):
                joints = dict(zip(arm.joint_names, q.tolist(), strict=True))
                update = {"joints": joints, **_of_configuration(world, arm, q, arms)}
                holds.append(hold.model_copy(update=update))
            margins = support_margins(scene, turned, held)
            balance = {robot: rounded_down(margin - ERROR) for robot, margin in margins.items()}
            tasks.append(task.model_copy(update={"holds": tuple(holds), "balance": balance}))
    return plan.model_copy(update={"tasks": tuple(tasks)})


def _of_configuration(world: BulletWorld, arm: Arm, q: Array, holders: Sequence[Arm]) -> dict[str, float]:
    """Return what a hold states of its arm's joint values (n,), at which the arm stands in the world."""
    return {
        "clearance": rounded_down(world.clearance(arm, CLEARANCE_LIMIT + ERROR, holders) - ERROR),
        "limit_slack": rounded_down(float(limit_slack(arm, q)) - LAST_DIGIT),
        "conditioning": rounded_down(float(conditioning(arm, q)) - LAST_DIGIT),
    }


def rounded_down(value: float) -> float:
    """Return a number rounded down to six digits, not below zero: no plan states more than there is."""
    return max(0.0, math.floor(1e6 * value + 1e-6) / 1e6)


def write_plan(
    scene: Scene,
    kind: Literal["sequential", "bimanual", "handover"],
    planner: Planner,
    tasks: Sequence[PlanTask],
) -> Plan:
    """Write the plan of a scene."""
    packages = ("symgrasp", "numpy", "pybullet")
    return Plan(
        schema_version=3,
        kind=kind,
        scene=SceneRecord(name=scene.name, sha256=scene.sha256, content=scene.content),
        versions={"python": platform.python_version(), **{name: version(name) for name in packages}},
        planner=planner,
        units=UNITS,
        frames=FRAMES,
        robots={robot.name: robot.model.joint_names for robot in scene.robots.values()},
        tasks=tuple(tasks),
    )
