"""Motions: how long whole ones take to plan, and free ones against what people do today.

Free motions are measured on random problems: an arm between random boxes, from one random configuration to
another. The others search the same ones: RRT-Connect of OMPL, which asks PyBullet or the checks of this
project about every state, and roboplan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from itertools import islice, pairwise
from time import process_time
from typing import Any

import numpy as np

from symgrasp.bench.figures import Figure
from symgrasp.bench.rrt_connect import rrt_connect
from symgrasp.bench.timing import Time, ratios, time_of, times
from symgrasp.errors import SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.choosing import best_motion
from symgrasp.motion.moveit import srdf_of
from symgrasp.motion.paths.search import NoMotionError, connect, prove
from symgrasp.motion.times.reach import joint_reach
from symgrasp.planners.planning import bimanual_plans, handover_plans, sequential_plans
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, check_homes, open_world

__all__ = ["Problem", "free_motions", "problems", "proofs", "run", "touches", "whole_motions"]

WHOLE: dict[str, Callable[..., Any]] = {
    "pick_pour_place": lambda scene, maps: sequential_plans(scene, maps=maps),
    "log_two_robots": lambda scene, maps: bimanual_plans(scene, maps=maps),
    "handover_between_robots": lambda scene, maps: handover_plans(scene, maps),
    "log_four_robots": lambda scene, maps: bimanual_plans(scene, maps=maps),
}
"""Shipped scene → what lists its plans from the maps of its tasks."""

BOXES = 8
"""Random boxes around the arm."""

EACH_SCENE = 10
"""Problems with the same boxes."""

LOOK = 0.05
"""Distances up to it (m) are asked of PyBullet."""

BODY_STEP = 5e-4
"""Distance (m) that nothing moves further between two states which PyBullet looks at."""

INSIDE = 1e-5
"""How deep (m) bodies may be in each other for PyBullet, which reads URDFs in single precision."""

LONGER = 10
"""How many times as long as this project OMPL may search."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A free motion to find.

    Attributes:
        world: the bodies.
        situation: what moves and stands.
        limits: (2, n) of the joints.
        start: (n,) joint values.
        goal: (n,) joint values.
        number: seed of the random numbers.
    """

    world: BulletWorld
    situation: Situation
    limits: Array
    start: Array
    goal: Array
    number: int

    def solve(self) -> Array | None:
        """Return a path (m, n), as this project finds it, None if it finds none."""
        try:
            return connect(self.situation, self.start[None], self.goal[None], self.number)
        except NoMotionError:
            return None

    def free(self, q: Array) -> bool:
        """Whether the arm is free at joint values (n,), by the checks of this project."""
        return bool(prove(self.situation, q[None], q[None]).free[0])

    def free_in_bullet(self, q: Array) -> bool:
        """Whether the arm is free at joint values (n,), by PyBullet."""
        arm = self.world.scene.arm()
        self.world.set_robot(arm.robot.name, arm.robot_values(q))
        return self.world.first_collision(arm) is None


def run(quick: bool = False) -> Iterator[Figure]:
    """Run the benchmarks of motions and yield their figures as they are measured.

    Args:
        quick: with few runs of each.
    """
    yield from whole_motions(seeds=2 if quick else 20)
    yield from free_motions(count=4 if quick else 20)
    yield from proofs(count=10 if quick else 300)


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


def free_motions(count: int) -> Iterator[Figure]:
    """Time free motions against RRT-Connect with PyBullet, and against roboplan."""
    own: list[Time] = []
    bullet: list[tuple[Time, Time]] = []
    other: list[tuple[Time, Time]] = []
    missing = ""
    for problem in islice(_solvable(), count):
        mine = time_of(problem.solve)
        own.append(mine)
        bullet.append((time_of(lambda p=problem: _with_bullet(p)), mine))
        try:
            search = _roboplan(problem)
        except ImportError:
            missing = ": roboplan is not installed"
        else:
            other.append((time_of(search), mine))
    yield times("free motion between random boxes", "ms", own)
    yield ratios("  RRT-Connect of OMPL with PyBullet, times as long", bullet)
    yield ratios("  roboplan, times as long", other) if other else Figure(f"  roboplan{missing}", "×", ())


def proofs(count: int) -> Iterator[Figure]:
    """Look in PyBullet at free motions step by step, and at how many OMPL finds in ten times the time."""
    solved: list[float] = []
    others: list[float] = []
    wrong: list[float] = []
    for problem in islice(problems(), count):
        start = process_time()
        path = problem.solve()
        end = process_time() + LONGER * (process_time() - start)
        solved.append(float(path is not None))
        if path is not None:
            wrong.append(float(touches(problem, path)))
        theirs = rrt_connect(
            problem.limits, problem.start, problem.goal, problem.free, lambda end=end: process_time() > end
        )
        others.append(float(theirs is not None))
    yield Figure(f"{count} random free motions: found", "", (float(np.mean(solved)),))
    yield Figure(f"  found by OMPL in {LONGER} times the time", "", (float(np.mean(others)),))
    yield Figure("  share that touches something, by PyBullet", "", (float(np.mean(wrong)),))


def problems(seed: int = 0) -> Iterator[Problem]:
    """Yield random problems; their worlds are closed when the next boxes are drawn."""
    rng = np.random.default_rng(seed)
    content = Scene.load("pick_pour_place").content
    tasks = [{**content["tasks"][0], "supported": False}]
    number = 0
    while True:
        obstacles = [_box(rng, k) for k in range(BOXES)]
        scene = Scene.from_content({**content, "obstacles": obstacles, "tasks": tasks})
        try:
            check_homes(scene)
        except SceneError:  # a box is where the arm stands
            continue
        with open_world(scene) as world:
            bodies, arm = MotionScene(scene, world), scene.arm()
            situation = bodies.situation(bodies.home(), [arm])
            limits = np.stack([arm.lower, arm.upper])
            q = rng.uniform(arm.lower, arm.upper, (400, arm.dof))
            free = q[prove(situation, q, q).free]
            for start, goal in islice(zip(free[::2], free[1::2], strict=False), EACH_SCENE):
                yield Problem(world, situation, limits, start, goal, number)
                number += 1


def touches(problem: Problem, path: Array) -> bool:
    """Whether PyBullet finds the arm inside of something along a path (m, n).

    Nothing moves further between two states than `BODY_STEP`, or than it is away from everything else.
    """
    world, arm = problem.world, problem.world.scene.arm()
    reach = joint_reach(arm.robot.model)[arm.indices]
    for a, b in pairwise(path):
        moved, at = float(np.abs(b - a) @ reach), 0.0
        while True:
            share = min(at / moved, 1.0) if moved else 1.0
            world.set_robot(arm.robot.name, arm.robot_values(a + share * (b - a)))
            gap = world.clearance(arm, LOOK)
            if gap < -INSIDE:
                return True
            if share == 1.0:
                break
            at += max(BODY_STEP, gap)
    return False


def _solvable() -> Iterator[Problem]:
    """Yield random problems that have a solution."""
    return (problem for problem in problems() if problem.solve() is not None)


def _with_bullet(problem: Problem) -> None:
    path = rrt_connect(problem.limits, problem.start, problem.goal, problem.free_in_bullet, lambda: False)
    assert path is not None


def _box(rng: np.random.Generator, number: int) -> dict[str, Any]:
    """Return a random box around an arm at the origin, as scenes have it."""
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.35, 0.8)
    position = [distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.0, 0.9)]
    turn = [float(part) for part in rng.uniform(-180, 180, 3)]
    size = [float(part) for part in rng.uniform(0.05, 0.3, 3)]
    place = {"position": [float(part) for part in position], "rpy_deg": turn}
    return {"name": f"box {number}", "box": size, "pose": place}


def _roboplan(problem: Problem) -> Callable[[], None]:
    """Return what lets roboplan search a problem, with the same boxes, and a cylinder for the object.

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
    options = rrt.RRTOptions(group_name=arm.name, max_nodes=100_000, rrt_connect=True)
    search = rrt.RRT(other, options)
    search.setRngSeed(problem.number)
    ends = [core.JointConfiguration(list(arm.joint_names), q) for q in (problem.start, problem.goal)]
    shorter = core.PathShortcutter(other, core.PathShortcuttingOptions(group_name=arm.name))
    return lambda: shorter.shortcut(search.plan(*ends))
