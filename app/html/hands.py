"""Several hands on one object: each arm's map with all handprints, their gap, and the hill climbing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.object.manifold import ROLLS
from symgrasp.plan.plan import PlanTask
from symgrasp.planners.bimanual import ClimbStep

from ..render.marks import Mark
from ..render.palette import PRINTS
from ..render.prints import hand_color, shown_prints
from ..state.map_view_state import RollChoice
from ..state.plan_results import ClimbReplay, PlanResult, PlanResults
from ..state.state import State
from .escaping import escape
from .map import map_html
from .readout import count_text
from .solutions import worst_margin_texts
from .stack import margin_texts

__all__ = ["climb_comparison_html", "climb_html", "gap_text", "hands_html"]

TOTAL_HEIGHT = 330
"""Height (px) that all pictures share."""


def hands_html(state: State) -> str:
    """Draw the maps of the plan's tasks, each arm's with the handprints of all hands of the task."""
    if state.climb_step:
        return climb_html(state)
    if state.plan is None or state.plan.plan.kind == "sequential":
        return ""
    plan = state.plan
    count = sum(len(task.holds) for task in plan.plan.tasks)
    height = int(np.clip(TOTAL_HEIGHT / count - 48, 56, 120))
    blocks = []
    for k, task in enumerate(plan.plan.tasks):
        now = " sg-now" if k == state.step else ""
        gap = plan.gaps[k]
        apart = f"<span>{gap_text(gap)}</span>" if gap is not None else ""
        turned = f"turned by {np.rad2deg(task.delta) + 0.0:.1f}°"
        name = f"{k + 1} · {escape(task.name)}" if len(plan.plan.tasks) > 1 else escape(task.name)
        blocks.append(f'<div class="sg-task{now}"><b>{name}</b><span>{turned}</span>{apart}</div>')
        blocks.extend(_task_maps(state.plan_results, plan, k, task, height))
    return "".join(blocks)


def gap_text(gap: float) -> str:
    """Return text for the smallest gap (m) between two handprints of a task, negative where they overlap."""
    return "prints overlap: the hands pass each other" if gap < 0 else f"gap {1e3 * gap:.0f} mm"


def climb_html(state: State) -> str:
    """Draw a step of the hill climbing: every arm's map with all handprints, and the shared cells so far."""
    climb, step = state.plan_results.climb, state.climb_step
    if climb is None or step is None:
        return ""
    prints = shown_prints(state)
    height = int(np.clip(TOTAL_HEIGHT / len(climb.arms) - 48, 56, 120))
    grid = state.scene.manifold
    marks = [
        Mark(float(grid.h[cell.row]), float(grid.theta[cell.column]), name)
        for name, cell in zip(climb.arms, step.cells, strict=True)
    ]
    blocks = [_progress(climb, state.plan_results.frame or 0)]
    for k, (name, cell) in enumerate(zip(climb.arms, step.cells, strict=True)):
        m = state.plan_results.maps[climb.task, name].map
        roll = _roll_choice(cell.roll)
        blocks.append(f'<div class="sg sg-small">{_swatch(k)}{escape(name)}, roll {roll.value}</div>')
        blocks.append(map_html(m, roll, marks, prints, height=height, name=f"climb map {name}"))
    return "".join(blocks)


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


def _task_maps(results: PlanResults, plan: PlanResult, k: int, task: PlanTask, height: int) -> list[str]:
    several = len(task.holds) > 1
    marks = [Mark(hold.grasp.h, hold.grasp.theta, hold.arm if several else "") for hold in task.holds]
    prints = list(plan.prints[k].values()) if several else []
    blocks = []
    for i, hold in enumerate(task.holds):
        m = results.maps[task.name, hold.arm].map.shift(task.delta)
        roll = _roll_choice(ROLLS.index(hold.grasp.roll))
        along, around, clear = margin_texts(hold)
        title = f"{escape(hold.arm)}, roll {roll.value}: room {along}, {around}; {clear} clear"
        swatch = _swatch(i) if several else ""
        blocks.append(f'<div class="sg sg-small">{swatch}{title}</div>')
        name = f"plan map {task.name} {hold.arm}"
        blocks.append(map_html(m, roll, marks, prints, height=height, name=name))
    return blocks


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


def _roll_choice(roll: int) -> RollChoice:
    return (RollChoice.ZERO, RollChoice.HALF_TURN)[roll]


def _swatch(k: int) -> str:
    return f'<i class="sg-swatch" style="background:rgb{tuple(PRINTS[hand_color(k)].tolist())}"></i>'
