"""Whether the motion of a plan can be done as it says, and nothing touches on the way that must not.

The motion is followed from its start, at home, with nothing but its numbers: each segment begins where
the one before ended, its rows are put through the URDF and into PyBullet, and no planner's code takes part.
"""

from __future__ import annotations

import numpy as np

from symgrasp.errors import as_written
from symgrasp.plan.check_motion_rows import TOLERANCE, Expect, check_rows
from symgrasp.plan.check_motion_states import MOST_STATES, RIGID, SegmentStates, check_free, tool_pose
from symgrasp.plan.motion_record import MotionRecord, SegmentRecord
from symgrasp.plan.plan import Hold, Plan
from symgrasp.poses import Array, inverse, pose_error
from symgrasp.progress import Progress, part_of
from symgrasp.world import BulletWorld

__all__ = ["check_motion"]

GRASP_TOLERANCE = 1e-5
"""By how much (m, rad) a hand may be off its grasp when it closes: solutions are refined to about 1e-8."""

LIFT = 0.2
"""Largest distance (m) of the object from its pose in a task after it is lifted, and before it is lowered."""


def check_motion(
    plan: Plan,
    motion: MotionRecord,
    world: BulletWorld,
    expect: Expect,
    progress: Progress | None = None,
    *,
    strict: bool = False,
) -> None:
    """Check every statement of a motion, up to the first segment that cannot be followed.

    Args:
        plan: the plan, of which all else has been checked.
        motion: its motion.
        world: a world of its scene; robots and object are put along the motion.
        expect: notes a statement, and what is wrong where it does not hold.
        progress: called with the finished share; may raise `Cancelled`.
        strict: let no clearance be overstated at all.
    """
    arms = world.scene.arms
    for name, joints in motion.joint_names.items():
        known = name in arms and arms[name].joint_names == joints
        if not expect(
            known, f"motion: joint_names: the scene has no arm {name} with joints {as_written(joints)}"
        ):
            return
    total = sum(segment.times[-1] for segment in motion.segments)
    text = f"motion: duration is {total:.6f} s, not {motion.duration:.6f} s"
    expect(abs(total - motion.duration) <= TOLERANCE, text)
    walk = _Walk(plan, world, expect, strict)
    for k, segment in enumerate(motion.segments):
        tell = part_of(progress, k, len(motion.segments))
        if not walk.follow(segment, f"motion.segments[{k}] ({segment.kind})", tell):
            return
    walk.check_end(motion.segments[-1])


