"""Times of the plans of all shipped scenes, from the scene to the plan with all maps that it needs."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from symgrasp.bench.figures import Figure
from symgrasp.bench.timing import time_of, times
from symgrasp.errors import SceneError
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import list_scenes

__all__ = ["planner_of", "run"]

RUNS = 3


def planner_of(scene: Scene) -> Callable[[Scene], Plan]:
    """Return the planner that a scene is made for: by how many arms its tasks have, and how many tasks."""
    if all(len(task.arms) == 1 for task in scene.tasks.values()):
        return plan_sequential
    return plan_bimanual if len(scene.tasks) == 1 else plan_handover


def run() -> Iterator[Figure]:
    """Plan every shipped scene once, which compiles what is not compiled yet, and time further runs.

    A scene whose robots are not installed is a figure without values that says what to install.
    """
    for name in list_scenes():
        try:
            scene = Scene.load(name)
        except SceneError as error:
            yield Figure(f"plan of {name}: {error.expected}", "s", ())
            continue
        planner = planner_of(scene)
        planner(scene)
        yield times(f"plan of {name}", "s", [time_of(lambda p=planner, s=scene: p(s)) for _ in range(RUNS)])
