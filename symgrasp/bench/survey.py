"""What a survey costs beside its maps: its rate in one and two processes, its overhead, and its memory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import NamedTuple

import psutil

from symgrasp.bench.figures import Figure
from symgrasp.bench.timing import Time, ratios, time_of, times
from symgrasp.engine.threads import CORES, use_cores
from symgrasp.feasibility.create import MapMaker
from symgrasp.scene.format import MapSettings
from symgrasp.scene.scene import Scene
from symgrasp.survey.evaluation import Evaluator
from symgrasp.survey.format import NumberAxis, SurveyFile
from symgrasp.survey.running import Done, run_survey
from symgrasp.survey.store import create_store
from symgrasp.survey.survey import Survey
from symgrasp.world import open_world

__all__ = ["efficiency", "memory", "overhead", "run", "scenes", "start"]

SCENE, OTHER = "bottle_on_table", "pick_pour_place"
GRID = MapSettings(heights=24, angles=48, redundancy=16)
SMALL = MapSettings(heights=4, angles=12, redundancy=2)


def run() -> Iterator[Figure]:
    """Run the benchmarks of surveys and yield their figures as they are measured."""
    yield from overhead(sides=(64, 16), most=6, rounds=5)
    yield from scenes(count=12)
    yield from start(rounds=3)
    yield from efficiency(side=20, rounds=3)
    yield from memory(side=100)


def _survey(side: int, settings: MapSettings) -> Survey:
    """Return a survey of side × side positions of the object on the table."""
    axes = (
        NumberAxis(name="x", of="position.x", from_=0.35, to=0.55, count=side),
        NumberAxis(name="y", of="position.y", from_=-0.08, to=0.1, count=side),
    )
    file = SurveyFile(schema_version=1, name="bench", scene=SCENE, map=settings, axes=axes)
    return Survey.of(file, Scene.load(SCENE))


def overhead(sides: Sequence[int], most: int, rounds: int) -> Iterator[Figure]:
    """Time the points of surveys, computed and written, and their maps alone, on one core.

    Args:
        sides: each is a survey of side × side points; the more these are, the more a batch has.
        most: batches of each survey that are timed, of equal steps between them.
        rounds: how often.
    """
    for k, side in enumerate(sides):
        survey = _survey(side, GRID)
        pairs, written = _beside_maps(survey, most, rounds)
        if not k:
            yield times("a map alone, one core", "ms", [alone for _, alone in pairs])
        yield ratios(f"  a point of {survey.points:,}, with all that is written, over it", pairs)
        yield times(f"  writing a batch of {math.prod(survey.batch_shape)}", "ms", written)


def _beside_maps(survey: Survey, most: int, rounds: int) -> tuple[list[tuple[Time, Time]], list[Time]]:
    """Return what a point and its map alone take, and what writing a batch takes, each in some rounds.

    Batch by batch, in turn: what else the machine does meets all alike.
    """
    batches = range(0, survey.batches, max(1, survey.batches // most))
    pairs, written = [], []
    with _one_core(), open_world(survey.scene) as world, Evaluator(survey) as evaluator:
        maker = MapMaker(world)
        maker.map()
        evaluator.point((0, 0))
        for _ in range(rounds):
            with TemporaryDirectory() as folder:
                store = create_store(Path(folder) / "bench.zarr", survey)
                computed, writing, alone, count = Time(0, 0), Time(0, 0), Time(0, 0), 0
                for batch in batches:
                    points = list(survey.points_of(batch))
                    tasks = [evaluator.task_at(point, survey.scene) for point in points]
                    results = {}
                    computed += time_of(lambda: results.update((p, evaluator.point(p)) for p in points))  # noqa: B023
                    writing += time_of(lambda: store.write(batch, results))  # noqa: B023
                    alone += time_of(lambda: [maker.map(task=task) for task in tasks])  # noqa: B023
                    count += len(points)
            pairs.append(((computed + writing) / count, alone / count))
            written.append(writing / len(batches))
    return pairs, written


def scenes(count: int) -> Iterator[Figure]:
    """Time what a point needs besides its map where its scene is not that of the point before."""
    axis = NumberAxis(name="x", of="base.x", from_=-0.1, to=0.1, count=count)
    file = SurveyFile(schema_version=1, name="bench", scene=OTHER, map=GRID, axes=(axis,))
    survey, found = Survey.of(file, Scene.load(OTHER)), []
    with _one_core(), Evaluator(survey) as evaluator:
        evaluator.point((0,))
        for k in range(1, count):
            first, again = (time_of(lambda: evaluator.point((k,))) for _ in range(2))  # noqa: B023
            found.append(Time(first.wall - again.wall, first.cpu - again.cpu))
    yield times(f"a world and an engine for another scene, {OTHER}", "ms", found)


def start(rounds: int) -> Iterator[Figure]:
    """Time a survey of one point in a process that is started for it; the CPU time is that of the process."""
    axes = (NumberAxis(name="x", of="position.x", values=(0.5,)),)
    survey = Survey.of(
        SurveyFile(schema_version=1, name="bench", scene=SCENE, map=GRID, axes=axes), Scene.load(SCENE)
    )
    found = []
    for _ in range(rounds):
        began, spent = perf_counter(), 0.0

        def note(done: Done) -> None:
            nonlocal spent
            spent = _spent()

        with TemporaryDirectory() as folder:
            run_survey(survey, Path(folder) / "bench.zarr", workers=1, progress=note)
        found.append(Time(perf_counter() - began, spent))
    yield times("starting a process, and its first point", "s", found)


@contextmanager
def _one_core() -> Iterator[None]:
    use_cores(1)
    try:
        yield
    finally:
        use_cores(CORES)


def efficiency(side: int, rounds: int) -> Iterator[Figure]:
    """Run a survey by one process and by two, and compare their rates: two would do twice as much.

    CPU time tells this on a busy machine too, where two processes do not have a core each.
    """
    survey = _survey(side, GRID)
    clock, cpu, handing = [], [], []
    for _ in range(rounds):
        one, two = _rate(survey, 1), _rate(survey, 2)
        clock.append(one.point.wall / two.point.wall)
        cpu.append(2 * one.point.cpu / two.point.cpu)
        handing.append(1e3 * two.handing)
    yield Figure("a survey in two processes, over one", "×", tuple(clock))
    yield Figure("  in CPU time", "×", tuple(cpu))
    yield Figure("  CPU time of the scheduler and the client for a batch", "ms", tuple(handing))


class _Rate(NamedTuple):
    """What a survey takes once all workers are at work.

    Attributes:
        point: the time (s) for a point, by the clock and in CPU time of the workers.
        handing: the CPU time (s) of the process of scheduler and client for a batch.
    """

    point: Time
    handing: float


def _rate(survey: Survey, workers: int) -> _Rate:
    """Run a survey and return what it takes."""
    seen: list[tuple[int, float, float, float]] = []
    asking = 0.0

    def note(done: Done) -> None:
        nonlocal asking
        before = process_time()
        spent = _spent()
        asking += process_time() - before  # to ask for it takes longer than to hand a batch out
        seen.append((done.points, perf_counter(), spent, process_time() - asking))

    with TemporaryDirectory() as folder:
        run_survey(survey, Path(folder) / "bench.zarr", workers=workers, progress=note)
    first = len(seen) // 4  # all have computed a batch by then
    points, wall, cpu, own = (b - a for a, b in zip(seen[first], seen[-1], strict=True))
    return _Rate(Time(wall / points, cpu / points), own / (len(seen) - 1 - first))


def _spent() -> float:
    """Return the CPU time (s) of all processes that this one has started and that run."""
    used = [child.cpu_times() for child in psutil.Process().children(recursive=True)]
    return sum(times.user + times.system for times in used)


def memory(side: int) -> Iterator[Figure]:
    """Weigh a process that computes side × side points, after a tenth of them and at the end."""
    survey, own = _survey(side, SMALL), psutil.Process()
    with TemporaryDirectory() as folder, Evaluator(survey) as evaluator:
        store = create_store(Path(folder) / "bench.zarr", survey)
        early = 0.0
        for batch in range(survey.batches):
            store.write(batch, {point: evaluator.point(point) for point in survey.points_of(batch)})
            if batch == survey.batches // 10:
                early = own.memory_info().rss / 1e6
        late = own.memory_info().rss / 1e6
    yield Figure(f"memory after {survey.points // 10:,} points", "MB", (early,))
    yield Figure(f"  after {survey.points:,} points", "MB", (late,))
