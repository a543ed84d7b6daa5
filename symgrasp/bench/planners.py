"""The planners measured against what one would do otherwise, as ratios inside one run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from time import perf_counter

import numpy as np

from symgrasp.bench.figures import Figure
from symgrasp.candidates import Judge
from symgrasp.errors import NoPlanError
from symgrasp.feasibility import Cell, FeasibilityMap
from symgrasp.fit import fit
from symgrasp.ik import ClosedFormIK
from symgrasp.manifold import ROLLS, grasp_to_tool
from symgrasp.maps import create_map
from symgrasp.planners.bimanual import hill_climb
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs
from symgrasp.planners.postures import Postures
from symgrasp.planners.sequential import surface_margin
from symgrasp.poses import Array, inverse
from symgrasp.reason import Reason
from symgrasp.robot import Arm
from symgrasp.scene import Scene
from symgrasp.scene_build import Task
from symgrasp.world import BulletWorld, Collision

__all__ = ["long_sequence", "run", "several_hands", "without_the_manifold"]


def run() -> Iterator[Figure]:
    """Measure the planners, a figure at a time."""
    yield from long_sequence(tasks=50, runs=10)
    yield from without_the_manifold(runs=10)
    yield from several_hands(pairs=20)


def long_sequence(tasks: int, runs: int) -> Iterator[Figure]:
    """Plan one grasp for many tasks: the maps of a real sequence, turned at random."""
    scene = Scene.load("pick_pour_place").with_settings(heights=48, angles=96, redundancy=4)
    maps = [create_map(scene, task=name) for name in scene.tasks]
    rng = np.random.default_rng(0)
    times = []
    for _ in range(runs):
        turns = rng.integers(0, 96, tasks) * scene.manifold.dtheta
        sequence = {(k, "arm"): maps[k % len(maps)].shift(turn) for k, turn in enumerate(turns)}
        start = perf_counter()
        search = HoldingSearch(sequence, hold_runs([["arm"]] * tasks), PrintGaps([], scene.manifold))
        found = next(search.best_first())
        for k in range(tasks):
            search.turns(found.cells, k)[0]
        times.append(1e3 * (perf_counter() - start))
    yield Figure(f"one grasp for {tasks} tasks on 48 × 96 maps, once the maps exist", "ms", tuple(times))


class _CountingWorld(BulletWorld):
    """A world that counts collision checks."""

    checks = 0

    def first_collision(self, arm: Arm) -> Collision | None:
        """Count, and answer."""
        self.checks += 1
        return super().first_collision(arm)


def without_the_manifold(runs: int) -> Iterator[Figure]:
    """Sample grasps and test each against every task, within the collision checks that the maps took."""
    scene = Scene.load("pick_pour_place")
    tasks = list(scene.tasks.values())
    with _CountingWorld(scene) as world:
        start = perf_counter()
        maps = {
            (k, "arm"): create_map(scene, task=t.name, method="reference", world=world)
            for k, t in enumerate(tasks)
        }
        search = HoldingSearch(maps, hold_runs([["arm"]] * len(tasks)), PrintGaps([], scene.manifold))
        next(search.best_first())
        with_maps = perf_counter() - start
        budget = world.checks
        successes, ratios = [], []
        for seed in range(runs):
            start = perf_counter()
            successes.append(float(_sample_grasps(scene, tasks, world, budget, seed)))
            ratios.append((perf_counter() - start) / with_maps)
    yield Figure(
        "pick, pour, place by sampling, same budget of collision checks: success", "", tuple(successes)
    )
    yield Figure("  time against maps and planner", "×", tuple(ratios))


def _sample_grasps(
    scene: Scene, tasks: Sequence[Task], world: _CountingWorld, budget: int, seed: int
) -> bool:
    """Draw grasps until one is feasible in every task as it is posed, or the budget is used up."""
    arm = scene.arm()
    judge = Judge(world, arm, ClosedFormIK(arm, scene.settings.redundancy), scene.settings.approach)
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
            tool = grasp_to_tool(T_world_object, h, theta, roll, arm.hand.standoff(radius))
            candidates = judge.candidates(T_base_world @ tool, arm.hand.opening(radius))
            return any(c.fate == Reason.FEASIBLE for c in candidates)

        if all(feasible(task.T_world_object) for task in tasks):
            return True
    return False


def several_hands(pairs: int) -> Iterator[Figure]:
    """Place two hands on the log: the complete search against hill climbing as printed, on the same maps."""
    scene = Scene.load("log_two_robots")
    arms = list(scene.arms.values())
    whole = [create_map(scene, arm.name) for arm in arms]
    start = perf_counter()
    gaps = PrintGaps(arms, scene.manifold)
    prints = 1e3 * (perf_counter() - start)
    rng = np.random.default_rng(0)
    outcomes: dict[str, list[float]] = {
        name: [] for name in ("exact", "climb", "exact ms", "climb ms", "gap")
    }
    with BulletWorld(scene) as world:
        _warm_up(gaps)
        _exact(world, arms, whole, gaps)
        for seed in range(pairs):
            maps = [_thinned(m, rng) for m in whole]
            start = perf_counter()
            best = _exact(world, arms, maps, gaps)
            exact_time = perf_counter() - start
            start = perf_counter()
            climbed = _climb_as_printed(world, arms, maps, seed)
            outcomes["climb ms"].append(1e3 * (perf_counter() - start))
            outcomes["exact"].append(float(best is not None))
            outcomes["climb"].append(float(climbed is not None))
            outcomes["exact ms"].append(1e3 * exact_time)
            if best and climbed:
                a, b = (_reached(gaps, maps, cells) for cells in (best, climbed))
                outcomes["gap"].append(1e3 * (a - b))
    yield Figure("handprints of two hands, once a scene", "ms", (prints,))
    yield Figure("two hands, complete search: success", "", tuple(outcomes["exact"]))
    yield Figure("two hands, hill climbing as printed: success", "", tuple(outcomes["climb"]))
    yield Figure("two hands, complete search with whole robots", "ms", tuple(outcomes["exact ms"]))
    yield Figure("two hands, hill climbing as printed", "ms", tuple(outcomes["climb ms"]))
    mean = float(np.mean(outcomes["climb ms"]) / np.mean(outcomes["exact ms"]))
    yield Figure("  hill climbing takes, on average", "×", (mean,))
    yield Figure("  smallest of gap and margins, more than climbing reaches", "mm", tuple(outcomes["gap"]))


def _warm_up(gaps: PrintGaps) -> None:
    """Compile what is compiled on first use, and compute the gaps that belong to the scene."""
    for roll in range(len(ROLLS)):
        for row in range(gaps.heights):
            gaps.around(0, roll, row, 1)


def _thinned(m: FeasibilityMap, rng: np.random.Generator) -> FeasibilityMap:
    """Keep a random window of a map: two hands on the whole log would be too easy."""
    heights, angles = m.feasible.shape[1:]
    keep = np.zeros(m.feasible.shape, dtype=bool)
    row, column = rng.integers(0, heights), rng.integers(0, angles)
    rows = np.arange(row, row + rng.integers(3, heights // 2)) % heights
    columns = np.arange(column, column + rng.integers(3, angles)) % angles
    keep[:, rows[:, None], columns] = True
    return m.masked(keep)


def _exact(
    world: BulletWorld, arms: Sequence[Arm], maps: Sequence[FeasibilityMap], gaps: PrintGaps
) -> tuple[Cell, ...] | None:
    names = [arm.name for arm in arms]
    keyed = {(0, name): m for name, m in zip(names, maps, strict=True)}
    search = HoldingSearch(keyed, hold_runs([names]), gaps)
    postures = Postures(world, arms, maps)
    angles = maps[0].manifold.angles
    for holding in search.best_first():
        for turn in search.turns(holding.cells, 0):
            cells = tuple(c._replace(column=(c.column + turn) % angles) for c in holding.cells)
            if postures.find(cells):
                return cells
    return None


def _climb_as_printed(
    world: BulletWorld, arms: Sequence[Arm], maps: Sequence[FeasibilityMap], seed: int
) -> tuple[Cell, ...] | None:
    """Algorithm 3, counting collisions of the robots in the world at every step."""
    postures = Postures(world, arms, maps)

    def count(cells: Sequence[Cell]) -> int:
        world.set_object(maps[0].T_world_object)
        world.set_arms(postures.witnesses(cells))
        return len(world.collisions(arms))

    always: Callable[[Sequence[Cell]], bool] = lambda cells: True  # noqa: E731
    try:
        return hill_climb(maps, arms, always, seed, count=count).cells
    except NoPlanError:
        return None


def _reached(gaps: PrintGaps, maps: Sequence[FeasibilityMap], cells: Sequence[Cell]) -> float:
    """Return what the complete search maximises (m): the smallest of the gap and the margins."""
    a, b = cells
    shift = (b.column - a.column) % maps[0].manifold.angles
    gap = max(0.0, float(gaps.around(0, a.roll, a.row, 1)[b.roll, b.row, shift]))
    return min(gap, *(float(surface_margin(m)[cell]) for m, cell in zip(maps, cells, strict=True)))
