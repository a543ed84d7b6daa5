"""Times and success rates of the planners against sampling and hill climbing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symgrasp.bench.figures import Figure
from symgrasp.bench.timing import Time, ratios, time_of, times
from symgrasp.errors import NoPlanError
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.fit import fit
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.object.manifold import ROLLS
from symgrasp.planners.bimanual import Climb, hill_climb
from symgrasp.planners.configurations import ConfigurationFinder, witnesses
from symgrasp.planners.free import FreePlacement, FreePlacements
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch
from symgrasp.planners.planning import plan_sequential
from symgrasp.planners.sequential import surface_margin
from symgrasp.poses import Array, inverse, rotation_z, translation
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, Collision, NearBodies, open_world

__all__ = ["four_hands", "long_sequence", "run", "several_hands", "without_the_manifold"]


LIMITS = Climb(restarts=10, iterations=50)
"""Restarts and iterations of hill climbing; the paper does not state its own.

Twice as many of both find 2 % more, in three times the time.
"""


FIRST_FOUR = 4
"""Parts of maps that are searched twice, since the search compiles on their account."""


def run() -> Iterator[Figure]:
    """Run the benchmarks of planners and yield their figures as they are measured."""
    yield from long_sequence(tasks=50, runs=10)
    yield from without_the_manifold(runs=5)
    yield from several_hands(pairs=100)
    yield from four_hands(windows=51)


def long_sequence(tasks: int, runs: int) -> Iterator[Figure]:
    """Time the search of one grasp for many tasks: the maps of a shipped sequence, turned at random."""
    scene = Scene.load("pick_pour_place").with_settings(heights=48, angles=96, redundancy=4)
    maps = [create_map(scene, task=name) for name in scene.tasks]
    rng = np.random.default_rng(0)
    found = []
    for _ in range(runs):
        turns = rng.integers(0, 96, tasks) * scene.manifold.dtheta
        visits = [{"arm": maps[k % len(maps)].shift(turn)} for k, turn in enumerate(turns)]

        def search(visits=visits) -> None:
            search = HoldingSearch(visits, PrintGaps([], scene.manifold))
            found = next(search.best_first())
            for k in range(tasks):
                search.turns(found.cells, k)[0]

        found.append(time_of(search))
    yield times(f"one grasp for {tasks} tasks on 48 × 96 maps, once the maps exist", "ms", found)


class _CountingWorld(BulletWorld):
    """A world that counts collision checks."""

    checks = 0

    def first_collision(
        self, arm: Arm, among: NearBodies | None = None, links: Collection[str] | None = None
    ) -> Collision | None:
        """Count the check, and return its result."""
        self.checks += 1
        return super().first_collision(arm, among, links)


def without_the_manifold(runs: int) -> Iterator[Figure]:
    """Sample grasps and test each in every task, with as many collision checks as the maps took."""
    scene = Scene.load("pick_pour_place").with_settings(heights=12, angles=24, redundancy=8)
    tasks = list(scene.tasks.values())
    with _CountingWorld(scene) as world:
        maker = MapMaker(world)

        def with_maps() -> None:
            visits = [{"arm": maker.map(None, task, method="reference")} for task in tasks]
            next(HoldingSearch(visits, PrintGaps([], scene.manifold)).best_first())

        by_maps = time_of(with_maps)
        budget = world.checks
        successes: list[float] = []

        def sample(seed: int) -> None:
            successes.append(float(_sample_grasps(scene, tasks, world, budget, seed)))

        sampled = [time_of(lambda seed=seed: sample(seed)) for seed in range(runs)]
    plan_sequential(scene)  # compiles what is not compiled yet
    by_engine = time_of(lambda: plan_sequential(scene))
    name = "pick, pour, place by sampling, same budget of collision checks"
    yield Figure(f"{name}: success", "", tuple(successes))
    yield ratios("  time against maps of Algorithm 1 and planner", [(t, by_maps) for t in sampled])
    yield ratios("  time against the best plan, world and maps made anew", [(t, by_engine) for t in sampled])


def _sample_grasps(
    scene: Scene, tasks: Sequence[Task], world: _CountingWorld, budget: int, seed: int
) -> bool:
    """Whether a random grasp feasible in every task is found within a budget of collision checks.

    The tasks are taken as posed, without turning the object about its axis.
    """
    arm = scene.arm()
    checker = CandidateChecker(world, arm, solver_for(arm, scene.settings.samples), scene.settings.approach)
    rng = np.random.default_rng(seed)
    world.checks = 0
    T_base_world = inverse(arm.robot.T_world_base)
    while world.checks < budget:
        h = float(rng.uniform(scene.profile.h_min, scene.profile.h_max))
        theta, roll = rng.uniform(-np.pi, np.pi), rng.choice(ROLLS)
        if fit(arm.hand, scene.profile, h) is not None:
            continue
        radius = float(scene.profile.radius(h))

        def feasible(T_world_object: Array, h=h, theta=theta, roll=roll, radius=radius) -> bool:
            world.set_object(T_world_object)
            tool = arm.hand.tool_pose(T_world_object, h, theta, roll, radius)
            candidates = checker.candidates(T_base_world @ tool, arm.hand.opening(radius))
            return any(c.reason == Reason.FEASIBLE for c in candidates)

        if all(feasible(task.T_world_object) for task in tasks):
            return True
    return False


class _Pair(NamedTuple):
    """Results of both searches on the maps of two arms.

    Attributes:
        exact: cells that the complete search found, None for none.
        exact_time: its time.
        climbed: cells that hill climbing found, None for none.
        climb_time: its time.
        gained: by how much (m) the objective of the complete search exceeds that of hill climbing.
    """

    exact: tuple[Cell, ...] | None
    exact_time: Time
    climbed: tuple[Cell, ...] | None
    climb_time: Time
    gained: float


def several_hands(pairs: int) -> Iterator[Figure]:
    """Compare complete search and hill climbing for two hands on a log and on a bottle, on the same maps.

    The object gets random poses between the robots, and of each map a random part is kept: a window of
    random size with a random share of its cells.
    """
    results: list[_Pair] = []
    prints = []
    for seed, (name, task) in enumerate(
        [("log_two_robots", "lift"), ("handover_between_robots", "hand over")]
    ):
        scene = Scene.load(name).with_settings(redundancy=8)
        with open_world(scene) as world:
            arms = [world.scene.arm(arm) for arm in scene.task(task).arms]
            gaps = PrintGaps(arms, scene.manifold)
            prints.append(time_of(lambda gaps=gaps: gaps.table(0, 1)))
            rng = np.random.default_rng(seed)
            drawn = _random_pairs(world, scene.task(task), rng)
            _compare(world, arms, next(drawn), gaps, 0)  # compiles what is not compiled yet
            results += [_compare(world, arms, maps, gaps, k) for k, maps in zip(range(pairs), drawn)]  # noqa: B905
    yield times("handprints and gaps of two hands, once a scene", "ms", prints)
    yield from _pair_figures(results)


def four_hands(windows: int) -> Iterator[Figure]:
    """Time the complete search for four hands on a log, on random parts of its maps.

    In a few of them the robots are in each other's way, which the search does not know before it tries.
    """
    scene = Scene.load("log_four_robots").with_settings(redundancy=8)
    with open_world(scene) as world:
        task = scene.task()
        arms = [scene.arm(name) for name in task.arms]
        gaps = PrintGaps(arms, scene.manifold)
        drawn = _random_pairs(world, task, np.random.default_rng(0))
        parts = [maps for _, maps in zip(range(windows), drawn)]  # noqa: B905
        for maps in parts[:FIRST_FOUR]:  # computes prints, and compiles what is not compiled yet
            _find(world, arms, maps, gaps)
        found = [_find(world, arms, maps, gaps)[1] for maps in parts]
    yield times(f"four hands on a log, {windows} random parts of their maps", "ms", found)


def _pair_figures(results: Sequence[_Pair]) -> Iterator[Figure]:
    """Yield success rates and times of both searches over all pairs of maps."""
    solved = [r for r in results if r.climbed]
    exact = np.array([r.exact_time.cpu for r in results])
    climb = np.array([r.climb_time.cpu for r in results])
    where = np.array([r.climbed is not None for r in results])
    share = lambda found: (100 * sum(found) / len(results),)  # noqa: E731
    pairs = f"success in {len(results)} pairs"
    yield Figure(f"two hands, complete search: {pairs}", "%", share([r.exact is not None for r in results]))
    yield Figure(f"two hands, hill climbing as printed: {pairs}", "%", share(where.tolist()))
    missed = [r.climbed is not None and r.exact is None for r in results]
    yield Figure("  climbing alone finds something", "%", share(missed))
    yield times("two hands, complete search with whole robots", "ms", [r.exact_time for r in results])
    yield times("two hands, hill climbing as printed", "ms", [r.climb_time for r in results])
    yield Figure("  climbing takes, on average of all", "×", (float(climb.mean() / exact.mean()),))
    if solved:
        ratio = float(climb[where].mean() / exact[where].mean())
        yield Figure("  climbing takes, on average of those that it solves", "×", (ratio,))
        gained = tuple(1e3 * r.gained for r in solved if r.exact)
        yield Figure("  smallest of gap and margins, more than climbing reaches", "mm", gained)


def _random_pairs(world: BulletWorld, task: Task, rng: np.random.Generator) -> Iterator[list[FeasibilityMap]]:
    """Yield maps of two arms, an object pose for every four of them."""
    maker = MapMaker(world)
    while True:
        move = rotation_z(rng.uniform(-0.3, 0.3)) @ translation(rng.uniform(-0.12, 0.12, 3))
        moved = replace(task, T_world_object=move @ task.T_world_object)
        maps = [maker.map(arm, moved) for arm in task.arms]
        if all(m.feasible.any() for m in maps):
            for _ in range(4):
                yield [_part(m, rng) for m in maps]


def _part(m: FeasibilityMap, rng: np.random.Generator) -> FeasibilityMap:
    """Return a map masked to a random share of a random window around one of its feasible cells."""
    heights, angles = m.feasible.shape[1:]
    _, row, column = rng.choice(np.argwhere(m.feasible))
    tall, wide = (int(n ** rng.uniform(0.2, 1.0)) for n in (heights, angles))
    keep = np.zeros(m.feasible.shape, dtype=bool)
    inside = np.abs(np.arange(heights) - row) <= tall // 2
    around = (
        np.minimum((np.arange(angles) - column) % angles, (column - np.arange(angles)) % angles) <= wide // 2
    )
    keep[:, inside[:, None] & around] = True
    dense = rng.choice([0.1, 0.5, 1.0])
    keep &= rng.random(keep.shape) < dense
    keep[:, row, column] = True
    return m.masked(keep)


def _compare(
    world: BulletWorld, arms: Sequence[Arm], maps: Sequence[FeasibilityMap], gaps: PrintGaps, seed: int
) -> _Pair:
    found, exact_time = _find(world, arms, maps, gaps)
    climbed: list[tuple[Cell, ...] | None] = []
    climb_time = time_of(lambda: climbed.append(_climb_as_printed(world, arms, maps, seed)))
    (climb,) = climbed
    exact = tuple(found.steps[0].cells) if found else None
    gained = _reached(gaps, maps, exact) - _reached(gaps, maps, climb) if exact and climb else 0.0
    return _Pair(exact, exact_time, climb, climb_time, gained)


def _find(
    world: BulletWorld, arms: Sequence[Arm], maps: Sequence[FeasibilityMap], gaps: PrintGaps
) -> tuple[FreePlacement | None, Time]:
    """Return the best placement for which the whole robots are free, and how long that took."""
    found: list[FreePlacement | None] = []

    def search() -> None:
        placements = HoldingSearch([{arm.name: m for arm, m in zip(arms, maps, strict=True)}], gaps)
        finder = ConfigurationFinder(world, arms, maps)
        found.append(next(iter(FreePlacements(placements, [finder])), None))

    taken = time_of(search)
    return found[0], taken


def _climb_as_printed(
    world: BulletWorld, arms: Sequence[Arm], maps: Sequence[FeasibilityMap], seed: int
) -> tuple[Cell, ...] | None:
    """Return what Algorithm 3 finds, with the collisions of the whole robots counted at every step."""

    def count(cells: Sequence[Cell]) -> int:
        world.set_object(maps[0].T_world_object)
        world.set_arms(witnesses(arms, maps, cells))
        return len(world.collisions(arms))

    always: Callable[[Sequence[Cell]], bool] = lambda cells: True  # noqa: E731
    try:
        return hill_climb(maps, arms, always, seed, LIMITS, count=count).cells
    except NoPlanError:
        return None


def _reached(gaps: PrintGaps, maps: Sequence[FeasibilityMap], cells: Sequence[Cell]) -> float:
    """Return the objective of the complete search (m): the smallest of the gap and the surface margins."""
    a, b = cells
    shift = (b.column - a.column) % maps[0].manifold.angles
    gap = max(0.0, float(gaps.around(0, a.roll, a.row, 1)[b.roll, b.row, shift]))
    return min(gap, *(float(surface_margin(m)[cell]) for m, cell in zip(maps, cells, strict=True)))
