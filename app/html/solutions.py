"""The list of the plans that were found, one line each."""

from __future__ import annotations

from html import escape

import numpy as np

from ..state.plan_results import PlanResult
from ..state.state import State
from .stack import measures

__all__ = ["solutions_html", "worst_measures"]


def solutions_html(state: State) -> str:
    """List the plans, best first, the one that is shown marked; nothing if there is no choice."""
    plans = state.plan_results.plans
    if len(plans) < 2:
        return ""
    several = any(gap is not None for plan in plans for gap in plan.gaps)
    headings = ("", "grasp", "gap" if several else "", "room along", "around", "clear")
    rows = [_row(headings, "sg-faint")]
    for k, plan in enumerate(plans):
        look = "sg-now" if k == state.plan_results.index else ""
        gaps = [gap for gap in plan.gaps if gap is not None]
        gap = "" if not gaps else "overlap" if min(gaps) < 0 else f"{1e3 * min(gaps):.0f} mm"
        rows.append(_row((str(k + 1), _grasps(plan), gap, *worst_measures(plan)), look))
    return f'<div class="sg-solutions" role="list" aria-label="solutions">{"".join(rows)}</div>'


def worst_measures(plan: PlanResult) -> tuple[str, str, str]:
    """Say the least room along the axis and around it, and the least clearance, of all hands in all tasks."""
    holds = [hold for task in plan.plan.tasks for hold in task.holds]
    names = ("margin_along", "margin_around", "clearance")
    worst = {name: min(getattr(hold, name) for hold in holds) for name in names}
    return measures(holds[0].model_copy(update=worst))


def _grasps(plan: PlanResult) -> str:
    """Say where every hand holds: one arm with its roll, several by their heights alone."""
    grasps = dict.fromkeys((hold.arm, hold.grasp) for task in plan.plan.tasks for hold in task.holds)
    if len({arm for arm, _ in grasps}) > 1:
        return "h = " + ", ".join(f"{100 * grasp.h:.1f}" for _, grasp in grasps) + " cm"
    return ", ".join(f"h = {100 * grasp.h:.1f} cm, roll {np.rad2deg(grasp.roll):.0f}°" for _, grasp in grasps)


def _row(cells: tuple[str, ...], look: str) -> str:
    spans = "".join(f"<span>{escape(cell)}</span>" for cell in cells)
    return f'<div role="listitem" class="{look}">{spans}</div>'
