"""Ways for the object: off what it rests on, on to the next task, and down again, with one arm or several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symgrasp.errors import SceneError
from symgrasp.motion.bodies.motion_scene import MotionScene, Rest
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.bodies.state import State
from symgrasp.motion.drafting.course import Part, part_of
from symgrasp.motion.drafting.taking import COMBINATIONS, combinations
from symgrasp.motion.drafting.ways import Grip, lifted, straight
from symgrasp.motion.paths.lines import Leg, LineTree, follow
from symgrasp.motion.paths.search import NoMotionError, blockers, connect, prove
from symgrasp.motion.segments import Kind
from symgrasp.plan.plan import PlanTask
from symgrasp.poses import Array, inverse
from symgrasp.progress import Progress, at_start
from symgrasp.scene.scene import Scene

__all__ = ["ROOM_TOGETHER", "Stretch", "TiltLimit", "carry_alone", "carry_together", "tilt_limit"]

SLIP = 2.5e-4
"""How far (m) an arm may have any point of an object off its path that it holds with others."""

ROOM_TOGETHER = 3e-4
"""How far (m) these arms may be off their paths besides, when those are rounded."""

TILT_KEPT, TILT_SHARE = np.deg2rad(0.5), 0.2
"""Angle (rad), and share of the limit at most, that is kept of a limit of the tilt to round paths."""


class TiltLimit(NamedTuple):
    """How far the object may tilt.

    Attributes:
        largest: angle (rad) of its axis from the vertical on lines of the path.
        kept: by what angle (rad) it may be more where the path is rounded.
    """

    largest: float = np.inf
    kept: float = np.inf


class Stretch(NamedTuple):
    """The poses of the object in a segment to be.

    Attributes:
        kind: of the segment.
        poses: (4, 4) each.
        rest: what the object rests on at one of its ends.
    """

    kind: Kind
    poses: Sequence[Array]
    rest: Rest


def tilt_limit(scene: Scene, before: PlanTask, task: PlanTask) -> TiltLimit:
    """Return how far the object may tilt on the way from a task to the next.

    Raises:
        SceneError: it is tilted further in one of them.
    """
    carries = scene.file.carries()
    own = [c.tilt_deg for c in carries if c.tasks == (before.name, task.name)]
    limits = own or [c.tilt_deg for c in carries if c.tasks is None]
    if not limits:
        return TiltLimit()
    limit = np.deg2rad(min(limits))
    kept = min(TILT_KEPT, TILT_SHARE * limit)
    for end in (before, task):
        x, y, z = end.object_pose_turned.array()[:3, 2]
        tilt = float(np.arctan2(np.hypot(x, y), z))
        if tilt >= limit - kept:
            least = np.rad2deg(tilt + kept)
            expected = f"more than {least:.1f}°, as task {end.name} needs, or limits of pairs of tasks"
            raise SceneError(scene.source, "carry: tilt_deg", min(limits), expected)
    return TiltLimit(limit - kept, kept)


def carry_alone(
    bodies: MotionScene,
    state: State,
    grip: Grip,
    goal: Array,
    choices: Array,
    arrivals: Array,
    tilt: float,
    seed: int,
    progress: Progress | None,
) -> list[Part]:
    """Carry the object with one arm.

    Args:
        bodies: the pieces of the scene.
        state: where everything is.
        grip: the grasp.
        goal: pose (4, 4) of the object at the end.
        choices: (m, n) configurations in which the arm may hold the object at first.
        arrivals: (m, n) configurations in which it may hold it at last.
        tilt: largest tilt (rad) of the object.
        seed: of the random numbers.
        progress: called now and then; may raise `Cancelled`.

    Raises:
        NoMotionError: no way was found.
    """
    with part_of("its start"):
        lift, out = _off(bodies, state, grip, choices, progress)
    with part_of("its end"):
        lower, back = _off(bodies, state.with_object(goal), grip, arrivals, progress)
    held = _holding(state, grip)
    situation = bodies.situation(held, [grip.arm], held_by=[grip.arm], tilt=tilt)
    path = connect(situation, out.ends, back.ends, seed, progress)
    start, end = out.path(_row(out.ends, path[0])), back.path(_row(back.ends, path[-1]))
    return [Part("lift", lift, start), Part("carry", situation, path), Part("lower", lower, end[::-1])]


def _off(
    bodies: MotionScene, state: State, grip: Grip, choices: Array, progress: Progress | None
) -> tuple[Situation, LineTree]:
    """Return the straight ways off what the object rests on, from some configurations (m, n)."""
    T = state.T_world_object
    rest = bodies.rest(T)
    held = _holding(state, grip)
    situation = bodies.situation(held, [grip.arm], held_by=[grip.arm], rest=rest)
    poses = straight(T, lifted(T, rest)) if rest.pieces else [T]
    leg = Leg(situation, [grip.tool(pose) for pose in poses])
    return situation, follow([leg], grip.fine, choices, progress=progress)


def _holding(state: State, grip: Grip) -> State:
    """Return a state with the object in a hand, in any configuration."""
    q = grip.configurations(state.T_world_object)
    if not len(q):
        raise NoMotionError("no configuration reaches the grasp")
    return state.with_arm(grip.arm, q[0], grip.closed)


def carry_together(
    bodies: MotionScene,
    state: State,
    grips: Sequence[Grip],
    stretches: Sequence[Stretch],
    choices: Mapping[str, Array],
    tilt: float,
    progress: Progress | None,
) -> list[Part]:
    """Move the object with several arms along given poses.

    Args:
        bodies: the pieces of the scene.
        state: where everything is.
        grips: the grasps.
        stretches: the poses.
        choices: arm → configurations (m, n) in which it may hold the object at first.
        tilt: largest tilt (rad) of the object.
        progress: called now and then; may raise `Cancelled`.

    Raises:
        NoMotionError: no way was found.
    """
    arms, at = [grip.arm for grip in grips], state
    trees: dict[str, LineTree] = {}
    for grip in grips:
        name, others = grip.arm.name, [arm for arm in arms if arm is not grip.arm]
        held = _holding(state, grip)
        legs = [
            Leg(
                bodies.situation(
                    held, [grip.arm], held_by=[grip.arm, *others], without=others, rest=s.rest, tilt=tilt
                ),
                [grip.tool(pose) for pose in s.poses],
            )
            for s in stretches
        ]
        furthest = _furthest(bodies.scene, grip)
        with part_of(name):
            trees[name] = follow(
                legs, grip.fine, choices[name], deviation=SLIP, distance=furthest, progress=progress
            )
        at = at.with_arm(grip.arm, trees[name].path(0)[0], grip.closed)
    situations = [bodies.situation(at, arms, held_by=arms, rest=s.rest, tilt=tilt) for s in stretches]
    ends = np.cumsum([0, *(len(s.poses) - 1 for s in stretches)])
    hits = np.zeros((0, 2), dtype=np.int64)
    lines = {
        name: [tree.path(int(end)) for end in np.argsort(-tree.value)[:COMBINATIONS]]
        for name, tree in trees.items()
    }
    for chosen in combinations(lines):
        if progress:
            progress(0.0)
        rows = situations[0].stacked(chosen)
        if any(not np.array_equal(own, chosen[name]) for name, own in situations[0].by_arm(rows).items()):
            continue  # arms of one body need one torso
        paths = [rows[a : b + 1] for a, b in pairwise(ends)]
        tell = at_start(progress)
        proofs = [
            prove(s, path[:-1], path[1:], progress=tell) for s, path in zip(situations, paths, strict=True)
        ]
        if all(proof.free.all() for proof in proofs):
            return [
                Part(stretch.kind, situation, path)
                for stretch, situation, path in zip(stretches, situations, paths, strict=True)
            ]
        hits = np.concatenate([proof.hits[~proof.free] for proof in proofs])
    raise NoMotionError(blockers(situations[0], hits))


def _furthest(scene: Scene, grip: Grip) -> float:
    """Return how far (m) points of the object are from the tool, at most."""
    profile = scene.profile
    ends = np.array([[0.0, 0.0, h, 1.0] for h in (profile.h_min, profile.h_max)])
    away = np.linalg.norm((ends @ inverse(grip.T_object_tool).T)[:, :3], axis=1).max()
    return float(away + profile.points[:, 1].max())


def _row(rows: Array, row: Array) -> int:
    return int(np.abs(rows - row).max(axis=1).argmin())
