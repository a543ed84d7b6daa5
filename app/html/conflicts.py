"""Why there is no plan: which tasks exclude each other, the heights each allows, what would help."""

from __future__ import annotations

from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.planners.conflicts import Conflict, Exclusion
from symgrasp.reason import Reason

from ..state.plans.plan_results import PlanFileReport, Refusal
from .escaping import escape
from .map import h_axis

__all__ = ["failure_html", "plan_file_html", "regrasp_count"]

HEIGHT = 130
"""Height (px) of the picture of the heights that each task allows."""

FAILURES_SHOWN = 12
"""How many failed statements of a plan file are listed."""


def failure_html(refusal: Refusal, grid: Manifold) -> str:
    """Say why there is no plan.

    Args:
        refusal: the reason.
        grid: the grid of the tasks' maps.
    """
    conflict = refusal.conflict
    if conflict is None:
        return f'<div class="sg sg-note sg-warning" role="alert">{escape(_sentence(refusal.text))}</div>'
    rows = "".join(f"<div>{escape(_excluded(e, conflict.kept))}</div>" for e in conflict.exclusions)
    return (
        f'<div class="sg sg-note sg-warning" role="alert"><b>No grasp serves all tasks.</b>{rows}</div>'
        '<div class="sg sg-small">Heights that each task allows, left at roll 0°, right at 180°:</div>'
        f"{_heights(conflict, grid)}{_helps(conflict)}"
    )


def regrasp_count(refusal: Refusal | None) -> int:
    """Return how many regrasps solve a conflict between tasks; 0 if none do or there is no conflict."""
    shared = refusal.conflict.regrasps if refusal and refusal.conflict else None
    return len(shared) - 1 if shared else 0


def plan_file_html(report: PlanFileReport) -> str:
    """Report the verification of a plan file: how many statements hold, and which do not."""
    name = escape(report.name)
    if not report.failures:
        text = f"{name} holds: {report.checks} statements verified."
        return f'<div class="sg sg-note sg-good" role="status">{text}</div>'
    count = len(report.failures)
    rows = "".join(f"<li>{escape(text)}</li>" for text in report.failures[:FAILURES_SHOWN])
    more = f"<li>and {count - FAILURES_SHOWN} more</li>" if count > FAILURES_SHOWN else ""
    wrong = f"{name} does not hold, so it is not shown: {count} of {report.checks} statements are wrong."
    return f'<div class="sg sg-note sg-error" role="alert">{wrong}<ul>{rows}{more}</ul></div>'


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _excluded(exclusion: Exclusion, kept: str) -> str:
    names, apart = exclusion
    if len(names) == 1:
        return f"{names[0]} cannot be done at all."
    far = f"share no {kept}" if apart is None else f"are {100 * apart:.1f} cm apart along the axis"
    return f"{' and '.join(names)} exclude each other: they {far}."


def _heights(conflict: Conflict, grid: Manifold) -> str:
    """Draw the heights that every task allows, with a bar for each roll."""
    low, high = grid.profile.h_min, grid.profile.h_max
    guilty = {name for exclusion in conflict.exclusions for name in exclusion.tasks}
    width = 100 / len(conflict.heights)
    columns = []
    for k, (task, spans) in enumerate(conflict.heights):
        bars = "".join(
            _bar(width * (k + 0.22 + 0.3 * roll), 0.26 * width, (a - low, b - low), (high - low, grid.dh))
            for roll, runs in enumerate(spans[: len(ROLLS)])
            for a, b in runs
        )
        css_class = ' class="sg-guilty"' if task in guilty else ""
        columns.append(f'{bars}<b{css_class} style="left:{width * (k + 0.5):.2f}%">{escape(task)}</b>')
    return (
        f'<div class="sg-heights" style="height:{HEIGHT}px" role="img" aria-label="heights of the tasks">'
        f"{h_axis(grid, HEIGHT)}<div>{''.join(columns)}</div></div>"
    )


def _bar(left: float, width: float, span: tuple[float, float], size: tuple[float, float]) -> str:
    """Draw a run of cells as a bar.

    Args:
        left, width: of the bar (%).
        span: heights (m) of the lowest and the highest cell's centre, from the bottom of the object.
        size: heights (m) of the object and of a cell.
    """
    whole, cell = size
    bottom = 100 * (span[0] - cell / 2) / whole
    height = 100 * (span[1] - span[0] + cell) / whole
    return (
        f'<i style="left:{left:.2f}%;width:{width:.2f}%;'
        f'bottom:{bottom:.2f}%;height:{height:.2f}%;background:{Reason.FEASIBLE.color}"></i>'
    )


def _helps(conflict: Conflict) -> str:
    if conflict.regrasps is None:
        return ""
    if not conflict.regrasps:
        return '<div class="sg sg-small">Setting the object down and grasping it anew does not help.</div>'
    parts = [
        " and ".join(part.tasks) + (f", then set it down at {part.set_down}" if part.set_down else "")
        for part in conflict.regrasps
    ]
    text = f"{len(parts)} grasps do: {'; '.join(parts)}."
    return f'<div class="sg sg-small">{escape(text)}</div>'
