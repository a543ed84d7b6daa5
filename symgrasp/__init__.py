"""Grasp maps and planners for objects of revolution.

    import symgrasp as sg

    scene = sg.load_scene("pick_pour_place")
    sg.create_map(scene, task="pour").show()
    plan = sg.plan_sequential(scene)
    assert sg.verify(plan)

Every name is imported when it is first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symgrasp.errors import SymgraspError
    from symgrasp.feasibility.create import create_map, explain
    from symgrasp.feasibility.map import FeasibilityMap
    from symgrasp.feasibility.object_report import describe_object as measure_object
    from symgrasp.feasibility.self_motion import self_motion
    from symgrasp.hands.measure import measure_hand
    from symgrasp.object.manifold import Manifold
    from symgrasp.object.profile import Profile
    from symgrasp.plan.plan import Plan
    from symgrasp.plan.verify import verify
    from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential
    from symgrasp.reason import Reason
    from symgrasp.scene.scene import Scene
    from symgrasp.scene.shipped import list_scenes
    from symgrasp.world.loading import load_scene

__all__ = [
    "FeasibilityMap",
    "Manifold",
    "Plan",
    "Profile",
    "Reason",
    "Scene",
    "SymgraspError",
    "create_map",
    "explain",
    "list_scenes",
    "load_scene",
    "measure_hand",
    "measure_object",
    "plan_bimanual",
    "plan_handover",
    "plan_sequential",
    "self_motion",
    "verify",
]

_ORIGINS = {
    "FeasibilityMap": "symgrasp.feasibility.map:FeasibilityMap",
    "Manifold": "symgrasp.object.manifold:Manifold",
    "Plan": "symgrasp.plan.plan:Plan",
    "Profile": "symgrasp.object.profile:Profile",
    "Reason": "symgrasp.reason:Reason",
    "Scene": "symgrasp.scene.scene:Scene",
    "SymgraspError": "symgrasp.errors:SymgraspError",
    "create_map": "symgrasp.feasibility.create:create_map",
    "explain": "symgrasp.feasibility.create:explain",
    "list_scenes": "symgrasp.scene.shipped:list_scenes",
    "load_scene": "symgrasp.world.loading:load_scene",
    "measure_hand": "symgrasp.hands.measure:measure_hand",
    "measure_object": "symgrasp.feasibility.object_report:describe_object",
    "plan_bimanual": "symgrasp.planners.planning:plan_bimanual",
    "plan_handover": "symgrasp.planners.planning:plan_handover",
    "plan_sequential": "symgrasp.planners.planning:plan_sequential",
    "self_motion": "symgrasp.feasibility.self_motion:self_motion",
    "verify": "symgrasp.plan.verify:verify",
}
"""Public name → the module and the name in it that it stands for."""


def __getattr__(name: str) -> object:
    """Import a public name when it is first used."""
    if name not in _ORIGINS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _ORIGINS[name].partition(":")
    value = globals()[name] = getattr(import_module(module), attribute)
    return value


def __dir__() -> list[str]:
    """List the public names, imported yet or not."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
