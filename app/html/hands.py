"""Several hands on one object: what each holds, the gap of their prints, and the hill climbing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.object.manifold import turn_text
from symgrasp.plan.plan import PlanTask
from symgrasp.planners.bimanual import ClimbStep

from ..render.palette import PRINTS
from ..render.prints import apart_text, hand_color
from ..state.plans.plan_results import ClimbReplay, PlanResult
from ..state.state import State
from .escaping import escape
from .readout import count_text
from .solutions import worst_margin_texts
from .stack import margin_texts, proven_html

__all__ = ["climb_comparison_html", "climb_html", "hands_html"]


def hands_html(state: State) -> str:
    """List the hands of the plan's tasks; their maps are in `app.shell.layers`."""
    if state.climb_step:
        return climb_html(state)
    if state.plan is None or state.plan.plan.kind == "sequential":
        return ""
    plan = state.plan
    blocks = []
    for k, task in enumerate(plan.plan.tasks):
        now = " sg-now" if k == state.step else ""
        apart = f"<span>{apart_text(state, k)}</span>"
        turned = f"turned by {turn_text(task.delta)}"
        name = f"{k + 1} · {escape(task.name)}" if len(plan.plan.tasks) > 1 else escape(task.name)
        blocks.append(f'<div class="sg-task{now}"><b>{name}</b><span>{turned}</span>{apart}</div>')
        blocks.extend(_hands(task))
    return "".join(blocks)


def climb_html(state: State) -> str:
    """Draw the shared cells of the hill climbing, with the step that is shown."""
    climb, step = state.plan_results.climb, state.climb_step
    if climb is None or step is None:
        return ""
    return _progress(climb, state.plan_results.frame or 0)


def climb_comparison_html(climb: ClimbReplay) -> str:
    """Compare the hill climbing with the complete search on the same maps, in a table."""
    restarts = climb.steps[-1].restart + 1
    climbed = [f"Hill climbing, seed {climb.seed}", *_result(climb.found)]
    exact = ["Complete search", *_result(climb.exact)]
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in (climbed, exact)
    )
    count = f"{count_text(len(climb.steps), 'position')} in {count_text(restarts, 'start')}"
    if len(climb.steps) == 1:
        count += ": the hands started apart already, try another seed"
    elif climb.found:
        numbers = climb.found.plan.planner.statistics
        count += f"; prints compared {count_text(numbers['counted'], 'time')}"
        count += f", whole robots {count_text(numbers['body_checks'], 'time')}"
    heads = "".join(f"<th>{name}</th>" for name in ("", "gap", "room along", "around", "clear"))
    table = f'<table class="sg sg-table"><tr>{heads}</tr>{rows}</table>'
    return f'{table}<div class="sg sg-small sg-faint">{count}.</div>'


def _result(plan: PlanResult | None) -> list[str]:
    """Return the texts of a table row: the gap of a plan and the least margins of its hands."""
    if plan is None:
        return ["none found", "", "", ""]
    gap = plan.gaps[0]
    apart = "overlap" if gap is None or gap < 0 else f"{1e3 * gap:.0f} mm"
    return [apart, *worst_margin_texts(plan)]


def _hands(task: PlanTask) -> list[str]:
    """Return a line for each hand of a task: its roll, and how much room it has."""
    several = len(task.holds) > 1
    lines = []
    for i, hold in enumerate(task.holds):
        along, around, clear = margin_texts(hold)
        roll = np.rad2deg(hold.grasp.roll)
        title = f"{escape(hold.arm)}, roll {roll:.0f}°: room {along}, {around}; {clear} clear"
        lines.append(f'<div class="sg sg-small">{_swatch(i) if several else ""}{title}</div>')
    return [*lines, proven_html([task])]


def _progress(climb: ClimbReplay, frame: int) -> str:
    """Say which step of the climb is shown, over a curve of the shared cells."""
    step = climb.steps[frame]
    overlap = "prints are apart" if step.collisions == 0 else f"prints share {step.collisions} cells"
    text = f"start {step.restart + 1}, position {frame + 1} of {len(climb.steps)}: {overlap}"
    return f'<div class="sg-task"><b>{text}</b></div>{_curve(climb.steps, frame)}'


def _curve(steps: Sequence[ClimbStep], frame: int) -> str:
    most = max(1, *(step.collisions for step in steps))
    wide = max(1, len(steps) - 1)
    shown = np.unique(np.linspace(0, len(steps) - 1, 600).round().astype(int))
    points = " ".join(f"{100 * k / wide:.2f},{30 - 28 * steps[k].collisions / most:.2f}" for k in shown)
    at = 100 * frame / wide
    return (
        '<svg class="sg-curve" viewBox="0 0 100 32" preserveAspectRatio="none" role="img" '
        'aria-label="cells that the prints share, position by position">'
        f'<line x1="{at:.2f}" x2="{at:.2f}" y1="0" y2="32"/><polyline points="{points}"/></svg>'
    )


def _swatch(k: int) -> str:
    return f'<i class="sg-swatch" style="background:rgb{tuple(PRINTS[hand_color(k)].tolist())}"></i>'
