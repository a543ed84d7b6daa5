"""The motion of a plan, part by part: to the object, from task to task with it, and home again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.state import State
from symgrasp.motion.drafting.carrying import (
    ROOM_TOGETHER,
    Stretch,
    TiltLimit,
    carry_alone,
    carry_together,
    tilt_limit,
)
from symgrasp.motion.drafting.course import Course, part_of
from symgrasp.motion.drafting.taking import leave, take
from symgrasp.motion.drafting.ways import Grip, lifted, retreating, straight
from symgrasp.motion.paths.lines import Leg, LineTree, follow
from symgrasp.motion.paths.search import NoMotionError, blockers, prove
from symgrasp.motion.segments import Motion
from symgrasp.plan.plan import Grasp, Plan, PlanTask
from symgrasp.poses import Array, translation
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm

__all__ = ["MotionDraft", "PlannedMotion"]

LIFT_TOGETHER = 0.1
"""Height (m) by which several hands that take an object lift it."""


TORSO = 1e-6
"""By how much (rad or m) the torso of a configuration may differ from that of a plan."""


class PlannedMotion(NamedTuple):
    """What was found.

    Attributes:
        motion: the motion, without times.
        configurations: for each task of the plan, arm → joint values (dof,) in which it holds the object.
    """

    motion: Motion
    configurations: Sequence[Mapping[str, Array]]


class MotionDraft:
    """The motion of one plan, while it is planned.

    Args:
        bodies: the pieces of the scene.
        grips: (arm, grasp of the plan) → grasp.
        plan: the plan.
        seed: of the random numbers.
        progress: called with the finished share; may raise `Cancelled`.

    The configuration of a grasp is chosen as late as possible: an arm that takes the object has a tree of
    straight retreats from its grasp until it is known from which of them the object can be carried on.
    """

    def __init__(
        self,
        bodies: MotionScene,
        grips: Mapping[tuple[str, Grasp], Grip],
        plan: Plan,
        seed: int,
        progress: Progress | None,
    ) -> None:
        self._bodies, self._scene, self._grips = bodies, bodies.scene, grips
        self._tasks, self._seed, self._told, self._share = plan.tasks, seed, progress, 0.0
        self._lifts = plan.kind == "bimanual"
        home = bodies.home().with_object(plan.tasks[0].object_pose_turned.array())
        self._course = Course(bodies, home, self._progress)
        self._trees: dict[str, LineTree] = {}  # of the arms of which is not decided how they take the object
        self._visits: list[dict[str, Array]] = [{} for _ in plan.tasks]
        self._k = 0  # the task that the object is in
        self._since: dict[str, int] = {}  # arm → the task in which it takes the object
        self._ahead: dict[int, Array] = {}  # index of a task → what `_arrivals` has found of it beforehand

    def run(self) -> PlannedMotion:
        """Plan it."""
        for k, task in enumerate(self._tasks):
            if k:
                self._pass_on(self._tasks[k - 1], task, k)
            self._k = k
            for name, grip in self._course.held.items():
                self._visits[k][name] = self._course.state.joints(grip.arm)
            self._take(task)
            if k == 0:
                self._look_ahead()
            self._share = (k + 1) / (len(self._tasks) + 1)
        task = self._tasks[-1]
        if self._lifts:
            self._carry_together(task, task, list(self._course.held))
        elif self._bodies.rests(self._course.state.T_world_object):
            self._release(task, list(self._course.held))
        self._decide_all(task)
        poses = [task.object_pose_turned.array() for task in self._tasks]
        self._share = 1.0
        self._progress()
        return PlannedMotion(Motion(self._scene, poses, tuple(self._course.segments)), self._visits)

    def _progress(self, _: float = 0.0) -> None:
        """Tell how many tasks are done: how much is left of what calls this is not known beforehand."""
        if self._told:
            self._told(self._share)

    def _look_ahead(self) -> None:
        """Find the straight ways out of later tasks, as long as one arm holds the object, and it alone.

        They do not depend on how it gets there, and take less time than the free motions before them.
        """
        held, state = self._course.held, self._course.state
        for k, (before, task) in enumerate(pairwise(self._tasks), start=1):
            if len(held) != 1 or len(task.holds) != 1 or not _kept(before, task):
                return
            (grip,) = held.values()
            with part_of(f"the carry from {before.name} to {task.name}"):
                goal = state.with_object(task.object_pose_turned.array())
                self._ahead[k] = self._arrivals(grip, goal, k)

    # -- from task to task -------------------------------------------------------------------

    def _pass_on(self, before: PlanTask, task: PlanTask, k: int) -> None:
        """Let go of the object with the arms that hold it no longer, and carry it to the next task."""
        kept = _kept(before, task)
        self._release(before, [name for name in self._course.held if name not in kept])
        if np.allclose(before.object_pose_turned.array(), task.object_pose_turned.array(), atol=1e-9):
            return
        if len(kept) == 1:
            self._carry(before, task, kept[0], k)
        else:
            self._carry_together(before, task, kept)

    def _carry(self, before: PlanTask, task: PlanTask, name: str, k: int) -> None:
        """Carry the object with one arm from a task to the next, which has index k."""
        grip, state = self._course.held[name], self._course.state
        goal = task.object_pose_turned.array()
        tilt = tilt_limit(self._scene, before, task)
        with part_of(f"the carry from {before.name} to {task.name}"):
            arrivals = self._ahead.get(k)
            if arrivals is None:
                arrivals = self._arrivals(grip, state.with_object(goal), k)
            choices = self._choices(name)
            parts = carry_alone(
                self._bodies, state, grip, goal, choices, arrivals, tilt.largest, self._seed, self._progress
            )
        self._decide(before, parts[0].situation.by_arm(parts[0].path[0]))
        self._course.carry(parts, (before.name, task.name), goal, tilt.kept, np.inf)

    def _choices(self, name: str) -> Array:
        """Return the configurations (m, n) in which an arm may hold the object now."""
        if name in self._trees:
            return self._trees[name].ends
        return self._course.state.joints(self._course.held[name].arm)[None]

    def _arrivals(self, grip: Grip, goal: State, k: int) -> Array:
        """Return the configurations (m, n) in which an arm may arrive with the object in task k.

        If it lets go there, a straight retreat must lead away.
        """
        task = self._tasks[k]
        if k == len(self._tasks) - 1:
            leaves = self._bodies.rests(goal.T_world_object)
        else:
            leaves = grip.arm.name not in _kept(task, self._tasks[k + 1])
        # Where maps demand a retreat, a plan's configurations must have one in every task.
        if leaves or self._scene.settings.approach:
            with part_of("its end"):
                ends = self._retreats(grip, task, goal, [], []).ends
        else:
            ends = _configurations(grip, task, goal.T_world_object)
        for hold in task.holds:
            if hold.arm not in self._course.held:
                ends = self._beside(grip, ends, self._grips[hold.arm, hold.grasp], task, goal)
        return ends

    def _beside(self, grip: Grip, ends: Array, other: Grip, task: PlanTask, goal: State) -> Array:
        """Return those of some configurations (m, n) of a grasp beside which another arm can take hold."""
        if not len(ends):
            return ends
        with part_of(f"the approach of {other.arm.name}"):
            theirs = self._retreats(other, task, goal, [], [grip.arm]).ends
        arms = [grip.arm, other.arm]
        goal = goal.with_arm(grip.arm, ends[0], grip.closed)
        goal = goal.with_arm(other.arm, theirs[0], other.open)
        situation = self._bodies.situation(goal, arms, held_by=arms[:1], touching=arms[1:])
        free, hits = np.zeros(len(ends), dtype=bool), []
        for k, end in enumerate(ends):
            both = {grip.arm.name: np.tile(end, (len(theirs), 1)), other.arm.name: theirs}
            rows = situation.stacked(both)
            rows = rows[(rows[:, situation.columns[grip.arm.name]] == end).all(axis=1)]
            proof = prove(situation, rows, rows, progress=self._progress)
            free[k] = proof.free.any()
            hits.append(proof.hits)
        if not free.any():
            raise NoMotionError(f"no room for {other.arm.name}: {blockers(situation, np.concatenate(hits))}")
        return ends[free]

    def _carry_together(self, before: PlanTask, task: PlanTask, names: Sequence[str]) -> None:
        """Move the object with several arms along a straight path: up, across to the next task, and down."""
        state = self._course.state
        start, end = state.T_world_object, task.object_pose_turned.array()
        off, on = self._bodies.rest(start), self._bodies.rest(end)
        if before is task:
            what, tilt = f"the lift in {task.name}", TiltLimit()
            end = translation(LIFT_TOGETHER * off.normal) @ start
            stretches = [Stretch("lift", straight(start, end), off)]
        else:
            what, tilt = f"the carry from {before.name} to {task.name}", tilt_limit(self._scene, before, task)
            up, down = lifted(start, off), lifted(end, on)
            stretches = [
                *([Stretch("lift", straight(start, up), off)] if off.pieces else []),
                Stretch("carry", straight(up, down), self._bodies.rest(up)),
                *([Stretch("lower", straight(down, end), on)] if on.pieces else []),
            ]
        grips = [self._course.held[name] for name in names]
        choices = {name: self._choices(name) for name in names}
        with part_of(what):
            parts = carry_together(
                self._bodies, state, grips, stretches, choices, tilt.largest, self._progress
            )
        self._decide(before, parts[0].situation.by_arm(parts[0].path[0]))
        self._course.carry(parts, (before.name, task.name), end, tilt.kept, ROOM_TOGETHER)

    # -- taking and letting go ---------------------------------------------------------------

    def _take(self, task: PlanTask) -> None:
        """Find the straight approaches of the arms that take the object in a task."""
        course = self._course
        arriving = [hold for hold in task.holds if hold.arm not in course.held]
        holders = course.holders()
        for hold in arriving:
            grip = self._grips[hold.arm, hold.grasp]
            others = [self._scene.arm(other.arm) for other in arriving if other is not hold]
            with part_of(f"the approach of {hold.arm} in {task.name}"):
                self._trees[hold.arm] = self._retreats(grip, task, course.state, holders, others)
            course.held[hold.arm], self._since[hold.arm] = grip, self._k
            course.undecided.add(hold.arm)
        if holders:  # the object waits in another hand: nothing else depends on this
            self._decide_all(task)

    def _retreats(
        self, grip: Grip, task: PlanTask, state: State, holders: Sequence[Arm], others: Sequence[Arm]
    ) -> LineTree:
        """Return the straight retreats from a grasp of the object where it is in a state.

        Args:
            grip: the grasp.
            task: the task.
            state: where everything else is.
            holders: the arms that hold the object.
            others: arms that are left out, because they are not there yet or move too.
        """
        arm = grip.arm
        state = state.with_arm(arm, state.joints(arm), grip.open)
        situation = self._bodies.situation(state, [arm], touching=[arm, *holders], without=others)
        poses = retreating(grip, state.T_world_object, self._scene.settings.approach, self._scene.profile)
        # Followed inwards: so every configuration of the grasp that can be reached is kept.
        end = _configurations(grip, task, state.T_world_object)
        try:
            return follow([Leg(situation, poses[::-1])], grip.fine, end=end, progress=self._progress)
        except NoMotionError as error:
            length = float(np.linalg.norm(poses[-1][:3, 3] - poses[0][:3, 3]))
            if length <= self._scene.settings.approach + 1e-9:
                raise
            asked = f"approach: {np.ceil(100 * length - 1e-6) / 100:g}"
            raise NoMotionError(f"{error}; grasps of maps with {asked} have one") from None

    def _decide_all(self, task: PlanTask) -> None:
        self._decide(task, dict.fromkeys(self._trees))

    def _decide(self, task: PlanTask, chosen: Mapping[str, Array | None]) -> None:
        """Plan how arms get to their grasps: all at the same time where there is room, or else in turn.

        Args:
            task: the task in which they take the object.
            chosen: arm → (dof,) configuration of its grasp, any if None. Arms that have it are passed over.
        """
        lines = {}
        for name, q in chosen.items():
            if name in self._trees:
                tree = self._trees.pop(name)
                ends = [k for k in np.argsort(-tree.value) if q is None or np.array_equal(tree.ends[k], q)]
                lines[name] = [tree.path(int(k)) for k in ends]

        def part(course: Course, names: Sequence[str]) -> None:
            own = {name: lines[name] for name in names}
            for name, q in take(course, own, task.name, self._seed, self._progress).items():
                for visit in self._visits[self._since[name] : self._k + 1]:
                    visit[name] = q

        self._together(part, list(lines))

    def _release(self, task: PlanTask, names: Sequence[str]) -> None:
        """Let go of the object with some arms and park them, as `_decide` takes it."""
        self._decide(task, {name: None for name in names})

        def part(course: Course, names: Sequence[str]) -> None:
            leave(course, names, task.name, self._scene.settings.approach, self._seed, self._progress)

        self._together(part, names)

    def _together(self, part: Callable[[Course, Sequence[str]], None], names: Sequence[str]) -> None:
        """Add a part of the motion of some arms at the same time, or else of one after the other."""
        if len(names) > 1:
            course = self._course.copied()
            with suppress(NoMotionError):
                part(course, names)
                self._course = course
                return
        for name in names:
            part(self._course, [name])


def _configurations(grip: Grip, task: PlanTask, T_world_object: Array) -> Array:
    """Return the configurations (m, n) of a grasp in a task, with the object at a pose (4, 4).

    Where several arms of one body hold the object, those with the torso of the plan, as its margins have it.
    """
    q, robot = grip.configurations(T_world_object), grip.arm.robot
    if robot.torso is None or sum(hold.robot == robot.name for hold in task.holds) < 2:
        return q
    names = robot.torso.joint_names
    (stated,) = [[hold.joints[name] for name in names] for hold in task.holds if hold.arm == grip.arm.name]
    return q[np.isclose(q[:, : len(names)], stated, rtol=0.0, atol=TORSO).all(axis=1)]


def _kept(before: PlanTask, task: PlanTask) -> list[str]:
    """Return the arms that hold the object in both tasks, by the same grasp."""
    grasps = {hold.arm: hold.grasp for hold in task.holds}
    return [hold.arm for hold in before.holds if grasps.get(hold.arm) == hold.grasp]
