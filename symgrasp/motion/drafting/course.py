"""The segments of a motion so far, and where everything is after them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.bodies.state import State
from symgrasp.motion.drafting.ways import Grip
from symgrasp.motion.paths.search import STATED, NoMotionError, Proof, blockers, prove
from symgrasp.motion.segments import Kind, Opening, Segment
from symgrasp.plan.writing import ERROR, rounded_down
from symgrasp.poses import Array
from symgrasp.progress import Progress, at_start
from symgrasp.robot.robot import Arm

__all__ = ["Course", "Part", "part_of", "prove_path"]


class Part(NamedTuple):
    """A segment to be.

    Attributes:
        kind: what it is for.
        situation: what moves and stands.
        path: (n, J) joint values.
    """

    kind: Kind
    situation: Situation
    path: Array


class Course:
    """The segments so far.

    Args:
        bodies: the pieces of the scene.
        state: where everything is at the start.
        progress: called now and then; may raise `Cancelled`.

    Attributes:
        bodies: the same.
        state: where everything is now.
        held: the arms that have taken the object, or will before anything else happens, with their grasps.
        undecided: those of them of which is not known yet in which configuration.
        segments: so far.
    """

    def __init__(self, bodies: MotionScene, state: State, progress: Progress | None = None) -> None:
        self.bodies, self.state, self._progress = bodies, state, progress
        self.held: dict[str, Grip] = {}
        self.undecided: set[str] = set()
        self.segments: list[Segment] = []
        self._opening: dict[str, float] = {}

    def copied(self) -> Course:
        """Return a course with the same segments, to which others can be added."""
        course = Course(self.bodies, self.state, self._progress)
        course.held, course.undecided = dict(self.held), set(self.undecided)
        course.segments, course._opening = list(self.segments), dict(self._opening)
        return course

    def holders(self) -> list[Arm]:
        """Return the arms that hold the object where they are."""
        return [grip.arm for name, grip in self.held.items() if name not in self.undecided]

    def add(self, kind: Kind, situation: Situation, path: Array, task: str) -> None:
        """Add a segment in a task in which the arms of a situation follow a path (n, J), and move there."""
        self._append(kind, situation.by_arm(path), (task, task), self._proof(situation, path))

    def carry(
        self, parts: Sequence[Part], tasks: tuple[str, str], end: Array, tilt: float, room: float
    ) -> None:
        """Add the segments in which the object is carried.

        Args:
            parts: the segments; parts with a single row are left out.
            tasks: from which task to which; the carry itself leads from one to the other.
            end: pose (4, 4) of the object in the end.
            tilt: by what angle (rad) it may tilt further on the way than it does along the path.
            room: how far (m) any point of the arms may be off the path.
        """
        at, to = tasks
        for kind, situation, path in parts:
            if len(path) < 2:
                continue
            proof = self._proof(situation, path)
            self._append(
                kind,
                situation.by_arm(path),
                (at, to) if kind == "carry" else (at, at),
                proof._replace(room=np.minimum(proof.room, room)),
                tilt=tilt if kind == "carry" else np.inf,
            )
            at = to if kind == "carry" else at
        self.state = self.state.with_object(end)

    def move_hands(self, kind: Kind, ends: Mapping[str, float], task: str, *, away: bool = False) -> None:
        """Open or close hands at the same time, from where they are.

        Args:
            kind: ``open`` or ``close``.
            ends: arm → opening (m) of its hand at the end.
            task: where the object is.
            away: the hands are not at their grasps, so that no finger may touch the object.
        """
        ends = {name: end for name, end in ends.items() if self._opening.get(name) != end}
        known = {name: end for name, end in ends.items() if name in self._opening}
        for group in ({name: end for name, end in ends.items() if name not in known}, known):
            if group:
                self._move_hands(kind, group, task, away)

    def _move_hands(self, kind: Kind, ends: Mapping[str, float], task: str, away: bool) -> None:
        """Move hands of which all openings so far are known, or none: these are as they are at home."""
        arms = {name: self.bodies.scene.arm(name) for name in ends}
        openings = {name: (self._opening.get(name), end) for name, end in ends.items()}
        shares = sorted({0.0, 1.0}.union(*(_bends(arm, *openings[name]) for name, arm in arms.items())))
        states = [self.state]
        for share in shares[1:]:
            state = self.state
            for name, arm in arms.items():
                start, end = openings[name]
                opening = end if start is None or share == 1.0 else start + share * (end - start)
                state = state.with_arm(arm, state.joints(arm), opening)
            states.append(state)
        touching = self.holders() if away else [*arms.values(), *self.holders()]
        situation = self.bodies.situation(self.state, [], hands=list(arms.values()), touching=touching)
        rows = np.array([situation.row(state) for state in states])
        verb = "closing" if kind == "close" else "opening"
        with part_of(f"{verb} the {'hand' if len(arms) == 1 else 'hands'} of {', '.join(arms)} in {task}"):
            proof = self._proof(situation, rows)
        still = {name: np.array([self.state.joints(arm)] * 2) for name, arm in arms.items()}
        self._append(kind, still, (task, task), proof, openings)
        self.state, self._opening = states[-1], {**self._opening, **ends}

    def _proof(self, situation: Situation, path: Array) -> Proof:
        return prove_path(situation, path, self._progress)

    def _append(
        self,
        kind: Kind,
        paths: Mapping[str, Array],
        tasks: tuple[str, str],
        proof: Proof,
        gripper: Mapping[str, Opening] | None = None,
        tilt: float = np.inf,
    ) -> None:
        held_by = tuple(arm.name for arm in self.holders())
        paths = {**paths, **self._moved_along(paths)}
        self.segments.append(
            Segment(
                kind=kind,
                arms=tuple(paths),
                joints=paths,
                gripper=gripper or {},
                held_by=held_by,
                task_from=tasks[0],
                task_to=tasks[1],
                clearance=rounded_down(float(proof.clearance.min()) - ERROR),
                room=float(proof.room.min()),
                tilt_room=tilt,
            )
        )
        for name, path in paths.items():
            self.state = self.state.with_arm(self.bodies.scene.arm(name), path[-1])

    def _moved_along(self, paths: Mapping[str, Array]) -> dict[str, Array]:
        """Return the paths of arms that do not move themselves, but with a torso that moves.

        Raises:
            NoMotionError: one of them holds the object.
        """
        found: dict[str, Array] = {}
        for name, path in paths.items():
            robot = self.bodies.scene.arm(name).robot
            shared = len(robot.torso.joint_names) if robot.torso is not None else 0
            if not shared or (path[:, :shared] == path[0, :shared]).all():
                continue
            for arm in self.bodies.scene.arms.values():
                if arm.robot is robot and arm.name not in paths:
                    if arm in self.holders():
                        raise NoMotionError(f"{arm.name} holds the object, and would be moved by {name}")
                    found[arm.name] = np.tile(self.state.joints(arm), (len(path), 1))
                    found[arm.name][:, :shared] = path[:, :shared]
        return found


def prove_path(situation: Situation, path: Array, progress: Progress | None) -> Proof:
    """Return what is proven of the lines of a path (n, J).

    Args:
        situation: what moves and stands.
        path: the path.
        progress: called now and then with 0; may raise `Cancelled`.

    Raises:
        NoMotionError: one of them is not free; says what is in its way.
    """
    proof = prove(situation, path[:-1], path[1:], STATED, at_start(progress))
    if not proof.free.all():
        raise NoMotionError(blockers(situation, proof.hits[~proof.free]))
    return proof


@contextmanager
def part_of(what: str) -> Iterator[None]:
    """Say which part of the motion it is that was not found."""
    try:
        yield
    except NoMotionError as error:
        raise NoMotionError(f"{what}: {error}") from None


def _bends(arm: Arm, start: float | None, end: float) -> set[float]:
    """Return at which shares of the way from an opening (m) to another the joints of the hand bend."""
    if start is None:
        return set()
    knots = {x for table in arm.hand.joints.values() if not isinstance(table, (int, float)) for x, _ in table}
    low, high = min(start, end), max(start, end)
    return {(x - start) / (end - start) for x in knots if low < x < high}
