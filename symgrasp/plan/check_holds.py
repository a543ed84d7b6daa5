"""Whether hands hold the object as a plan says, and nothing touches that must not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from symgrasp.errors import as_written
from symgrasp.plan.check_poses import TOLERANCE, check_pose, same_pose
from symgrasp.plan.plan import CLEARANCE_LIMIT, Hold, PlanTask
from symgrasp.plan.report import Report
from symgrasp.poses import Array, rotation_about
from symgrasp.robot.pitch import SAME_PITCH, pitch_range
from symgrasp.robot.posture import conditioning, limit_slack
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import support_margins
from symgrasp.scene.scene import Scene
from symgrasp.world import RESTING_DEPTH, BulletWorld

__all__ = ["check_holds", "tool_of"]

CLEARANCE_TOLERANCE = 1e-5
"""By how much (m) a clearance may be overstated: PyBullet reads URDFs in single precision."""


def check_holds(
    task: PlanTask,
    where: str,
    world: BulletWorld,
    report: Report,
    trying: Callable[[], None] = lambda: None,
) -> None:
    """Check grasps, joints, balance, collisions and clearances of a task; the object is in no obstacle.

    Args:
        task: the task.
        where: what it is called in failures.
        world: a world of the scene; object and arms end where the plan puts them.
        report: where what is found is noted.
        trying: called between the checks; may raise `Cancelled`.
    """
    scene = world.scene
    T = task.object_pose_turned.array()
    configurations = []
    for hold in task.holds:
        who = f"{where}: {hold.arm}"
        arm = scene.arms.get(hold.arm)
        if not report.expect(arm is not None, f"{who}: no such arm in the scene") or arm is None:
            return
        report.expect(hold.robot == arm.robot.name, f"{who}: belongs to {arm.robot.name}, not {hold.robot}")
        names = tuple(hold.joints)
        if not report.expect(
            names == arm.joint_names, f"{who}: joints {as_written(names)}, not {as_written(arm.joint_names)}"
        ):
            return
        q = np.array([hold.joints[name] for name in arm.joint_names])
        _check_arm(hold, arm, q, who, report)
        _check_grasp(hold, arm, T, who, scene, report)
        configurations.append((arm, q, hold.opening))
    _check_torsos(configurations, where, report)
    world.set_object(T)
    world.set_arms(configurations)
    margins = support_margins(scene, T, configurations)
    names = sorted(task.balance), sorted(margins)
    report.expect(names[0] == names[1], f"{where}: balance of {names[0]}, not {names[1]}")
    for robot, margin in margins.items():
        text = f"{where}: {robot}: the centre of mass is {1e3 * margin:.3f} mm inside of the support"
        report.expect(margin >= 0, text)
        stated = task.balance.get(robot, margin)
        report.at_most(stated, margin, TOLERANCE, f"{text}, not {1e3 * stated:.3f} mm")
    arms = [arm for arm, *_ in configurations]
    trying()
    for c in world.collisions(arms):
        report.expect(False, f"{where}: {c.a} and {c.b} are {1e3 * c.depth:.2f} mm too close")
    for c in world.object_contacts():
        text = f"{where}: {c.a} is {1e3 * c.depth:.2f} mm inside {c.b}"
        report.expect(c.depth <= RESTING_DEPTH, text)
    for hold, arm in zip(task.holds, arms, strict=True):
        trying()
        real = world.clearance(arm, CLEARANCE_LIMIT, arms)
        text = f"{where}: {arm.name}: clearance is {1e3 * real:.3f} mm, not {1e3 * hold.clearance:.3f} mm"
        report.at_most(hold.clearance, real, CLEARANCE_TOLERANCE, text)


def _check_torsos(configurations: Sequence[tuple[Arm, Array, float]], where: str, report: Report) -> None:
    """Check that arms of one body have the same torso."""
    for (arm, q, _), (other, p, _) in combinations(configurations, 2):
        if arm.robot is other.robot and arm.robot.torso is not None:
            names = arm.robot.torso.joint_names
            text = f"{where}: {arm.name} and {other.name} of {arm.robot.name} differ in {', '.join(names)}"
            report.expect(np.abs(q - p)[: len(names)].max() <= TOLERANCE, text)


def _check_arm(hold: Hold, arm: Arm, q: Array, who: str, report: Report) -> None:
    """Check limits, and the tool pose by the forward kinematics of the whole URDF."""
    n = len(arm.joint_names)  # the values of an arm of five joints are more
    for name, value, lower, upper in zip(arm.joint_names, q, arm.lower[:n], arm.upper[:n], strict=True):
        text = f"{who}: {name} is {value:.6f}, outside [{lower:g}, {upper:g}]"
        report.expect(lower <= value <= upper, text)
    slack, condition = float(limit_slack(arm, q)), float(conditioning(arm, q))
    if hold.limit_slack is not None:
        text = f"{who}: {np.rad2deg(slack):.4f}° from a limit, not {np.rad2deg(hold.limit_slack):.4f}°"
        report.at_most(hold.limit_slack, slack, TOLERANCE, text)
    if hold.conditioning is not None:
        text = f"{who}: conditioning is {condition:.6f}, not {hold.conditioning:.6f}"
        report.at_most(hold.conditioning, condition, TOLERANCE, text)
    expected = arm.hand.joint_values(hold.opening)
    same = expected.keys() == hold.hand_joints.keys() and all(
        abs(expected[n] - hold.hand_joints[n]) <= TOLERANCE for n in expected
    )
    report.expect(same, f"{who}: hand joints {hold.hand_joints}, but the opening takes {expected}")
    if check_pose(hold.tool_pose, f"{who}: tool_pose", report):
        reached = arm.tool_at(arm.robot_values(q))
        same_pose(reached, hold.tool_pose.array(), f"{who}: forward kinematics and tool_pose", report)


def _check_grasp(hold: Hold, arm: Arm, T: Array, who: str, scene: Scene, report: Report) -> None:
    """Check that the tool is where the grasp puts it on the turned object, with a hand that fits."""
    g, profile, hand = hold.grasp, scene.profile, arm.hand
    inside = profile.h_min <= g.h <= profile.h_max
    if not report.expect(inside, f"{who}: h = {g.h:g} m is not on the object"):
        return
    report.expect(-np.pi <= g.theta < np.pi, f"{who}: theta = {g.theta:g} is not in [-π, π)")
    flipped = abs(g.roll - np.pi) <= TOLERANCE
    report.expect(flipped or abs(g.roll) <= TOLERANCE, f"{who}: roll = {g.roll:g} is neither 0 nor π")
    radius = float(profile.radius(g.h))
    report.expect(hand.spans(radius), f"{who}: the hand does not span {2e3 * radius:.1f} mm")
    report.expect(hand.palm_has_room(profile, g.h), f"{who}: no room for the palm at h = {g.h:g} m")
    report.expect(hand.pads_rest(profile, g.h), f"{who}: the pads do not rest at h = {g.h:g} m")
    wanted = hand.opening(radius)
    text = f"{who}: opening is {1e3 * hold.opening:.3f} mm, but this height takes {1e3 * wanted:.3f} mm"
    report.expect(abs(hold.opening - wanted) <= TOLERANCE, text)
    _check_pitch(hold, arm, scene, who, report)
    expected = tool_of(arm, T, g.h, g.theta, flipped, radius, g.pitch)
    leeway = SAME_PITCH if arm.pitched else 0.0
    same_pose(expected, hold.tool_pose.array(), f"{who}: grasp and tool_pose", report, leeway)


def _check_pitch(hold: Hold, arm: Arm, scene: Scene, who: str, report: Report) -> None:
    """Check that the hand may have the pitch of its grasp."""
    pitch = hold.grasp.pitch
    if not arm.pitched:
        report.expect(pitch == 0.0, f"{who}: pitch is {pitch:g}, but only arms of five joints have one")
        return
    low, high = pitch_range(arm.hand, scene.profile, hold.grasp.h)
    text = f"{who}: pitch is {pitch:.5f}, outside [{low:.5f}, {high:.5f}]"
    report.expect(low - SAME_PITCH <= pitch <= high + SAME_PITCH, text)


def tool_of(
    arm: Arm, T: Array, h: float, theta: float, flipped: bool, radius: float, pitch: float = 0.0
) -> Array:
    """Return the tool pose of a grasp, written out: z radially inwards, y along the tangent.

    The pitch turns it about the tangent, through the point of the object's axis at the grasp's height.
    """
    out = np.array([np.cos(theta), np.sin(theta), 0.0])
    tangent = np.array([-np.sin(theta), np.cos(theta), 0.0]) * (-1.0 if flipped else 1.0)
    tool = np.eye(4)
    tool[:3, :3] = np.column_stack([np.cross(tangent, -out), tangent, -out])
    tool[:3, 3] = max(0.0, radius - arm.hand.finger_depth) * out + [0.0, 0.0, h]
    tool[:3, 3] -= float(arm.hand.shift_at(radius)) * tangent
    turn = np.eye(4)
    turn[:3, :3] = rotation_about([np.sin(theta), -np.cos(theta), 0.0], pitch)
    turn[:3, 3] = [0.0, 0.0, h] - turn[:3, :3] @ [0.0, 0.0, h]
    return T @ turn @ tool
