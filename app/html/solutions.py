"""The list of the plans that were found, one line each."""

from __future__ import annotations

import numpy as np

from ..state.plan_results import PlanResult
from ..state.state import State
from .escaping import escape
from .readout import pitch_text
from .stack import margin_texts

__all__ = ["solutions_html", "worst_margin_texts"]


def solutions_html(state: State) -> str:
    """List the plans, best first, the one that is shown marked; nothing if there is only one."""
    plans = state.plan_results.plans
    if len(plans) < 2:
        return ""
    several = any(gap is not None for plan in plans for gap in plan.gaps)
    headings = ("", "grasp", "gap" if several else "", "room along", "around", "clear")
    rows = [_row(headings, "sg-faint")]
    for k, plan in enumerate(plans):
        css_class = "sg-now" if k == state.plan_results.index else ""
        gaps = [gap for gap in plan.gaps if gap is not None]
        gap = "" if not gaps else "overlap" if min(gaps) < 0 else f"{1e3 * min(gaps):.0f} mm"
        rows.append(_row((str(k + 1), _grasps(plan), gap, *worst_margin_texts(plan)), css_class))
    return f'<div class="sg-solutions" role="list" aria-label="solutions">{"".join(rows)}</div>'


def worst_margin_texts(plan: PlanResult) -> tuple[str, str, str]:
    """Return `margin_texts` of the least margins and the least clearance of all hands in all tasks."""
    holds = [hold for task in plan.plan.tasks for hold in task.holds]
    names = ("margin_along", "margin_around", "clearance")
    worst = {name: min(getattr(hold, name) for hold in holds) for name in names}
    return margin_texts(holds[0].model_copy(update=worst))


def _grasps(plan: PlanResult) -> str:
    """Return text for the grasps: height and roll of a single arm's, only the heights of several arms'."""
    grasps = dict.fromkeys((hold.arm, hold.grasp) for task in plan.plan.tasks for hold in task.holds)
    if len({arm for arm, _ in grasps}) > 1:
        return "h = " + ", ".join(f"{100 * grasp.h:.1f}" for _, grasp in grasps) + " cm"
    return ", ".join(
        f"h = {100 * grasp.h:.1f} cm, roll {np.rad2deg(grasp.roll):.0f}°{pitch_text(grasp)}"
        for _, grasp in grasps
    )


def _row(cells: tuple[str, ...], css_class: str) -> str:
    spans = "".join(f"<span>{escape(cell)}</span>" for cell in cells)
    return f'<div role="listitem" class="{css_class}">{spans}</div>'
