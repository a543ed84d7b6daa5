"""Choose among plans the grasps whose motion exists."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from contextlib import closing
from itertools import groupby, islice
from typing import NamedTuple

from symgrasp.errors import NoPlanError
from symgrasp.motion.paths.search import NoMotionError
from symgrasp.motion.planning import MotionPlanner
from symgrasp.motion.record import with_motion
from symgrasp.motion.segments import Motion
from symgrasp.motion.times.timing import timed
from symgrasp.plan.plan import Plan
from symgrasp.progress import Progress, part_of
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

__all__ = ["MOST_TRIED", "Failure", "best_motion", "failures_in_words", "moving_plans"]

MOST_TRIED = 200
"""Most plans that are tried."""


class Failure(NamedTuple):
    """A plan without a motion.

    Attributes:
        number: of the plan, from 1 on.
        reason: which part of the motion is missing, and why.
    """

    number: int
    reason: str


def best_motion(
    scene: Scene, plans: Generator[Plan], best: int = 1, seed: int = 0, progress: Progress | None = None
) -> tuple[Plan, list[Failure]]:
    """Return the first of some plans that has a motion, with it; or the fastest of the first few.

    Args:
        scene: the scene.
        plans: its plans, best first; closed in the end.
        best: how many plans with a motion are compared by its duration.
        seed: of the random numbers.
        progress: called with the finished share of each plan; may raise `Cancelled`.

    Returns:
        The plan, and what failed for those that were tried before.

    Raises:
        NoMotionError: none has one; says why.
    """
    failures: list[Failure] = []
    with closing(plans):
        found = list(islice(moving_plans(scene, plans, failures, seed, progress), best))
    if not found:
        raise NoMotionError("no motion: " + "; ".join(failures_in_words(failures)))
    plan, motion = min(found, key=lambda pair: pair[1].duration)
    return with_motion(plan, motion), failures


def moving_plans(
    scene: Scene,
    plans: Iterable[Plan],
    failures: list[Failure],
    seed: int = 0,
    progress: Progress | None = None,
) -> Generator[tuple[Plan, Motion]]:
    """Yield the plans that have a motion, in their order, with it.

    Args:
        scene: the scene.
        plans: its plans.
        failures: receives what failed for the others.
        seed: of the random numbers.
        progress: called with the finished share of each plan; may raise `Cancelled`.
    """
    with open_world(scene, progress) as world:
        planner = MotionPlanner(scene, world, progress)
        for number, plan in enumerate(islice(plans, MOST_TRIED), start=1):
            try:
                moving, motion = planner.plan(plan, seed, part_of(progress, 0, 2))
                motion = timed(motion, part_of(progress, 1, 2))
            except NoPlanError as error:  # no way, or none within the limits of speed
                failures.append(Failure(number, str(error)))
            else:
                yield moving, motion


def failures_in_words(failures: Iterable[Failure]) -> list[str]:
    """Say what failed, plans in a row with the same reason together."""
    lines = []
    for reason, group in groupby(failures, key=lambda failure: failure.reason):
        numbers = [failure.number for failure in group]
        one = len(numbers) == 1
        lines.append(f"plan {numbers[0]}: {reason}" if one else f"plans {numbers[0]}–{numbers[-1]}: {reason}")
    return lines
