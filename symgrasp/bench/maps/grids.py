"""How the maps and the plan of a scene depend on the grid.

The paper leaves open how the discretisation affects the robot and how to choose it (section 6). Here maps
on coarse grids are compared, area by area, with one on a grid that is finer than all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.errors import NoPlanError, SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.pictures import draw_errors
from symgrasp.planners.planning import (
    MapsByKey,
    Plans,
    bimanual_plans,
    handover_plans,
    sequential_plans,
)
from symgrasp.progress import Progress, part_of
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "GRIDS",
    "HEADER",
    "REFERENCE",
    "Counts",
    "GridResult",
    "coarsest",
    "compare",
    "draw",
    "measure_grids",
]

GRIDS = ((6, 12), (12, 24), (24, 48), (48, 96), (96, 192))
"""Heights and angles of the grids that are compared."""

REFERENCE = (192, 384)
"""Heights and angles of the grid that they are compared with; it cuts the cells of each into whole parts."""


@dataclass(frozen=True)
class Counts:
    """How a map and one on a finer grid agree, in cells of the finer one; sums over several maps add up.

    Attributes:
        cells: all of them.
        truly: those that are feasible.
        called: those in feasible cells of the coarse map.
        missed: those that are feasible, in infeasible cells of the coarse map.
        overstated: those that are infeasible, in feasible cells of the coarse map.
        coarse: feasible cells of the coarse map.
        mixed: those of them that hold an infeasible one.
    """

    cells: int = 0
    truly: int = 0
    called: int = 0
    missed: int = 0
    overstated: int = 0
    coarse: int = 0
    mixed: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


@dataclass(frozen=True)
class GridResult:
    """What a grid makes of a scene.

    Attributes:
        heights: its number of cells along the axis.
        angles: its number of cells around it.
        counts: how its maps agree with those on the finest grid.
        no_plan: why there is no plan on it; None where there is one.
        margin_along: of the plan, distance (m) along the axis to an infeasible cell; None without a plan.
        margin_around: of the plan, angle (rad) about it to an infeasible cell.
        clearance: of the plan, smallest distance (m) of bodies that may not touch.
    """

    heights: int
    angles: int
    counts: Counts
    no_plan: str | None = None
    margin_along: float | None = None
    margin_around: float | None = None
    clearance: float | None = None

    @property
    def error(self) -> float:
        """The area where its maps are wrong, as a share of what is truly feasible; 0 where nothing is."""
        wrong = self.counts.missed + self.counts.overstated
        return wrong / self.counts.truly if self.counts.truly else float(wrong > 0)

    def line(self) -> str:
        """Return the result as a line below `HEADER`."""
        c = self.counts
        shares = (
            c.called / c.cells, c.missed / max(c.truly, 1), c.overstated / max(c.called, 1),
            c.mixed / max(c.coarse, 1), self.error,
        )  # fmt: skip
        text = f"{self.heights:4} × {self.angles:<4}" + "".join(f"{100 * share:10.1f} %" for share in shares)
        if self.margin_along is None or self.margin_around is None or self.clearance is None:
            return f"{text}   none"
        around = np.rad2deg(self.margin_around)
        plan = f"{1e3 * self.margin_along:.0f} mm, {around:.0f}°, {1e3 * self.clearance:.1f} mm"
        return f"{text}   {plan}"


HEADER = f"{'grid':11}" + "".join(f"{n:>12}" for n in ("feasible", "missed", "overstated", "mixed", "error"))
"""What stands above the lines of `GridResult.line`, without the plan."""


def compare(coarse: np.ndarray, fine: np.ndarray) -> Counts:
    """Compare the feasible cells of a map with those of a finer one.

    Args:
        coarse: (R, H, A) bool.
        fine: (R, kH, lA) bool.
    """
    k, rest = divmod(fine.shape[1], coarse.shape[1])
    m, more = divmod(fine.shape[2], coarse.shape[2])
    assert rest == more == 0 == fine.shape[0] - coarse.shape[0]
    called = coarse.repeat(k, axis=1).repeat(m, axis=2)
    parts = fine.reshape(*coarse.shape[:2], k, coarse.shape[2], m)
    return Counts(
        cells=fine.size,
        truly=int(fine.sum()),
        called=int(called.sum()),
        missed=int((fine & ~called).sum()),
        overstated=int((called & ~fine).sum()),
        coarse=int(coarse.sum()),
        mixed=int((coarse & ~parts.all(axis=(2, 4))).sum()),
    )


def measure_grids(
    scene: Scene,
    grids: Sequence[tuple[int, int]] = GRIDS,
    reference: tuple[int, int] = REFERENCE,
    progress: Progress | None = None,
) -> Iterator[GridResult]:
    """Compare grids by all maps of a scene, and by the best plan for its tasks in order.

    Args:
        scene: the scene; its own grid does not matter.
        grids: heights and angles of the grids.
        reference: those of the grid whose maps count as the truth; multiples of those of all others.
        progress: called with the finished share; may raise `Cancelled`.
    """
    sizes = np.array([reference, *grids]).prod(axis=1)
    done = np.cumsum([0, *sizes]) / sizes.sum()
    truth = {key: m.feasible for key, m in _maps(_on(scene, reference), progress, *done[:2])}
    for k, size in enumerate(grids):
        gridded = _on(scene, size)
        maps = dict(_maps(gridded, progress, *done[k + 1 : k + 3]))
        counts = sum((compare(maps[key].feasible, truth[key]) for key in truth), Counts())
        yield _with_plan(gridded, maps, GridResult(*size, counts))


def coarsest(results: Iterable[GridResult], error: float) -> GridResult | None:
    """Return the first grid whose error, and that of all after it, is at most that large; None if none is."""
    found = None
    for result in results:
        found = (found or result) if result.error <= error else None
    return found


def draw(scene: Scene, results: Sequence[GridResult]) -> Figure:
    """Draw over the number of cells how much of the truly feasible area a grid gets wrong."""
    percent = [100 / max(r.counts.truly, 1) for r in results]
    missed, overstated = (
        [share * getattr(r.counts, name) for share, r in zip(percent, results, strict=True)]
        for name in ("missed", "overstated")
    )
    return draw_errors([(r.heights, r.angles) for r in results], missed, overstated, scene.name)


def _on(scene: Scene, size: tuple[int, int]) -> Scene:
    """Return a scene with a grid of heights and angles."""
    return scene.with_settings(heights=size[0], angles=size[1])


def _maps(
    scene: Scene, progress: Progress | None, start: float, end: float
) -> Iterator[tuple[tuple[str, str], FeasibilityMap]]:
    """Yield (task, arm) and map, for all tasks and their arms.

    Args:
        scene: the scene.
        progress: called with the finished share; may raise `Cancelled`.
        start: the share that is finished before.
        end: the share that is finished afterwards.
    """
    keys = [(task.name, arm) for task in scene.tasks.values() for arm in task.arms]
    with open_world(scene) as world:
        maker = MapMaker(world)
        for k, (task, arm) in enumerate(keys):
            part = part_of(progress and (lambda s: progress(start + s * (end - start))), k, len(keys))
            yield (task, arm), maker.map(arm, task, progress=part, certify=False)


def _plans(scene: Scene, maps: MapsByKey) -> Plans:
    """List the plans for all tasks of a scene in order."""
    tasks = list(scene.tasks.values())
    if all(task.arms == tasks[0].arms for task in tasks) and len(tasks[0].arms) == 1:
        return sequential_plans(scene, tasks[0].arms[0], maps)
    return bimanual_plans(scene, tasks[0].name, maps) if len(tasks) == 1 else handover_plans(scene, maps)


def _with_plan(scene: Scene, maps: MapsByKey, result: GridResult) -> GridResult:
    """Return a result with what the best plan on its maps is worth."""
    try:
        with closing(_plans(scene, maps)) as plans:
            holds = [hold for task in next(plans).tasks for hold in task.holds]
    except (NoPlanError, SceneError) as error:
        return replace(result, no_plan=str(error))
    return replace(
        result,
        margin_along=min(hold.margin_along for hold in holds),
        margin_around=min(hold.margin_around for hold in holds),
        clearance=min(hold.clearance for hold in holds),
    )