class _Walk:
    """Where everything is at the end of the segments so far.

    Args:
        plan: the plan.
        world: a world of its scene.
        expect, strict: see `check_motion`.
    """

    def __init__(self, plan: Plan, world: BulletWorld, expect: Expect, strict: bool) -> None:
        self._plan, self._world, self._scene, self._expect = plan, world, world.scene, expect
        self._strict = strict
        self._values = {name: robot.home.copy() for name, robot in self._scene.robots.items()}
        self._opening: dict[str, float] = {}
        self._in_hand: dict[str, Array] = {}  # arm that holds the object → T_tool_object
        self._T = plan.tasks[0].object_pose_turned.array()
        self._task = 0  # index of the task that the object is in, or was last
        self._raised = False  # whether the object is above its pose in the task
        self._complete = False  # whether all arms of it held the object there
        self._states = 0  # states that have been checked
        self._grasps: dict[str, list[Array]] = {}  # arm → T_object_tool of its grasps
        for task in plan.tasks:
            for hold in task.holds:
                grasp = inverse(task.object_pose_turned.array()) @ hold.tool_pose.array()
                self._grasps.setdefault(hold.arm, []).append(grasp)

    def follow(self, segment: SegmentRecord, where: str, progress: Progress | None) -> bool:
        """Check a segment and move to its end; return whether the next one can be checked."""
        if progress:
            progress(0.0)
        released = [name for name in segment.gripper if self._in_hand.pop(name, None) is not None]
        if not self._check_start(segment, where):
            return False
        if not check_rows(segment, self._values, self._scene, where, self._expect):
            return False
        states = SegmentStates(
            self._scene, segment, self._values, self._T, self._in_hand, self._grasps, self._strict
        )
        most = MOST_STATES - self._states
        self._states += check_free(states, self._world, most, where, self._expect, progress)
        last = states.values(states.rows[-1:])
        self._T = states.objects(last)[0][0]
        self._values = {name: rows[0] for name, rows in last.items()}
        self._opening |= {name: end for name, (_, end) in segment.gripper.items()}
        if released and not self._in_hand:
            text = f"{where}: the object is let go where nothing holds it up"
            self._expect(self._world.object_rests(self._T), text)
        return self._check_arrival(segment, where) and self._check_hands(segment, where)

    def _check_start(self, segment: SegmentRecord, where: str) -> bool:
        """Check that a segment begins where the one before has ended."""
        task, holding = self._plan.tasks[self._task].name, sorted(self._in_hand)
        ok = self._expect(segment.task_from == task, f"{where}: from {segment.task_from}, not {task}")
        text = f"{where}: held by {as_written(sorted(segment.held_by))}, not {as_written(holding)}"
        ok &= self._expect(sorted(segment.held_by) == holding, text)
        for name, rows in segment.joints.items():
            arm = self._scene.arms[name]
            jump = float(np.abs(np.array(rows[0]) - self._values[arm.robot.name][arm.indices]).max())
            ok &= self._expect(jump <= TOLERANCE, f"{where}: {name} starts {jump:.6f} away from where it is")
        for name, (first, _) in segment.gripper.items():
            was = self._opening.get(name)
            same = first is was if first is None or was is None else abs(first - was) <= TOLERANCE
            ok &= self._expect(same, f"{where}: the hand of {name} starts at {first} m, but is at {was}")
        return ok

    def _check_arrival(self, segment: SegmentRecord, where: str) -> bool:
        """Check that the object is where a segment brings it, and that this is where the plan goes on."""
        tasks = self._plan.tasks
        if segment.task_to != segment.task_from:
            later = range(self._task + 1, len(tasks))
            following = next((k for k in later if tasks[k].name != segment.task_from), None)
            known = following is not None and tasks[following].name == segment.task_to and self._complete
            if not self._expect(known, f"{where}: {segment.task_to} does not follow {segment.task_from}"):
                return False
            self._task, self._complete = following or 0, False
        goal = tasks[self._task].object_pose_turned.array()
        distance, angle = (float(error) for error in pose_error(self._T, goal))
        self._raised = distance > RIGID[0]
        self._note_holders()
        away = f"{1e3 * distance:.3f} mm and {np.rad2deg(angle):.3f}°"
        text = f"{where}: the object ends {away} away from {segment.task_to}"
        above = segment.kind in ("lift", "carry") and self._T[2, 3] > goal[2, 3]
        for hold in tasks[self._task].holds if not self._raised else ():
            if hold.arm in self._in_hand:
                self._check_joints(hold, where)
        return self._expect(distance <= (LIFT if above else RIGID[0]) and angle <= RIGID[1], text)

    def _note_holders(self) -> None:
        holders = {hold.arm for hold in self._plan.tasks[self._task].holds}
        self._complete |= set(self._in_hand) == holders and not self._raised

    def _check_hands(self, segment: SegmentRecord, where: str) -> bool:
        """Check what hands take when they have closed, and that they open as far as grasps take."""
        ok = True
        for name, (_, end) in segment.gripper.items() if segment.kind == "close" else ():
            hold = self._hold(name)
            if not self._expect(hold, f"{where}: {name} takes nothing in {segment.task_to}") or not hold:
                return False
            ok &= self._check_grasp(name, hold, end, where) & self._check_joints(hold, where)
            self._in_hand[name] = inverse(tool_pose(self._scene, name, self._values)) @ self._T
        for name, (_, end) in segment.gripper.items() if segment.kind != "close" else ():
            known = {hold.opening for task in self._plan.tasks for hold in task.holds if hold.arm == name}
            right = any(abs(end - opening) <= TOLERANCE for opening in known)
            ok &= self._expect(
                right, f"{where}: {name} opens to {end} m, but its grasps take {as_written(sorted(known))}"
            )
        self._note_holders()
        return ok

    def _hold(self, name: str) -> Hold | None:
        """Return how an arm takes the object now: where it is grasped anew, as the plan's next task says."""
        tasks, k = self._plan.tasks, self._task
        if self._complete and not self._in_hand and k + 1 < len(tasks) and tasks[k + 1].name == tasks[k].name:
            self._task, self._complete = k + 1, False
        return next((hold for hold in tasks[self._task].holds if hold.arm == name), None)

    def _check_joints(self, hold: Hold, where: str) -> bool:
        """Check that an arm that holds the object in a task has the joint values that its hold states."""
        arm = self._scene.arms[hold.arm]
        values = self._values[arm.robot.name][arm.indices]
        stated = np.array([hold.joints[joint] for joint in arm.joint_names])
        away = np.abs(values - stated)
        j = int(away.argmax())
        task = self._plan.tasks[self._task].name
        text = (
            f"{where}: {hold.arm}: {arm.joint_names[j]} is {values[j]:.6f}, not {stated[j]:.6f} as in {task}"
        )
        return self._expect(away[j] <= TOLERANCE, text)

    def _check_grasp(self, name: str, hold: Hold, closed: float, where: str) -> bool:
        """Check that a hand that has closed has the grasp of the plan."""
        hand, radius = self._scene.arms[name].hand, float(self._scene.profile.radius(hold.grasp.h))
        wanted = float(np.clip(2 * radius, hand.min_opening, hand.max_opening))
        ok = self._expect(abs(closed - wanted) <= TOLERANCE, f"{where}: closes to {closed} m, not {wanted} m")
        tool = tool_pose(self._scene, name, self._values)
        distance, angle = (float(error) for error in pose_error(tool, hold.tool_pose.array()))
        text = f"{where}: {name} is {1e3 * distance:.4f} mm and {np.rad2deg(angle):.4f}° off its grasp"
        return ok & self._expect(distance <= GRASP_TOLERANCE and angle <= GRASP_TOLERANCE, text)

    def check_end(self, last: SegmentRecord) -> None:
        """Check that all of the plan was done, and that the arms are at home that do not hold the object.

        They go on holding it where nothing else holds it up, and several hands that lift it together.
        """
        task = self._plan.tasks[-1]
        where = f"motion: the end, {task.name}"
        done = self._task == len(self._plan.tasks) - 1 and self._complete
        self._expect(done, f"{where}: not all of the plan is done")
        holders = {hold.arm for hold in task.holds}
        if self._plan.kind == "bimanual":
            self._expect(last.kind in ("lift", "carry"), f"{where}: the object is not lifted")
        elif self._world.object_rests(task.object_pose_turned.array()):
            holders = set()
        text = f"{where}: held by {as_written(sorted(self._in_hand))}, not {as_written(sorted(holders))}"
        self._expect(set(self._in_hand) == holders, text)
        for arm in self._scene.arms.values():
            away = np.abs(self._values[arm.robot.name] - arm.robot.home)[arm.indices].max()
            self._expect(arm.name in holders or away <= TOLERANCE, f"{where}: {arm.name} is not at home")
