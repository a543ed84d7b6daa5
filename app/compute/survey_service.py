"""Surveys of one session: where its object or robot may stand; runs in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from symgrasp.errors import SceneError
from symgrasp.planners.planning import tasks_of_plan
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.scene.format import MapSettings
from symgrasp.scene.scene import Scene
from symgrasp.survey.evaluation import Evaluator, PointResult
from symgrasp.survey.evaluation import State as PointState
from symgrasp.survey.format import NumberAxis, PlanKind, SurveyFile
from symgrasp.survey.placement import Base, kind_of_plan, place_base, reach_of
from symgrasp.survey.regions import places_of_object, support_height
from symgrasp.survey.survey import Survey

from ..state.surveys.survey import Places, Stand, SurveyRequest

__all__ = ["SurveyPart", "SurveyService"]

COARSE = (12, 36, 16)
"""Rows, columns and samples of the maps of a survey, at most; what is chosen in the end has its own map."""

STANDS = 3
"""How many bases are proposed."""

INTERVAL = 0.25
"""Time (s) between two reports of what has been found."""


@dataclass(frozen=True, eq=False)
class SurveyPart:
    """What a survey has found so far.

    Attributes:
        places: the places.
        points, of: how many points are computed, and of how many, as far as is known.
        label: what it is doing.
    """

    places: Places
    points: int
    of: int
    label: str


class SurveyService:
    """Runs surveys; used by one thread at a time.

    Args:
        on_part: called now and then with what has been found.
    """

    def __init__(self, on_part: Callable[[SurveyPart], None]) -> None:
        self._on_part = on_part

    def survey(self, request: SurveyRequest, progress: Progress) -> tuple[Stand, ...]:
        """Find out where the object or the robot may stand; what is found is reported on the way.

        Returns:
            The best bases, planned and verified; none where the object is moved.

        Raises:
            NoPlanError: no base serves all tasks.
        """
        scene = request.moved_scene()
        report = _Report(self._on_part, progress)
        if request.kind == "object":
            _move_object(scene, request, report)
            return ()
        region = reach_of(scene, request.robot, request.spacing)
        report.z, report.spacing = region.z[0], request.spacing

        def surveyed(survey: Survey) -> Array:
            report.label = "Bases" if survey.file.name == "all" else "Bases around the best"
            margins = np.full(survey.shape, np.nan)
            if report.of:  # refined by half the step, and again
                report.spacing = request.spacing / (2 if survey.file.name.startswith("refined_1") else 4)
            report.of += survey.points
            with Evaluator(survey) as evaluator:
                for point in _in_order(survey):
                    values = [float(axis.values[k]) for axis, k in zip(survey.axes, point, strict=True)]
                    result = evaluator.point(point, report.tell)
                    margins[point] = result.plan_margin if result.plan else np.nan
                    report.add((values[0], values[1]), result, Base(*values))
            return margins

        try:
            placement = place_base(
                scene, request.robot, region, surveyed, most=STANDS, settings=_coarse(scene)
            )
        finally:
            report.send()
        return tuple(Stand(own.base, own.margin) for own in placement.proposals)


def _move_object(scene: Scene, request: SurveyRequest, report: _Report) -> None:
    """Compute the map, and the plan, of every place of the object."""
    task = scene.tasks[request.task]
    x, y = places_of_object(scene, request.arm, task).grid(request.spacing)
    axes = tuple(
        NumberAxis(name=name, of=f"position.{name}", values=tuple(values.tolist()))
        for name, values in (("x", x), ("y", y))
    )
    file = SurveyFile(
        schema_version=1,
        name="places",
        scene=scene.name,
        task=request.task,
        arm=request.arm,
        plan=_plan_with(scene, request),
        map=_coarse(scene),
        axes=axes,
    )
    survey = Survey.of(file, scene, scene.source)
    report.label, report.of = "Places of the object", survey.points
    report.z, report.spacing = support_height(scene, task), request.spacing
    with Evaluator(survey) as evaluator:
        for point in _in_order(survey):
            report.add((float(x[point[0]]), float(y[point[1]])), evaluator.point(point, report.tell))
    report.send()


def _plan_with(scene: Scene, request: SurveyRequest) -> PlanKind | None:
    """Return the kind of plan that does all tasks of a scene; None if the task and arm have no part in it."""
    kind = kind_of_plan(scene)
    try:
        tasks = tasks_of_plan(scene, kind, request.arm, request.task)
    except SceneError:
        return None
    return kind if request.task in [task.name for task in tasks] else None


def _coarse(scene: Scene) -> MapSettings:
    """Return a scene's map settings with few cells, none of which is split."""
    rows, columns, samples = COARSE
    own = scene.settings
    if own.redundancy != "auto":
        samples = min(own.redundancy, samples)
    return own.model_copy(
        update={
            "heights": min(own.heights, rows),
            "angles": min(own.angles, columns),
            "redundancy": samples,
            "resolution": None,
        }
    )


def _in_order(survey: Survey) -> Iterator[tuple[int, ...]]:
    """Yield all points, a rough picture first; those of one scene follow each other if one axis moves it."""
    points = np.indices(survey.shape).reshape(len(survey.shape), -1).T
    coarse = [(points[:, :2] % step == 0).all(axis=1) for step in (4, 2, 1)]
    level = np.select(coarse, [0, 1, 2])
    for k in np.lexsort((*reversed(points.T), level)):
        yield tuple(points[k].tolist())


@dataclass(eq=False)
class _Report:
    """What a survey has found, and where it is told."""

    on_part: Callable[[SurveyPart], None]
    progress: Progress
    label: str = ""
    of: int = 0
    z: float = 0.0
    spacing: float = 0.0
    points: int = 0
    found: dict[tuple[float, float], tuple[float, PointResult, Base | None]] = field(default_factory=dict)
    sent: float = field(default_factory=time.monotonic)

    def add(self, xy: tuple[float, float], result: PointResult, base: Base | None = None) -> None:
        """Take a point; of several bases at one place the best is kept. May raise `Cancelled`."""
        self.points += 1
        size, before, _ = self.found.get(xy, (self.spacing, None, None))
        if before is None or _rank(result) > _rank(before):
            self.found[xy] = size, result, base
        if time.monotonic() - self.sent > INTERVAL:
            self.send()
        self.progress(self.points / self.of)

    def tell(self, _: float) -> None:
        """Tell the progress, also while a point is computed. May raise `Cancelled`."""
        self.progress(self.points / self.of if self.of else 0.0)

    def send(self) -> None:
        """Tell what has been found."""
        if not self.found:
            return
        sizes, results, bases = zip(*self.found.values(), strict=True)
        places = Places(
            xy=np.array(list(self.found)),
            size=np.array(sizes),
            state=np.array([r.state for r in results], dtype=np.uint8),
            share=np.array([r.share for r in results]),
            margin=np.array([r.margin for r in results]),
            plan=np.array([r.plan_margin if r.plan else np.nan for r in results]),
            z=self.z,
            bases=tuple(b for b in bases if b is not None),
        )
        self.on_part(SurveyPart(places, self.points, self.of, self.label))
        self.sent = time.monotonic()


def _rank(result: PointResult) -> tuple[bool, float, float]:
    """Return what is larger of the better of two bases at one place."""
    computed = result.state == PointState.COMPUTED
    return computed, result.plan_margin if result.plan else -1.0, result.share if computed else 0.0
