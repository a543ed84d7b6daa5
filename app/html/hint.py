"""The hint above all panels: what to do next with what is shown."""

from __future__ import annotations

from ..state.state import State
from .escaping import escape

__all__ = ["hint_html"]


def hint_html(state: State) -> str:
    """Say what can be done with what is shown: a plan, the hill climbing, a picked cell, or the map alone."""
    name = escape(state.scene.file.object.name)
    if state.climb_step:
        return (
            "Position by position, hill climbing moves the hands until their prints share no cell. "
            "<b>Replay the climb</b> plays it."
        )
    if state.shown_task and state.plan and state.plan.plan.kind == "sequential":
        return (
            "Drag the map of a task sideways: it slides by its δ, and the common cells count along. "
            "<b>Play</b> shows task after task."
        )
    if state.shown_task:
        return (
            "Drag the print of a hand over a map of the plan: the gap between the prints counts along. "
            "<b>With motion</b> plans how the arms get there."
        )
    if state.pick:
        return (
            "Click another cell, or move the picked one with the arrow keys. Drag the map sideways: the "
            f"{name} turns, and the map slides along."
        )
    return (
        f"Drag <b>Rotation</b>: the {name} turns and its map slides along, with nothing computed anew. Then "
        "click a green cell to see the grasp."
    )
