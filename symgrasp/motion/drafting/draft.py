"""The motion of a plan, part by part: to the object, from task to task with it, and home again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice, product
from typing import NamedTuple

import numpy as np

from symgrasp.errors import SceneError
from symgrasp.motion.bodies.situation import MotionScene, Situation, State
from symgrasp.motion.drafting.ways import LIFT, Grip, lifted, retreating, straight
from symgrasp.motion.paths.lines import LineTree, follow
from symgrasp.motion.paths.search import STATED, NoMotionError, blockers, connect, prove
from symgrasp.motion.segments import Kind, Motion, Opening, Segment
from symgrasp.plan.plan import Grasp, Hold, Plan, PlanTask
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm

__all__ = ["MotionDraft", "PlannedMotion"]

LIFT_TOGETHER = 0.1
"""Height (m) by which several hands that take an object lift it."""

COMBINATIONS = 64
"""Combinations of the paths of several arms that are tried."""


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
        falling = [hold.robot for task in plan.tasks for hold in task.holds if task.balance]
        if falling:
            raise NoMotionError(
                f"motions of robots that can fall are not planned: {falling[0]} has a support"
            )
        self._tasks, self._seed, self._progress = plan.tasks, seed, progress
        self._lifts = plan.kind == "bimanual"
        self._state = self._bodies.home().with_object(plan.tasks[0].object_pose_turned.array())
        self._segments: list[Segment] = []
        self._held: dict[str, Grip] = {}
        self._open: dict[str, LineTree] = {}  # arms that hold the object, as soon as it is decided how
        self._opening: dict[str, float] = {}
        self._visits: list[dict[str, Array]] = [{} for _ in plan.tasks]
        self._k = 0  # the task that the object is in
        self._since: dict[str, int] = {}  # arm → the task in which it takes the object

    def run(self) -> PlannedMotion:
        """Plan it."""
        last = len(self._tasks) - 1
        for k, task in enumerate(self._tasks):
            if k:
                self._pass_on(self._tasks[k - 1], task, k)
            self._k = k
            for name in self._held:
                self._visits[k][name] = self._state.joints(self._held[name].arm)
            self._take(task)
            if self._progress:
                self._progress((k + 1) / (len(self._tasks) + 1))
        task = self._tasks[last]
        if self._lifts:
            self._carry_together(task, task, list(self._held), LIFT_TOGETHER)
        elif self._bodies.rests(self._state.T_world_object):
            self._release(task, list(self._held))
        self._decide_all(task)
        poses = {task.name: task.object_pose_turned.array() for task in self._tasks}
        if self._progress:
            self._progress(1.0)
        return PlannedMotion(Motion(self._scene, poses, tuple(self._segments)), self._visits)

    # -- from task to task -------------------------------------------------------------------

    def _pass_on(self, before: PlanTask, task: PlanTask, k: int) -> None:
        """Let go of the object with the arms that hold it no longer, and carry it to the next task."""
        kept = _kept(before, task)
        self._release(before, [name for name in self._held if name not in kept])
        if np.allclose(before.object_pose_turned.array(), task.object_pose_turned.array(), atol=1e-9):
            return
        if len(kept) == 1:
            self._carry(before, task, kept[0], k)
        else:
            self._carry_together(before, task, kept, LIFT)

    def _take(self, task: PlanTask) -> None:
        """Find the straight approaches of the arms that take the object in a task."""
        arriving = [hold for hold in task.holds if hold.arm not in self._held]
        holders = bool(self._held)
        for hold in arriving:
            grip = self._grips[hold.arm, hold.grasp]
            with _part(f"the approach of {hold.arm} in {task.name}"):
                self._open[hold.arm] = self._retreats(grip, arriving)
            self._held[hold.arm], self._since[hold.arm] = grip, self._k
        if holders:  # the object waits in another hand: nothing else depends on this
            self._decide_all(task)

    def _retreats(self, grip: Grip, together: Sequence[Hold] = ()) -> LineTree:
        """Return the straight retreats from a grasp of the object where it is.

        Args:
            grip: the grasp.
            together: holds whose arms are left out, because they are not there yet or move too.
        """
        arm, state = grip.arm, self._state
        state = state.with_arm(arm, state.joints(arm), grip.open)
        others = [self._scene.arm(hold.arm) for hold in together if hold.arm != arm.name]
        situation = self._bodies.situation(state, [arm], touching=[arm, *self._holders()], without=others)
        settings = self._scene.settings
        poses = retreating(grip, state.T_world_object, settings.approach, self._scene.profile)
        # Followed inwards: so every configuration of the grasp that can be reached is kept.
        end = grip.configurations(state.T_world_object)
        return follow(situation, grip.fine, poses[::-1], end=end)

    def _decide_all(self, task: PlanTask) -> None:
        for name in list(self._open):
            self._decide(name, task)

    def _decide(self, name: str, task: PlanTask, q: Array | None = None) -> None:
        """Plan how an arm gets to its grasp.

        Args:
            name: the arm.
            task: the task in which it takes the object.
            q: (n,) the configuration of the grasp; any if None.
        """
        grip, tree = self._held[name], self._open.pop(name)
        arm = grip.arm
        ends = [k for k in np.argsort(-tree.value) if q is None or np.array_equal(tree.ends[k], q)]
        paths = [tree.path(int(k)) for k in ends]
        del self._held[name]  # until its hand is closed it does not hold anything
        self._move_hand("open", grip, self._opening.get(name), grip.open, task)
        situation = self._bodies.situation(self._state, [arm], touching=self._holders())
        with _part(f"the reach of {name} to {task.name}"):
            starts = np.array([path[0] for path in paths])
            path = connect(situation, self._state.joints(arm)[None], starts, self._seed, self._progress)
        self._add("reach", situation, path, task, task)
        line = next(line for line in paths if np.array_equal(line[0], path[-1]))
        situation = self._bodies.situation(self._state, [arm], touching=[arm, *self._holders()])
        self._add("approach", situation, line, task, task)
        for visit in self._visits[self._since[name] : self._k + 1]:
            visit[name] = line[-1]
        self._move_hand("close", grip, grip.open, grip.closed, task)
        self._held[name] = grip

    def _release(self, task: PlanTask, names: Sequence[str]) -> None:
        """Let go of the object with some arms and park them."""
        for name in names:
            if name in self._open:
                self._decide(name, task)
        for name in names:
            grip = self._held.pop(name)
            arm = grip.arm
            self._move_hand("open", grip, grip.closed, grip.open, task)
            situation = self._bodies.situation(self._state, [arm], touching=[arm, *self._holders()])
            profile, settings = self._scene.profile, self._scene.settings
            poses = retreating(grip, self._state.T_world_object, settings.approach, profile)
            with _part(f"the retreat of {name} in {task.name}"):
                tree = follow(situation, grip.fine, poses, self._state.joints(arm)[None])
            self._add("retreat", situation, tree.path(int(tree.value.argmax())), task, task)
            situation = self._bodies.situation(self._state, [arm], touching=self._holders())
            with _part(f"the way home of {name} from {task.name}"):
                home = arm.robot.home[arm.indices][None]
                path = connect(situation, self._state.joints(arm)[None], home, self._seed, self._progress)
            self._add("home", situation, path, task, task)

    # -- with the object ---------------------------------------------------------------------

    def _carry(self, before: PlanTask, task: PlanTask, name: str, k: int) -> None:
        """Carry the object with one arm from a task to the next, which has index k."""
        grip = self._held[name]
        what = f"the carry from {before.name} to {task.name}"
        goal = self._state.with_object(task.object_pose_turned.array())
        with _part(f"{what}: its start"):
            out = self._lifts_off(grip, self._state, self._choices(name))
        with _part(f"{what}: its end"):
            back = self._lifts_off(grip, goal, self._arrivals(grip, goal, k))
        at = self._holding(grip, self._state)
        situation = self._bodies.situation(at, [grip.arm], held_by=[grip.arm], tilt=self._tilt(before, task))
        with _part(what):
            path = connect(situation, out.ends, back.ends, self._seed, self._progress)
        start = out.path(_row(out.ends, path[0]))
        end = back.path(_row(back.ends, path[-1]))
        if name in self._open:
            self._decide(name, before, start[0])
        whole = np.concatenate([start[:-1], path, end[::-1][1:]])
        clearance = min(self._clearance(situation, path), out.value.min(), back.value.min())
        self._append("carry", {name: whole}, before, task, clearance)
        self._state = self._state.with_arm(grip.arm, whole[-1]).with_object(goal.T_world_object)

    def _choices(self, name: str) -> Array:
        """Return the configurations (m, n) in which an arm may hold the object now."""
        if name in self._open:
            return self._open[name].ends
        return self._state.joints(self._held[name].arm)[None]

    def _arrivals(self, grip: Grip, goal: State, k: int) -> Array:
        """Return the configurations (m, n) in which an arm may arrive with the object in task k.

        If it lets go there, a straight retreat must lead away.
        """
        if k == len(self._tasks) - 1:
            leaves = self._bodies.rests(goal.T_world_object)
        else:
            leaves = grip.arm.name not in _kept(self._tasks[k], self._tasks[k + 1])
        # Where maps demand a retreat, a plan's configurations must have one in every task.
        if leaves or self._scene.settings.approach:
            state, held = self._state, self._held
            self._state, self._held = goal, {}
            try:
                return self._retreats(grip).ends
            finally:
                self._state, self._held = state, held
        return grip.configurations(goal.T_world_object)

    def _lifts_off(self, grip: Grip, state: State, choices: Array) -> LineTree:
        """Return the straight ways up from what the object rests on, from some configurations (m, n)."""
        held = self._holding(grip, state)
        supports = self._bodies.supports(state.T_world_object)
        situation = self._bodies.situation(held, [grip.arm], held_by=[grip.arm], resting_on=supports)
        T = state.T_world_object
        poses = straight(T, lifted(T, LIFT)) if supports else [T]
        return follow(situation, grip.fine, [grip.tool(pose) for pose in poses], choices)

    def _holding(self, grip: Grip, state: State) -> State:
        """Return a state with the object in a hand, in any configuration."""
        q = grip.configurations(state.T_world_object)
        if not len(q):
            raise NoMotionError("no configuration reaches the grasp")
        return state.with_arm(grip.arm, q[0], grip.closed)

    def _carry_together(self, before: PlanTask, task: PlanTask, names: Sequence[str], height: float) -> None:
        """Move the object with several arms along a straight path: up, across to the next task, and down."""
        what = (
            f"the carry from {before.name} to {task.name}"
            if before is not task
            else f"the lift in {task.name}"
        )
        start, end = self._state.T_world_object, task.object_pose_turned.array()
        supports = {id(before): self._bodies.supports(start), id(task): self._bodies.supports(end)}
        poses = [start]
        for pose in (lifted(start, height), *(() if before is task else (lifted(end, height), end))):
            poses += straight(poses[-1], pose)[1:]
        if before is not task and max(map(_tilt_of, poses)) > self._tilt(before, task):
            raise NoMotionError(f"{what}: the object would be tilted too far")
        arms = [self._held[name].arm for name in names]
        resting = sorted({piece for own in supports.values() for piece in own})
        trees: list[LineTree] = []
        at = self._state
        for name in names:
            grip = self._held[name]
            others = [arm for arm in arms if arm is not grip.arm]
            state = self._holding(grip, self._state)
            situation = self._bodies.situation(
                state, [grip.arm], held_by=[grip.arm, *others], without=others, resting_on=resting
            )
            tools = [grip.tool(pose) for pose in poses]
            with _part(f"{what}: {name}"):
                trees.append(follow(situation, grip.fine, tools, self._choices(name)))
        for grip, tree in zip((self._held[name] for name in names), trees, strict=True):
            at = at.with_arm(grip.arm, tree.path(0)[0], grip.closed)
        situation = self._bodies.situation(at, arms, held_by=arms, resting_on=resting)
        ends = product(*(np.argsort(-tree.value)[:COMBINATIONS].tolist() for tree in trees))
        found, hits = np.zeros(0), np.zeros((0, 2), dtype=np.int64)
        paths: dict[str, Array] = {}
        for chosen in islice(ends, COMBINATIONS):
            paths = {n: tree.path(e) for n, tree, e in zip(names, trees, chosen, strict=True)}
            rows = situation.stacked(paths)
            if any(not np.array_equal(own, paths[name]) for name, own in situation.by_arm(rows).items()):
                continue  # arms of one body need one torso
            found, hits = prove(situation, rows[:-1], rows[1:], STATED)
            if (found >= 0).all():
                break
            hits = hits[found < 0]
        else:
            raise NoMotionError(f"{what}: {blockers(situation, hits)}")
        for name in names:
            if name in self._open:
                self._decide(name, before, paths[name][0])
        self._append("carry", paths, before, task, float(found.min()))
        for name in names:
            self._state = self._state.with_arm(self._held[name].arm, paths[name][-1])
        self._state = self._state.with_object(poses[-1])

    def _tilt(self, before: PlanTask, task: PlanTask) -> float:
        """Return the largest tilt (rad) of the object on the way from a task to the next.

        Raises:
            SceneError: it is tilted further in one of them.
        """
        carries = self._scene.file.carries()
        own = [c.tilt_deg for c in carries if c.tasks == (before.name, task.name)]
        limits = own or [c.tilt_deg for c in carries if c.tasks is None]
        if not limits:
            return np.inf
        limit = np.deg2rad(min(limits))
        for end in (before, task):
            tilt = _tilt_of(end.object_pose_turned.array())
            if tilt >= limit:
                expected = (
                    f"more than the {np.rad2deg(tilt):.1f}° of task {end.name}, or limits of pairs of tasks"
                )
                raise SceneError(self._scene.source, "carry: tilt_deg", min(limits), expected)
        return limit

    # -- segments ----------------------------------------------------------------------------

    def _holders(self) -> list[Arm]:
        """Return the arms that hold the object where they are."""
        return [grip.arm for name, grip in self._held.items() if name not in self._open]

    def _clearance(self, situation: Situation, path: Array) -> float:
        """Return the clearance (m) that a path (n, J) is proven to have."""
        found, _ = prove(situation, path[:-1], path[1:], STATED)
        return float(found.min())

    def _add(self, kind: Kind, situation: Situation, path: Array, before: PlanTask, task: PlanTask) -> None:
        """Add a segment in which the arms of a situation follow a path (n, J), and move there."""
        paths = situation.by_arm(path)
        self._append(kind, paths, before, task, self._clearance(situation, path))
        for name, own in paths.items():
            self._state = self._state.with_arm(self._scene.arm(name), own[-1])

    def _append(
        self,
        kind: Kind,
        paths: Mapping[str, Array],
        before: PlanTask,
        task: PlanTask,
        clearance: float,
        gripper: Mapping[str, Opening] | None = None,
    ) -> None:
        held_by = tuple(arm.name for arm in self._holders())
        paths = {**paths, **self._moved_along(paths)}
        self._segments.append(
            Segment(
                kind=kind,
                arms=tuple(paths),
                joints=dict(paths),
                gripper=gripper or {},
                held_by=held_by,
                task_from=before.name,
                task_to=task.name,
                clearance=clearance,
            )
        )

    def _moved_along(self, paths: Mapping[str, Array]) -> dict[str, Array]:
        """Return the paths of arms that do not move themselves, but with a torso that moves.

        Raises:
            NoMotionError: one of them holds the object.
        """
        found: dict[str, Array] = {}
        for name, path in paths.items():
            robot = self._scene.arm(name).robot
            shared = len(robot.torso.joint_names) if robot.torso is not None else 0
            if not shared or (path[:, :shared] == path[0, :shared]).all():
                continue
            for arm in self._scene.arms.values():
                if arm.robot is robot and arm.name not in paths:
                    if arm in self._holders():
                        raise NoMotionError(f"{arm.name} holds the object, and would be moved by {name}")
                    found[arm.name] = np.tile(self._state.joints(arm), (len(path), 1))
                    found[arm.name][:, :shared] = path[:, :shared]
        return found

    def _move_hand(self, kind: Kind, grip: Grip, start: float | None, end: float, task: PlanTask) -> None:
        """Open or close a hand, from the opening (m) at which it is, None where it is as at home."""
        arm = grip.arm
        if start == end:
            return
        q = self._state.joints(arm)
        openings = [] if start is None else _openings(arm, start, end)
        states = [self._state, *(self._state.with_arm(arm, q, opening) for opening in openings[1:])]
        if start is None:
            states.append(self._state.with_arm(arm, q, end))
        touching = [arm, *self._holders()]
        situation = self._bodies.situation(self._state, [], hands=[arm], touching=touching)
        rows = np.array([situation.row(state) for state in states])
        found, hits = prove(situation, rows[:-1], rows[1:], STATED)
        if not (found >= 0).all():
            verb = "closing" if kind == "close" else "opening"
            raise NoMotionError(
                f"{verb} the hand of {arm.name} in {task.name}: {blockers(situation, hits[found < 0])}"
            )
        path = {arm.name: np.array([q, q])}
        self._append(kind, path, task, task, float(found.min()), {arm.name: (start, end)})
        self._state, self._opening[arm.name] = states[-1], end


@contextmanager
def _part(what: str) -> Iterator[None]:
    """Say which part of the motion it is that was not found."""
    try:
        yield
    except NoMotionError as error:
        raise NoMotionError(f"{what}: {error}") from None


def _kept(before: PlanTask, task: PlanTask) -> list[str]:
    """Return the arms that hold the object in both tasks, by the same grasp."""
    grasps = {hold.arm: hold.grasp for hold in task.holds}
    return [hold.arm for hold in before.holds if grasps.get(hold.arm) == hold.grasp]


def _tilt_of(T_world_object: Array) -> float:
    """Return the tilt (rad) of the axis of an object at a pose (4, 4)."""
    x, y, z = T_world_object[:3, 2]
    return float(np.arctan2(np.hypot(x, y), z))


def _row(rows: Array, row: Array) -> int:
    return int(np.abs(rows - row).max(axis=1).argmin())


def _openings(arm: Arm, start: float, end: float) -> list[float]:
    """Return openings (m) from one to another, with those between at which the joints of the hand bend."""
    knots = {x for table in arm.hand.joints.values() if not isinstance(table, (int, float)) for x, _ in table}
    low, high = min(start, end), max(start, end)
    between = sorted(x for x in knots if low < x < high)
    return [start, *(between if start < end else between[::-1]), end]
