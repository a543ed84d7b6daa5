"""Prints how long a computation of the page goes on after it was cancelled: ``make cancelling``.

Cancel takes effect on the page at once, whatever its process does. The process itself stops where the
computation next tells its progress, and only then begins what is asked for next. So the longest time between
two such moments is measured, for everything that the page computes, on every shipped scene: in a process that
has just started as the page starts its own, from nothing to the result, so that loading robots and opening
worlds count. Two things cannot be stopped: compiling, which is left to end, and libraries that read a file: a
process that does not stop within 0.1 s is ended then, and another begins what is asked for next.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import trimesh

from app.compute.compute_process import ComputeProcess
from app.compute.map_service import MapService
from app.compute.plan_service import MotionRequest, PlanRequest, PlanService
from app.compute.process_pool import PROCESSES, ProcessPool
from app.compute.survey_service import SurveyService
from app.compute.upload_service import UploadService
from app.files.scene_files import scene_yaml
from app.state.requests import CompareRequest, ExplainRequest, MapRequest, ProbabilityRequest, WindowsRequest
from app.state.state import State
from app.state.surveys.survey import SurveyRequest
from symgrasp import caching
from symgrasp.compiling import notify_on_compile
from symgrasp.errors import Cancelled, NoPlanError, SymgraspError
from symgrasp.feasibility.cell import Cell
from symgrasp.progress import Progress
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import missing_extra, shipped_scenes

__all__ = ["GOAL", "Gap", "Meter", "gaps_of", "reading", "run"]

GOAL = 0.3
"""Longest time (s) that a computation is to go on after it was cancelled."""

LONGEST = 20.0
"""Time (s) after which what is measured is cancelled: surveys take minutes."""

MOST_TRIES = 3
"""How often a scene is measured at most, until nothing is compiled any more."""

BEFORE = 0.5
"""Time (s) after which the upload is cancelled, when it is being read."""

TURN = 0.5
"""Turn (rad) of the object for which a shifted map is compared with one computed anew."""


class Work(NamedTuple):
    """Something that the page computes.

    Attributes:
        name: what it is called.
        run: does it from nothing.
        reads: whether it reads a file, so that its process is ended after a cancel.
    """

    name: str
    run: Callable[[Progress], object]
    reads: bool = False


@dataclass(frozen=True)
class Gap:
    """How long one computation went on without telling its progress.

    Attributes:
        scene: name of the scene.
        work: what was computed.
        total: how long it took (s).
        clock: longest time (s) between two calls of its progress, or before the first or after the last.
        cpu: the same without what other programs took of the processor: as long as it took, but at most the
            processor time of all threads.
        compiled: the longest of those times (s) in which something was compiled, which nothing can interrupt;
            they do not count for the others.
        first: whether nothing was kept on the disk of what is computed once for a robot.
        reads: whether it reads a file, so that its process is ended after a cancel.
    """

    scene: str
    work: str
    total: float
    clock: float
    cpu: float
    compiled: float
    first: bool
    reads: bool

    def line(self) -> str:
        """Return it as one line of text."""
        compiled = f"; {self.compiled:.1f} s in which was compiled" if self.compiled else ""
        when = "first" if self.first else "later"
        return (
            f"{self.scene:24} {self.work:32} {when}: longest {1e3 * self.clock:4.0f} ms, "
            f"CPU {1e3 * self.cpu:4.0f} ms, of {self.total:5.2f} s{compiled}"
            + ("; its process is ended" if self.reads else "")
        )


class Meter:
    """A progress that measures the times between its calls.

    Args:
        longest: time (s) after which it raises `Cancelled`; `LONGEST` if None.
    """

    def __init__(self, longest: float | None = None) -> None:
        self._longest = LONGEST if longest is None else longest
        self._begun = self._wall = time.perf_counter()
        self._cpu = time.process_time()
        self._compiles = False
        self.clock = self.cpu = self.compiled = 0.0

    def __call__(self, share: float) -> None:
        """Note the time since the last call."""
        self.lap()
        if time.perf_counter() - self._begun > self._longest:
            raise Cancelled

    def compiling(self) -> None:
        """Note that something is compiled before the next call."""
        self._compiles = True

    @property
    def total(self) -> float:
        """Time (s) since it was made."""
        return time.perf_counter() - self._begun

    def lap(self) -> None:
        """Note the time since the last call, without a call."""
        wall, cpu = time.perf_counter(), time.process_time()
        if self._compiles:
            self.compiled = max(self.compiled, wall - self._wall)
        else:
            clock = wall - self._wall
            self.clock, self.cpu = max(self.clock, clock), max(self.cpu, min(clock, cpu - self._cpu))
        self._wall, self._cpu, self._compiles = time.perf_counter(), time.process_time(), False


def gaps_of(name: str, *, first: bool) -> Iterator[Gap]:
    """Yield the gaps of everything that the page computes of a shipped scene.

    Args:
        name: of the scene.
        first: to be told of each; see `Gap`.
    """
    for work in _works(name):
        meter, said = Meter(), work.name
        with notify_on_compile(meter.compiling):
            try:
                work.run(meter)
            except (NoPlanError, Cancelled):
                pass
            except SymgraspError as error:
                said += f": {str(error).split(':')[-1].strip()}"
        meter.lap()
        yield Gap(name, said, meter.total, meter.clock, meter.cpu, meter.compiled, first, work.reads)


def _works(name: str) -> Iterator[Work]:
    """Yield what the page computes of a scene."""
    scene = Scene.load(name)
    task = scene.task()
    request = MapRequest(scene, task.arms[0], task.name)
    with ExitStack() as kept:
        maps = kept.enter_context(closing(MapService()))
        yield Work("the map", lambda tell: maps.map(request, tell))
        shown = maps.map(request, lambda _: None).map
        cell = Cell(*map(int, next(iter(zip(*shown.feasible.nonzero(), strict=True)), (0, 0, 0))))
        noise = State.of(scene, name).map_view.noise
        of_maps: dict[str, Callable[[MapService, Progress], object]] = {
            "the map, anew": lambda own, tell: own.map(request, tell),
            "the candidates of a cell": lambda own, tell: own.explain(ExplainRequest(request, cell), tell),
            "the map compared": lambda own, tell: own.compare(CompareRequest(request, TURN), shown, tell),
            "probabilities": lambda own, tell: own.probability(ProbabilityRequest(request, noise), tell),
            "windows": lambda own, tell: own.windows(WindowsRequest(request), shown, tell),
        }
        for work, call in of_maps.items():
            own = kept.enter_context(closing(MapService()))
            yield Work(work, lambda tell, own=own, call=call: call(own, tell))
    yield from _plans(scene)
    for kind in ("object", "robot"):
        survey = SurveyRequest(scene, {}, task.name, task.arms[0], kind, 0.1)
        service = SurveyService(lambda _: None)
        yield Work(f"survey of the {kind}", lambda tell, own=service, ask=survey: own.survey(ask, tell))
    content = scene_yaml(scene).encode()
    uploads = UploadService((Path(scene.source).parent,))
    yield Work(
        "the scene, uploaded",
        lambda tell: uploads.read_scene(f"{name}.yaml", content, None, tell),
        reads=True,
    )
    robot = next(iter(scene.robots))
    other = next(r for r in CATALOGUE if r.name == "panda")
    yield Work("another robot", lambda tell: uploads.put_robot(scene, robot, other, scene, tell), reads=True)


def _plans(scene: Scene) -> Iterator[Work]:
    """Yield every planner for a scene, with the further plans and the motion of what it finds."""
    alone = {arm: 0 for task in scene.tasks.values() if len(task.arms) == 1 for arm in task.arms}
    asked: list[tuple[Any, str, str]] = [
        ("sequential", method, arm) for arm in alone for method in ("best", "first", "regrasp")
    ]
    for task in scene.tasks.values():
        if len(task.arms) > 1:
            asked += [("bimanual", method, task.name) for method in ("exact", "hill_climb")]
    if len(scene.arms) > 1 and len(scene.tasks) > 1:
        asked.append(("handover", "", ""))
    for kind, method, name in asked:
        words = " ".join(filter(None, (kind, method, name)))
        with closing(MapService()) as maps, closing(PlanService(maps, ())) as plans:
            found: list[Any] = []

            def plan(tell: Progress, plans=plans, found=found, ask=(kind, method, name)) -> None:
                found.append(plans.plan(PlanRequest(scene, *ask), {}, tell))

            yield Work(words, plan)
            if not found or not found[0].plans:
                continue
            if found[0].more:
                yield Work(f"{words}, more", plans.more)
            best = tuple(result.plan for result in found[0].plans[:3])
            saved = {f"{words}, opened": found[0].plans[0].plan}
            if method != "first":

                def move(tell: Progress, plans=plans, best=best, saved=saved, words=words) -> None:
                    outcome = plans.motion(MotionRequest(scene, {}, best), tell)
                    saved[f"{words}, opened with its motion"] = outcome.plan

                yield Work(f"{words}, motion", move)
        for opened, own in saved.items():
            text = own.to_json().encode()
            folders = (Path(scene.source).parent,)
            with closing(MapService()) as maps, closing(PlanService(maps, folders)) as plans:
                yield Work(
                    opened,
                    lambda tell, plans=plans, text=text: plans.open(text, "plan.json", None, None, tell),
                    reads=True,
                )


def reading() -> Gap:
    """Return how long a page whose upload of a large mesh is cancelled waits until the next file is read."""
    turn, rows = 320, 600
    outline = np.stack([np.full(rows, 0.04), np.linspace(0.0, 0.2, rows)], axis=1)
    outline[[0, -1], 0] = 0.0
    content = trimesh.creation.revolve(outline, sections=turn).export(file_type="stl")
    assert isinstance(content, bytes)
    pool = ProcessPool(())
    process, begun = ComputeProcess(pool), time.perf_counter()

    def cancel(_: float) -> None:
        if time.perf_counter() - begun > BEFORE:
            raise Cancelled

    try:
        process.file_kind("a.yaml", b"a: 1", lambda _: None)  # which starts it
        pool.prepare()
        begun = time.perf_counter()
        with suppress(Cancelled):
            process.measure("large.stl", content, 1.0, None, cancel)
        cancelled = time.perf_counter()
        process.file_kind("a.yaml", b"a: 1", lambda _: None)
        waited = time.perf_counter() - cancelled
    finally:
        process.close()
        pool.close()
    return Gap(
        "any",
        f"a mesh of {len(content) / 1e6:.0f} MB, uploaded and given up",
        BEFORE,
        waited,
        0.0,
        0.0,
        first=False,
        reads=False,
    )


def _measured(name: str, first: bool) -> list[Gap]:
    # A copy of the same process as those of the page: what that has imported is there.
    with ProcessPoolExecutor(1, mp_context=PROCESSES) as pool:
        return pool.submit(_measure, name, first).result()


def _measure(name: str, first: bool) -> list[Gap]:
    if not first:
        return list(gaps_of(name, first=False))
    with tempfile.TemporaryDirectory() as folder, patch.object(caching, "_folder", lambda: Path(folder)):
        return list(gaps_of(name, first=True))


def run(names: Sequence[str]) -> Iterator[Gap]:
    """Yield the gaps of scenes, each in a process of its own: where nothing is kept of its robots, and later.

    Where something was compiled, it is measured again.
    """
    for name in names:
        for first in (True, False):
            found = _measured(name, first)
            for _ in range(MOST_TRIES - 1):
                if any(gap.compiled for gap in found):
                    found = _measured(name, first)
            yield from found


if __name__ == "__main__":
    there = {name: path for name, path in shipped_scenes().items() if not missing_extra(path)}
    parser = argparse.ArgumentParser(description="Measure how long computations go on after a cancel.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="shipped scenes (default: all)")
    asked = parser.parse_args().scenes
    if unknown := set(asked).difference(there):
        parser.error(f"{', '.join(sorted(unknown))}: expected some of {', '.join(there)}")
    found: list[Gap] = []
    for gap in chain([reading()], run(asked or list(there))):
        print(gap.line(), flush=True)
        found.append(gap)
    own = [gap for gap in found if not gap.reads]
    print("of what reads no file:")
    for what, times in (("", [gap.clock for gap in own]), ("CPU: ", [gap.cpu for gap in own])):
        longer = sum(time > GOAL for time in times)
        print(f"{what}longest of all: {1e3 * max(times):.0f} ms; longer than {1e3 * GOAL:.0f} ms: {longer}")
