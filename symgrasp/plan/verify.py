"""Checks a plan without trusting the planner that made it.

Everything is built anew from what the plan itself holds: the scene from its content, poses from
its numbers, configurations put through the URDF and into PyBullet. No code of a planner or of a
map takes part.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from symgrasp.errors import SymgraspError
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.ik import solver_for
from symgrasp.plan.check_motion import check_motion
from symgrasp.plan.plan import CLEARANCE_LIMIT, Hold, Plan, PlanTask, Pose
from symgrasp.poses import Array, from_position_quat, inverse, pose_error, rotation_z
from symgrasp.progress import Progress, part_of
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import support_margins
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world

__all__ = ["Report", "verify"]

TOLERANCE = 1e-6
"""By how much (m, rad) poses may differ that should be the same."""

CLEARANCE_TOLERANCE = 1e-5
"""By how much (m) a clearance may be overstated: PyBullet reads URDFs in single precision."""


@dataclass
class Report:
    """What was checked, and what does not hold.

    Attributes:
        checks: how many single statements were checked.
        failures: one line for each that does not hold, with the numbers.
    """

    checks: int = 0
    failures: list[str] = field(default_factory=list)

    @property
    def holds(self) -> bool:
        """Whether every statement holds."""
        return self.checks > 0 and not self.failures

    def __bool__(self) -> bool:
        """Whether every statement holds, so that a report can be asserted."""
        return self.holds

    def __str__(self) -> str:
        """One line a failure, and one that sums up."""
        result = "the plan holds" if self.holds else f"{len(self.failures)} do not hold"
        return "\n".join([*self.failures, f"{self.checks} statements checked: {result}"])

    def expect(self, ok: object, failure: str) -> bool:
        """Note one statement; ``failure`` says what is wrong where it does not hold."""
        self.checks += 1
        if not ok:
            self.failures.append(failure)
        return bool(ok)


def verify(plan: Plan | str | Path, progress: Progress | None = None) -> Report:
    """Check every statement of a plan: scene, order, poses, joints, collisions, clearances, margins.

    Args:
        plan: the plan, or the path of its file.
        progress: called with the finished share; may raise `Cancelled`.

    Returns:
        What was checked and what does not hold; true where all of it holds.

    Raises:
        PlanError: the file is missing or is not a plan.
    """
    plan = plan if isinstance(plan, Plan) else Plan.load(plan)
    report = Report()
    canonical = json.dumps(plan.scene.content, sort_keys=True).encode()
    digest = hashlib.sha256(canonical).hexdigest()
    report.expect(digest == plan.scene.sha256, f"scene: sha256 is {digest}, not {plan.scene.sha256}")
    try:
        scene = Scene.from_content(plan.scene.content, "plan: scene.content")
    except SymgraspError as error:
        report.expect(False, f"scene: {error}")
        return report
    report.expect(plan.scene.name == scene.name, f"scene: name is {scene.name!r}, not {plan.scene.name!r}")
    for name, robot in scene.robots.items():
        joints = plan.robots.get(name)
        report.expect(joints == robot.model.joint_names, f"robots: {name} has {robot.model.joint_names}")
    report.expect(set(plan.robots) == set(scene.robots), f"robots: the scene has {sorted(scene.robots)}")
    _check_order(plan, scene, report)
    with open_world(scene) as world:
        _check_grasps_stay(plan, world, report)
        holds = [(k, task, hold) for k, task in enumerate(plan.tasks) for hold in task.holds]
        parts = len(plan.tasks) + len(holds)
        for k, task in enumerate(plan.tasks):
            where = f"tasks[{k}] ({task.name})"
            if progress:
                progress(k / parts)
            if _check_poses(task, where, scene, report):
                _check_holds(task, where, scene, world, report)
        if not report.failures:  # margins are those of grasps that hold
            for done, (k, task, hold) in enumerate(holds, start=len(plan.tasks)):
                who = f"tasks[{k}] ({task.name}): {hold.arm}"
                tell = part_of(progress, done, parts)
                held = [other.arm for other in task.holds]
                shares = sum(other.robot == hold.robot for other in task.holds) > 1
                _check_margins(hold, shares, held, task.object_pose_turned.array(), who, world, report, tell)
        if plan.motion is not None and not report.failures:
            check_motion(plan, plan.motion, world, report.expect)
    if progress:
        progress(1.0)
    return report


def _check_order(plan: Plan, scene: Scene, report: Report) -> None:
    """Check that the tasks are those of the scene, held by the right arms, with a grasp that stays."""
    arms = {hold.arm for task in plan.tasks for hold in task.holds}
    for k, task in enumerate(plan.tasks):
        given = scene.tasks.get(task.name)
        if report.expect(given is not None, f"tasks[{k}]: the scene has no task {task.name!r}") and given:
            held = tuple(hold.arm for hold in task.holds)
            report.expect(held == given.arms, f"tasks[{k}] ({task.name}): held by {held}, not {given.arms}")
    if plan.kind == "sequential":
        expected = [t.name for t in scene.tasks.values() if len(t.arms) == 1 and t.arms[0] in arms]
        names = [task.name for task in plan.tasks]
        steps = list(_without_set_downs(plan))
        report.expect(_is_subsequence(expected, steps), f"tasks: {names}, but the scene asks for {expected}")
        extra = [name for name in names if name not in expected]
        report.expect(not extra, f"tasks: {extra} are not in the sequence {expected}")
        report.expect(len(arms) == 1, f"tasks: one arm does the sequence, not {sorted(arms)}")
    elif plan.kind == "bimanual":
        report.expect(len(plan.tasks) == 1 and len(arms) > 1, "tasks: one task with several arms")
    else:
        names = [task.name for task in plan.tasks]
        report.expect(
            names == list(scene.tasks), f"tasks: {names}, but the scene asks for {list(scene.tasks)}"
        )


def _check_grasps_stay(plan: Plan, world: BulletWorld, report: Report) -> None:
    """Check that every arm keeps its grasp, unless the object stands while it is grasped anew."""
    for k, (before, after) in enumerate(pairwise(plan.tasks), start=1):
        where = f"tasks[{k}] ({after.name})"
        grasps = {hold.arm: (hold.grasp, hold.opening) for hold in before.holds}
        kept = [grasps[h.arm] == (h.grasp, h.opening) for h in after.holds if h.arm in grasps]
        if all(kept) and kept:
            continue
        old, new = before.object_pose_turned.array(), after.object_pose_turned.array()
        if before.name == after.name or not kept:
            _same_pose(old, new, f"{where}: the object moved while nobody held it", report)
            report.expect(world.object_rests(old), f"{where}: the object is let go where nothing holds it up")
        else:
            report.expect(False, f"{where}: an arm changed its grasp on the way")


def _without_set_downs(plan: Plan) -> Iterator[str]:
    """Yield the names of the tasks, visits for a regrasp counted once."""
    before = None
    for task in plan.tasks:
        if task.name != before:
            yield task.name
        before = task.name


def _is_subsequence(wanted: list[str], names: list[str]) -> bool:
    rest = iter(names)
    return all(name in rest for name in wanted)


def _check_poses(task: PlanTask, where: str, scene: Scene, report: Report) -> bool:
    ok = all(
        _check_pose(pose, f"{where}: {name}", report)
        for name, pose in (("object_pose", task.object_pose), ("object_pose_turned", task.object_pose_turned))
    )
    if task.name in scene.tasks:
        given = scene.tasks[task.name].T_world_object
        ok &= _same_pose(task.object_pose.array(), given, f"{where}: object_pose", report)
    turned = task.object_pose.array() @ rotation_z(task.delta)
    return ok & _same_pose(task.object_pose_turned.array(), turned, f"{where}: turned pose", report)


def _check_pose(pose: Pose, where: str, report: Report) -> bool:
    """Check that a pose is rigid, and that its two spellings agree."""
    matrix = pose.array()
    rotation = matrix[:3, :3]
    rigid = np.abs(rotation.T @ rotation - np.eye(3)).max() < TOLERANCE and np.linalg.det(rotation) > 0
    rigid &= np.array_equal(matrix[3], [0, 0, 0, 1])
    if not report.expect(rigid, f"{where}: the matrix is no rigid pose"):
        return False
    length = float(np.linalg.norm(pose.quat_wxyz))
    if not report.expect(abs(length - 1) < TOLERANCE, f"{where}: the quaternion has length {length:.7f}"):
        return False
    spelled = from_position_quat(pose.position, pose.quat_wxyz)
    return _same_pose(spelled, matrix, f"{where}: quaternion", report)


def _same_pose(a: Array, b: Array, where: str, report: Report) -> bool:
    distance, angle = (float(e) for e in pose_error(a, b))
    text = f"{where}: off by {1e3 * distance:.4f} mm and {np.rad2deg(angle):.5f}°"
    return report.expect(distance <= TOLERANCE and angle <= TOLERANCE, text)


def _check_holds(task: PlanTask, where: str, scene: Scene, world: BulletWorld, report: Report) -> None:
    T = task.object_pose_turned.array()
    configurations = []
    for hold in task.holds:
        who = f"{where}: {hold.arm}"
        arm = scene.arms.get(hold.arm)
        if not report.expect(arm is not None, f"{who}: no such arm in the scene") or arm is None:
            return
        report.expect(hold.robot == arm.robot.name, f"{who}: belongs to {arm.robot.name}, not {hold.robot}")
        names = tuple(hold.joints)
        if not report.expect(names == arm.joint_names, f"{who}: joints {names}, not {arm.joint_names}"):
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
        report.expect(stated <= margin + TOLERANCE, f"{text}, not {1e3 * stated:.3f} mm")
    arms = [arm for arm, *_ in configurations]
    for c in world.collisions(arms):
        report.expect(False, f"{where}: {c.a} and {c.b} are {1e3 * c.depth:.2f} mm too close")
    for hold, arm in zip(task.holds, arms, strict=True):
        real = world.clearance(arm, CLEARANCE_LIMIT, arms)
        text = f"{where}: {arm.name}: clearance is {1e3 * real:.3f} mm, not {1e3 * hold.clearance:.3f} mm"
        report.expect(hold.clearance <= real + CLEARANCE_TOLERANCE, text)


def _check_torsos(configurations: Sequence[tuple[Arm, Array, float]], where: str, report: Report) -> None:
    """Check that arms of one body have the same torso."""
    for (arm, q, _), (other, p, _) in combinations(configurations, 2):
        if arm.robot is other.robot and arm.robot.torso is not None:
            names = arm.robot.torso.joint_names
            text = f"{where}: {arm.name} and {other.name} of {arm.robot.name} differ in {', '.join(names)}"
            report.expect(np.abs(q - p)[: len(names)].max() <= TOLERANCE, text)


def _check_arm(hold: Hold, arm: Arm, q: Array, who: str, report: Report) -> None:
    """Check limits, and the tool pose by the forward kinematics of the whole URDF."""
    for name, value, lower, upper in zip(arm.joint_names, q, arm.lower, arm.upper, strict=True):
        text = f"{who}: {name} is {value:.6f}, outside [{lower:g}, {upper:g}]"
        report.expect(lower <= value <= upper, text)
    expected = arm.hand.joint_values(hold.opening)
    same = expected.keys() == hold.hand_joints.keys() and all(
        abs(expected[n] - hold.hand_joints[n]) <= TOLERANCE for n in expected
    )
    report.expect(same, f"{who}: hand joints {hold.hand_joints}, but the opening takes {expected}")
    if _check_pose(hold.tool_pose, f"{who}: tool_pose", report):
        reached = arm.robot.T_world_base @ arm.tool_pose(q)
        _same_pose(reached, hold.tool_pose.array(), f"{who}: forward kinematics and tool_pose", report)


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
    expected = _tool_of(arm, T, g.h, g.theta, flipped, radius)
    _same_pose(expected, hold.tool_pose.array(), f"{who}: grasp and tool_pose", report)


def _tool_of(arm: Arm, T: Array, h: float, theta: float, flipped: bool, radius: float) -> Array:
    """Return the tool pose of a grasp, written out: z radially inwards, y along the tangent."""
    out = np.array([np.cos(theta), np.sin(theta), 0.0])
    tangent = np.array([-np.sin(theta), np.cos(theta), 0.0]) * (-1.0 if flipped else 1.0)
    tool = np.eye(4)
    tool[:3, :3] = np.column_stack([np.cross(tangent, -out), tangent, -out])
    tool[:3, 3] = max(0.0, radius - arm.hand.finger_depth) * out + [0.0, 0.0, h]
    tool[:3, 3] -= float(arm.hand.shift_at(radius)) * tangent
    return T @ tool


def _check_margins(
    hold: Hold,
    shares: bool,
    holders: Sequence[str],
    T: Array,
    who: str,
    world: BulletWorld,
    report: Report,
    progress: Progress | None,
) -> None:
    """Check that a hand gets away from its grasp, and that grasps closer than each margin are still feasible.

    One arm at a time. The torso may move for another grasp, unless the arm shares it with another one.
    """
    scene = world.scene
    arm, grid, g = scene.arm(hold.arm), scene.manifold, hold.grasp
    torso = None
    if shares and arm.robot.torso is not None:
        torso = arm.robot.torso.samples_at([hold.joints[name] for name in arm.robot.torso.joint_names])
        if not report.expect(torso, f"{who}: the torso is at none of the values that maps try"):
            return
    ik = solver_for(arm, scene.settings.redundancy, torso)
    checker = CandidateChecker(world, arm, ik, scene.settings.approach, holders=holders)
    for name in scene.robots:
        world.park(name)
    _check_retreat(hold, checker, T, who, report)
    margins = (
        ("margin_along", hold.margin_along / grid.dh, grid.heights, (grid.dh, 0.0)),
        ("margin_around", hold.margin_around / grid.dtheta, grid.angles // 2, (0.0, grid.dtheta)),
    )
    cells: list[tuple[str, int, float, float]] = []
    for text, count, limit, step in margins:
        if not report.expect(count <= limit + 1e-6, f"{who}: {text} is larger than the object"):
            continue
        whole = abs(count - round(count)) < 1e-6 and count > 0
        report.expect(whole, f"{who}: {text} is {count:.4f} cells, not a whole number above zero")
        signed = [sign * k for k in range(1, round(count)) for sign in (-1, 1)]
        cells += [(text, k, g.h + k * step[0], g.theta + k * step[1]) for k in signed]
    for done, (text, away, h, theta) in enumerate(cells):
        if progress:
            progress(done / len(cells))
        free = _feasible(checker, world, T, h, theta, g.roll)
        report.expect(free, f"{who}: {text} is overstated: {away:+d} cells away is infeasible")


def _check_retreat(hold: Hold, checker: CandidateChecker, T: Array, who: str, report: Report) -> None:
    """Check that the straight retreat from a grasp is free, and that the robot stands along it."""
    world, arm = checker.world, checker.arm
    if not world.scene.settings.approach:
        return
    world.set_object(T)
    q = np.array([hold.joints[name] for name in arm.joint_names])
    T_base_tool = arm.tool_pose(q)
    found = checker.ik.solve(T_base_tool)
    if not report.expect(len(found.q), f"{who}: no configuration of the grasp is found"):
        return
    away = np.abs((found.q - q + np.pi) % (2 * np.pi) - np.pi).max(axis=1)  # a full turn is none
    sample = int(found.sample[away.argmin()])
    result = checker.check(T_base_tool, q, sample, hold.opening)
    text = f"{who}: {result.reason.label}, {1e3 * result.retreat:.0f} mm from the grasp"
    report.expect(result.reason == Reason.FEASIBLE, text)


def _feasible(
    checker: CandidateChecker, world: BulletWorld, T: Array, h: float, theta: float, roll: float
) -> bool:
    arm, profile = checker.arm, world.scene.profile
    if not profile.h_min <= h <= profile.h_max:
        return False
    radius = float(profile.radius(h))
    hand = arm.hand
    if not (hand.spans(radius) and hand.palm_has_room(profile, h) and hand.pads_rest(profile, h)):
        return False
    tool = inverse(arm.robot.T_world_base) @ _tool_of(arm, T, h, theta, roll > 1.0, radius)
    world.set_object(T)
    candidates = checker.candidates(tool, arm.hand.opening(radius))
    return any(c.reason == Reason.FEASIBLE for c in candidates)
