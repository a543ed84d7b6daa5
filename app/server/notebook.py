"""What notebooks and scripts show: the 3D view of a map or a plan as one HTML document, and the live page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from html import escape

from symgrasp.errors import printable
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.page import LivePage
from symgrasp.plan.plan import Plan
from symgrasp.scene.scene import Scene

from ..compute.plan_service import plan_result
from ..render.drawn_poses import drawn_joint_values
from ..scene3d.viewpoint import FIELD_OF_VIEW, choose_viewpoint
from ..state import changes
from ..state.plans.plan_changes import show_results, show_step
from ..state.plans.plan_results import PlanResults
from ..state.requests import MapRequest, MapResult
from ..state.state import State
from .embedded import live_page
from .snapshot import snapshot_html

__all__ = ["map_document", "map_page", "plan_document", "scene_map"]

ASPECT = 1.6
"""Ratio of width to height that the camera is placed for."""

HEIGHT = 400
"""Height (px) of the view of each task of a plan."""


def map_document(m: FeasibilityMap, scene: Scene) -> str:
    """Return the HTML document of a map on its object, with the arm at home.

    Args:
        m: the map, of a task of the scene.
        scene: the scene; the object is shown in the map's pose.
    """
    state = _showing(m, scene)
    return _drawn(replace(state, result=MapResult(state.request, m)))


def map_page(m: FeasibilityMap, scene: Scene) -> LivePage:
    """Return the live page of a scene that shows a map of one of its tasks, see `map_document`.

    Raises:
        SymgraspError: the scene cannot be served.
        OSError: the server cannot be started.
    """
    return live_page(_showing(m, scene))


def scene_map(scene: Scene) -> FeasibilityMap:
    """Compute the map that shows a scene: of its first task and that task's first arm."""
    return create_map(scene)


def _showing(m: FeasibilityMap, scene: Scene) -> State:
    """Return a state of the scene with the task, the arm and the pose of a map, but without the map."""
    grid = m.manifold
    scene = scene.with_settings(heights=grid.heights, angles=grid.angles)
    scene = scene.with_task(replace(scene.task(m.task), T_world_object=m.T_world_object))
    return changes.choose_arm(changes.choose_task(State.of(scene, scene.name), m.task), m.arm)


def plan_document(plan: Plan, scene: Scene, maps: Mapping[tuple[str, str], FeasibilityMap]) -> str:
    """Return the HTML document of a plan, which plays its motion.

    Where it has none, there is a view for each task: of the turned object and the arms that hold it.

    Args:
        plan: the plan.
        scene: its scene.
        maps: (task, arm) → map, of every task and arm of the plan.
    """
    map_results = {(task, arm): MapResult(MapRequest(scene, arm, task), m) for (task, arm), m in maps.items()}
    results = PlanResults().found(plan.kind, (plan_result(plan, scene),), map_results, more=False)
    state = show_results(State.of(scene, scene.name), results)
    if plan.motion:
        return _drawn(state)
    views = [
        f"<h3>{escape(printable(task.name))}</h3>"
        f'<iframe srcdoc="{escape(_drawn(show_step(state, step)))}" width="100%" height="{HEIGHT}"></iframe>'
        for step, task in enumerate(plan.tasks)
    ]
    return "<!DOCTYPE html><meta charset='utf-8'>" + "".join(views)


def _drawn(state: State) -> str:
    values = drawn_joint_values(state)
    view = choose_viewpoint(
        state.scene, state.T_world_object, values, ASPECT, flat_map=state.display.flat_map
    )
    return snapshot_html(state, view.camera(ASPECT), FIELD_OF_VIEW)
