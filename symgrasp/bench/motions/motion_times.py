"""Motions: how long whole ones take to plan, and free ones against what people do today.

Free motions are measured on random problems, see `symgrasp.bench.motions.free_problems`. The others search
the same ones: RRT-Connect of OMPL, which asks PyBullet or the checks of this project about every state, and
roboplan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from itertools import combinations, islice
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from symgrasp.bench.figures import Figure
from symgrasp.bench.motions.free_problems import PROBLEMS, Problem, touches
from symgrasp.bench.motions.rrt_connect import Found, rrt_connect
from symgrasp.bench.timing import Time, ratios, time_of, times
from symgrasp.feasibility.create import MapMaker
from symgrasp.motion.choosing import best_motion
from symgrasp.motion.moveit import srdf_of
from symgrasp.motion.paths.search import NoMotionError
from symgrasp.planners.planning import bimanual_plans, handover_plans, sequential_plans
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

__all__ = ["free_motions", "proofs", "run", "whole_motions"]

WHOLE: dict[str, Callable[..., Any]] = {
    "pick_pour_place": lambda scene, maps: sequential_plans(scene, maps=maps),
    "log_two_robots": lambda scene, maps: bimanual_plans(scene, maps=maps),
    "handover_between_robots": lambda scene, maps: handover_plans(scene, maps),
    "log_four_robots": lambda scene, maps: bimanual_plans(scene, maps=maps),
}
"""Shipped scene → what lists its plans from the maps of its tasks."""

LONGER = 10
"""How many times as long as this project OMPL may search, in CPU time."""

PATIENCE = 10.0
"""CPU time (s) after which the others give up: what they took then is less than what they would need."""


def run(quick: bool = False) -> Iterator[Figure]:
    """Run the benchmarks of motions and yield their figures as they are measured.

    Args:
        quick: with few runs of each.
    """
    yield from whole_motions(seeds=2 if quick else 20)
    for kind in PROBLEMS:
        yield from free_motions(kind, count=2 if quick else 20)
    for kind in PROBLEMS:
        yield from proofs(kind, count=4 if quick else 150)


def whole_motions(seeds: int) -> Iterator[Figure]:
    """Plan motions of shipped scenes with different random numbers, once the maps exist."""
    for name, plans in WHOLE.items():
        scene = Scene.load(name)
        with open_world(scene) as world:
            maker, tasks = MapMaker(world), scene.tasks.values()
            maps = {(task.name, arm): maker.map(arm, task) for task in tasks for arm in task.arms}
        found: list[float] = []

        def plan(seed: int, scene=scene, maps=maps, plans=plans, found=found) -> None:
            try:
                best_motion(scene, plans(scene, maps), seed=seed)
                found.append(1.0)
            except NoMotionError:
                found.append(0.0)

        plan(0)  # compiles what is not compiled yet
        found.clear()
        taken = [time_of(lambda seed=seed: plan(seed)) for seed in range(seeds)]
        yield times(f"{name}: motion, once the maps exist", "s", taken)
        yield Figure("  found", "", (float(np.mean(found)),))


def free_motions(kind: str, count: int) -> Iterator[Figure]:
    """Time free motions against RRT-Connect with PyBullet, and against roboplan.

    All three shorten the path that they found. They are compared with that, without it, and where it counts
    for this project alone. What they do not find within `PATIENCE` counts with the time they took.

    Args:
        kind: a key of `PROBLEMS`.
        count: how many that this project solves.
    """
    own: list[Time] = []
    own_search: list[Time] = []
    others: dict[str, list[_Rival]] = {"RRT-Connect of OMPL with PyBullet": [], "roboplan": []}
    missing = ""
    for problem in islice((p for p in PROBLEMS[kind](0) if p.solve() is not None), count):
        own.append(time_of(problem.solve))
        own_search.append(time_of(problem.search))
        bullet, other = others.values()
        bullet.append(_rival(lambda p=problem: _with_bullet(p)))
        try:
            other.append(_rival(_roboplan(problem)))
        except ImportError:
            missing = ": not installed"
    yield times(f"free motion {kind}", "ms", own)
    yield times("  before it is shortened", "ms", own_search)
    for name, runs in others.items():
        if not runs:
            yield Figure(f"  {name}{missing}", "×", ())
            continue
        whole = [(run.search + run.shortening, mine) for run, mine in zip(runs, own, strict=True)]
        alone = [(run.search, mine) for run, mine in zip(runs, own, strict=True)]
        searched = [(run.search, mine) for run, mine in zip(runs, own_search, strict=True)]
        yield ratios(f"  {name}, times as long", whole)
        yield ratios(f"  {name}, times as long before either path is shortened", searched)
        yield ratios(f"  {name}, times as long without its shortening", alone)
        yield Figure(f"  {name}, found", "", (float(np.mean([run.found for run in runs])),))


class _Rival(NamedTuple):
    """What another planner took to search a path, and to shorten it, and whether it found one."""

    search: Time
    shortening: Time
    found: bool


def _rival(search: Callable[[], Callable[[], Any] | None]) -> _Rival:
    """Time another planner.

    Args:
        search: searches a path; returns what shortens it, None if it finds none.
    """
    found: list[Callable[[], Any] | None] = []
    searched = time_of(lambda: found.append(search()))
    (shorten,) = found
    return _Rival(searched, time_of(shorten) if shorten else Time(0.0, 0.0), shorten is not None)


def proofs(kind: str, count: int) -> Iterator[Figure]:
    """Look in PyBullet at free motions step by step, and at how many OMPL finds in ten times the time.

    Args:
        kind: a key of `PROBLEMS`.
        count: how many of them.
    """
    solved: list[float] = []
    others: list[float] = []
    wrong: list[float] = []
    for problem in islice(PROBLEMS[kind](1), count):
        start = process_time()
        path = problem.solve()
        taken = process_time() - start
        theirs = rrt_connect(
            problem.limits, problem.start, problem.goal, problem.free, _within(LONGER * taken)
        )
        solved.append(float(path is not None))
        others.append(float(theirs is not None))
        if path is not None:
            wrong.append(float(touches(problem, path)))
    yield Figure(f"{count} free motions {kind}: found", "", (float(np.mean(solved)),))
    yield Figure(f"  found by OMPL in {LONGER} times the time", "", (float(np.mean(others)),))
    yield Figure("  share that touches something, by PyBullet", "", (float(np.mean(wrong)),))


def _within(seconds: float) -> Callable[[], bool]:
    """Return what says whether so much CPU time (s) has passed since now."""
    end = process_time() + seconds
    return lambda: process_time() > end


def _with_checks(problem: Problem, stop: Callable[[], bool]) -> Found | None:
    return rrt_connect(problem.limits, problem.start, problem.goal, problem.free, stop)


def _with_bullet(problem: Problem) -> Callable[[], Any] | None:
    valid, stop = problem.free_in_bullet, _within(PATIENCE)
    found = rrt_connect(problem.limits, problem.start, problem.goal, valid, stop)
    return found and found.shorten


def _roboplan(problem: Problem) -> Callable[[], Callable[[], Any] | None]:
    """Return what lets roboplan search a problem, with the same boxes but without the object.

    Raises:
        ImportError: roboplan is not installed.
    """
    core, rrt = import_module("roboplan.core"), import_module("roboplan.rrt")

    scene = problem.world.scene
    arm = scene.arm()
    path = arm.robot.model.path
    other = core.Scene("problem", core.loadUrdfSceneDescription(path, [path.parent]))
    other.importSrdf(srdf_of(scene))
    home = dict(zip(arm.robot.model.joint_names, arm.robot.home.tolist(), strict=True))
    other.setJointPositions(np.array([home[name] for name in other.getJointNames()]))  # of the fingers
    for obstacle in scene.obstacles:
        ((_, shape),) = obstacle.shapes()
        box = core.Box(*(float(part) for part in shape.size))
        place = obstacle.T_world_obstacle @ shape.pose
        other.addBoxGeometry(obstacle.name, "universe", box, place, np.ones(4))
    names = [obstacle.name for obstacle in scene.obstacles]
    other.setCollisions(list(combinations(names, 2)), False)  # what stands may touch
    options = rrt.RRTOptions(
        group_name=arm.name, max_nodes=100_000, max_planning_time=PATIENCE, rrt_connect=True
    )
    search = rrt.RRT(other, options)
    search.setRngSeed(problem.number)
    ends = [core.JointConfiguration(list(arm.joint_names), q) for q in (problem.start, problem.goal)]
    shorter = core.PathShortcutter(other, core.PathShortcuttingOptions(group_name=arm.name))

    def plan() -> Callable[[], Any] | None:
        try:
            path = search.plan(*ends)
        except RuntimeError:  # it found none
            return None
        return lambda: shorter.shortcut(path)

    return plan
