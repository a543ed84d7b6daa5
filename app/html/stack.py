"""The tasks of a sequence as a table: how far the object is turned, and how much room the grasp has."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from symgrasp.object.manifold import turn_text
from symgrasp.plan.plan import CLEARANCE_LIMIT, Grasp, Hold, PlanTask

from ..state.state import State
from .escaping import escape
from .readout import pitch_text

__all__ = ["margin_texts", "proven_html", "stack_html"]

HEADINGS = ("task", "δ", "along", "around", "clear")


def stack_html(state: State) -> str:
    """List the tasks of the plan, in groups with the same grasp; their maps are in `app.shell.layers`."""
    if state.plan is None or state.plan.plan.kind != "sequential":
        return ""
    steps = [(k, task, task.holds[0]) for k, task in enumerate(state.plan.plan.tasks)]
    groups = [list(group) for _, group in groupby(steps, lambda step: step[2].grasp)]
    rows = [_row(HEADINGS, "sg-faint")]
    for number, group in enumerate(groups, start=1):
        if len(groups) > 1:
            rows.append(f'<div class="sg-part">grasp {number}: {_grasp_text(group[0][2].grasp)}</div>')
        for k, task, hold in group:
            now = "sg-now" if k == state.step else ""
            rows.append(_row((f"{k + 1} · {task.name}", turn_text(task.delta), *margin_texts(hold)), now))
    return f'<div class="sg-stack">{"".join(rows)}</div>{proven_html(state.plan.plan.tasks)}'


def proven_html(tasks: Sequence[PlanTask]) -> str:
    """Say that the margins of all holds of some tasks are proven; nothing where they are not."""
    if not all(hold.margins == "proven" for task in tasks for hold in task.holds):
        return ""
    return '<div class="sg sg-small sg-faint">Margins are proven: all grasps within them are feasible.</div>'


def margin_texts(hold: Hold) -> tuple[str, str, str]:
    """Return texts for a hold: its margins along the axis (mm) and around it (°), and its clearance (mm)."""
    more = "> " if hold.clearance >= CLEARANCE_LIMIT else ""
    return (
        f"{1e3 * hold.margin_along:.0f} mm",
        f"{np.rad2deg(hold.margin_around):.0f}°",
        f"{more}{1e3 * hold.clearance:.0f} mm",
    )


def _row(cells: Sequence[str], css_class: str) -> str:
    return (
        f'<div class="sg-head {css_class}">{"".join(f"<span>{escape(cell)}</span>" for cell in cells)}</div>'
    )


def _grasp_text(grasp: Grasp) -> str:
    turn, roll = np.rad2deg(grasp.theta) + 0.0, np.rad2deg(grasp.roll)
    return f"h = {100 * grasp.h:.1f} cm, θ = {turn:.1f}°, roll {roll:.0f}°{pitch_text(grasp)}"
