"""The 3D view of a map or a plan as one HTML document, for notebooks and scripts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from html import escape

from symgrasp.errors import printable
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import Plan
from symgrasp.scene.scene import Scene

from ..compute.plan_service import plan_result
from ..scene3d.viewpoint import FIELD_OF_VIEW, choose_viewpoint
from ..state import changes
from ..state.plans.plan_changes import show_results, show_step
from ..state.plans.plan_results import PlanResults
from ..state.requests import MapRequest, MapResult
from ..state.state import State
from .snapshot import snapshot_html

__all__ = ["map_document", "plan_document"]

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
    grid = m.manifold
    scene = scene.with_settings(heights=grid.heights, angles=grid.angles)
    scene = scene.with_task(replace(scene.task(m.task), T_world_object=m.T_world_object))
    state = changes.choose_arm(changes.choose_task(State.of(scene, scene.name), m.task), m.arm)
    return _drawn(replace(state, result=MapResult(state.request, m)))


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
    view = choose_viewpoint(state.scene, state.T_world_object)
    camera = (*view.camera(ASPECT).tolist(), *view.look_at.tolist())
    return snapshot_html(state, camera, FIELD_OF_VIEW)
