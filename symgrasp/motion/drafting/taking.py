"""How arms come to their grasps of the object, and how they let go of it: several at the same time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import product

import numpy as np

from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.drafting.course import Course, part_of, prove_path
from symgrasp.motion.drafting.ways import retreating
from symgrasp.motion.paths.lines import Leg, follow
from symgrasp.motion.paths.search import NoMotionError, connect
from symgrasp.motion.segments import Kind
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm

__all__ = ["COMBINATIONS", "combinations", "leave", "take"]

COMBINATIONS = 64
"""Combinations of the paths of several arms that are tried."""

RANKED = 1024
"""About so many are ordered by how good they are."""


def take(
    course: Course,
    lines: Mapping[str, Sequence[Array]],
    task: str,
    seed: int,
    progress: Progress | None,
) -> dict[str, Array]:
    """Have some arms take the object: they reach for it, and when all are there they approach and close.

    Args:
        course: what they do is added to it.
        lines: arm → (n, dof) straight approaches to choose from, the best one first; all are of one grasp.
        task: where the object is.
        seed: of the random numbers.
        progress: called now and then; may raise `Cancelled`.

    Returns:
        Arm → (dof,) configuration in which it holds the object.

    Raises:
        NoMotionError: no way was found.
    """
    # Until its hand is closed an arm does not hold anything.
    grips = {name: course.held.pop(name) for name in lines}
    course.undecided -= lines.keys()
    arms, who = [grip.arm for grip in grips.values()], ", ".join(lines)
    course.move_hands("open", {name: grip.open for name, grip in grips.items()}, task, away=True)
    with part_of(f"the approach of {who} in {task}"):
        ways = list(_free_together(_touching(course, arms), lines, progress))
    state, reaches = course.state, {}
    for name, grip in grips.items():
        situation = course.bodies.situation(state, [grip.arm], touching=course.holders())
        with part_of(f"the reach of {name} to {task}"):
            starts = np.unique([way[name][0] for way in ways], axis=0)
            path = connect(situation, state.joints(grip.arm)[None], starts, seed, progress)
        state, reaches[name] = state.with_arm(grip.arm, path[-1]), path
        ways = [way for way in ways if np.array_equal(way[name][0], path[-1])]
    _move_free(course, "reach", reaches, task, progress)
    with part_of(f"the approach of {who} in {task}"):
        situation = _touching(course, arms)
        course.add("approach", situation, situation.stacked(ways[0]), task)
    course.move_hands("close", {name: grip.closed for name, grip in grips.items()}, task)
    course.held |= grips
    return {name: line[-1] for name, line in ways[0].items()}


def leave(
    course: Course,
    names: Sequence[str],
    task: str,
    least: float,
    seed: int,
    progress: Progress | None,
) -> None:
    """Have some arms let go of the object: all open and retreat, then they go home.

    Args:
        course: what they do is added to it.
        names: the arms.
        task: where the object is.
        least: least length (m) of the retreat.
        seed: of the random numbers.
        progress: called now and then; may raise `Cancelled`.

    Raises:
        NoMotionError: no way was found.
    """
    grips = {name: course.held.pop(name) for name in names}
    arms, who = [grip.arm for grip in grips.values()], ", ".join(names)
    course.move_hands("open", {name: grip.open for name, grip in grips.items()}, task)
    state, bodies = course.state, course.bodies
    with part_of(f"the retreat of {who} in {task}"):
        lines = {}
        for name, grip in grips.items():
            others = [arm for arm in arms if arm is not grip.arm]
            touching = [grip.arm, *course.holders()]
            alone = bodies.situation(state, [grip.arm], touching=touching, without=others)
            poses = retreating(grip, state.T_world_object, least, bodies.scene.profile)
            tree = follow([Leg(alone, poses)], grip.fine, state.joints(grip.arm)[None], progress=progress)
            lines[name] = [tree.path(int(k)) for k in np.argsort(-tree.value)]
        situation = _touching(course, arms)
        way = next(_free_together(situation, lines, progress))
        course.add("retreat", situation, situation.stacked(way), task)
    state, ways = course.state, {}
    for name, arm in zip(grips, arms, strict=True):
        situation = bodies.situation(state, [arm], touching=course.holders())
        with part_of(f"the way home of {name} from {task}"):
            here, home = state.joints(arm), arm.robot.home[arm.indices]
            home = np.where(_shared(course.holders(), arm), here, home)
            ways[name] = connect(situation, here[None], home[None], seed, progress)
        state = state.with_arm(arm, ways[name][-1])
    _move_free(course, "home", ways, task, progress)


def _move_free(
    course: Course, kind: Kind, paths: Mapping[str, Array], task: str, progress: Progress | None
) -> None:
    """Move some arms along paths (n, dof) in free space: at the same time where there is room, or in turn.

    Args:
        course: what they do is added to it.
        kind: of the segments.
        paths: arm → its path, free while those before it are at the ends of theirs.
        task: where the object is.
        progress: called now and then; may raise `Cancelled`.
    """
    situation, holders = course.bodies.situation, course.holders()
    arms = {name: course.bodies.scene.arm(name) for name in paths}
    together = situation(course.state, list(arms.values()), touching=holders)
    with suppress(NoMotionError):
        way = next(_free_together(together, {name: [path] for name, path in paths.items()}, progress))
        course.add(kind, together, together.stacked(way), task)
        return
    for name, arm in arms.items():
        course.add(kind, situation(course.state, [arm], touching=holders), paths[name], task)


def combinations(lines: Mapping[str, Sequence[Array]]) -> Iterator[dict[str, Array]]:
    """Yield combinations of the paths of several arms, those of good ones first, in turn for all arms."""
    each = max(2, int(RANKED ** (1 / max(1, len(lines)))))
    ranks = product(*(range(min(len(paths), each)) for paths in lines.values()))
    for chosen in sorted(ranks, key=sum)[:COMBINATIONS]:
        yield {name: paths[k] for (name, paths), k in zip(lines.items(), chosen, strict=True)}


def _touching(course: Course, arms: Sequence[Arm]) -> Situation:
    """Return what moves and stands where some arms move whose fingers may touch the object."""
    return course.bodies.situation(course.state, arms, touching=[*arms, *course.holders()])


def _free_together(
    situation: Situation, lines: Mapping[str, Sequence[Array]], progress: Progress | None
) -> Iterator[dict[str, Array]]:
    """Yield the combinations of lines (n, dof) of some arms along which these keep free of each other.

    In each of them all lines have the same number of rows. A single arm is free of the others.

    Raises:
        NoMotionError: there is none; says what is in the way.
    """
    if len(lines) == 1:
        yield from ({name: path} for name, paths in lines.items() for path in paths)
        return
    found, why = False, NoMotionError("joints that the arms share would have to be at two values")
    for chosen in combinations(lines):
        if progress:
            progress(0.0)
        way = _at_equal_shares(chosen)
        rows = situation.stacked(way)
        if any(not np.array_equal(own, way[name]) for name, own in situation.by_arm(rows).items()):
            continue  # arms of one body need one torso
        try:
            prove_path(situation, rows, progress)
        except NoMotionError as error:
            why = error
        else:
            found = True
            yield way
    if not found:
        raise why


def _at_equal_shares(lines: Mapping[str, Array]) -> dict[str, Array]:
    """Return paths (m, dof) with the rows of all of them, each at the share of its own rows (n, dof)."""
    # Rounded, for what is equal but for rounding to be one row.
    shares = np.unique(
        np.concatenate([np.linspace(0.0, 1.0, len(line)).round(12) for line in lines.values()])
    )
    return {
        name: np.stack([np.interp(shares * (len(line) - 1), np.arange(len(line)), q) for q in line.T], axis=1)
        for name, line in lines.items()
    }


def _shared(holders: Sequence[Arm], arm: Arm) -> np.ndarray:
    """Return which joints (dof,) of an arm also carry one of some others: those of a torso."""
    others = {name for holder in holders if holder.robot is arm.robot for name in holder.joint_names}
    return np.array([name in others for name in arm.joint_names])
