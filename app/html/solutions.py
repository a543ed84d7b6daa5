"""The list of the plans that were found, one line each."""

from __future__ import annotations

from collections.abc import Callable

from symgrasp.plan.plan import CLEARANCE_LIMIT

from ..state.plans.plan_results import PlanResult
from ..state.plans.solution_list import listed, solution_numbers
from ..state.plans.solution_order import COLUMNS
from ..state.state import State
from .escaping import escape
from .stack import margin_texts

__all__ = ["solutions_html", "worst_margin_texts"]


def solutions_html(state: State, target: Callable[[str], str]) -> str:
    """List the plans in the chosen order, the one that is shown marked; nothing if there is only one.

    Args:
        state: the state.
        target: gives the id of the button to press where a part of the list is clicked: by the index of a
            plan as text, or by a column of `COLUMNS`, empty for the number.
    """
    results = state.plan_results
    if len(results.plans) < 2:
        return ""
    numbers = [solution_numbers(plan) for plan in results.plans]
    columns = [column for column in COLUMNS if any(row[column] for row in numbers)]
    heads = []
    for column in ("", *columns):
        arrow = ("▲", "▼")[results.order.descending] if column == results.order.column else ""
        name = column or "#"
        heads.append(
            f'<label for="{target(column)}" role="columnheader" title="sort by {escape(name)}">'
            f"{escape(name)}{arrow}</label>"
        )
    rows = [f'<div role="row" class="sg-faint">{"".join(heads)}</div>']
    for k in listed(results.plans, results.order):
        texts = (str(k + 1), *(_text(column, numbers[k][column]) for column in columns))
        cells = "".join(f'<span role="cell">{escape(text)}</span>' for text in texts)
        now = ' class="sg-now" aria-selected="true"' if k == results.index else ""
        rows.append(f'<label for="{target(str(k))}" role="row"{now}>{cells}</label>')
    style = f"--columns: repeat({len(columns) + 1}, auto)"
    return (
        f'<div class="sg-solutions" role="table" aria-label="solutions" style="{style}">{"".join(rows)}</div>'
    )


def _text(column: str, numbers: tuple[float, ...]) -> str:
    if column == "gap (mm)" and numbers and numbers[0] < 0:
        return "overlap"
    if column == "clear (mm)" and numbers[0] >= 1e3 * CLEARANCE_LIMIT:
        return f"> {numbers[0]:.0f}"
    digits = 1 if column in ("h (cm)", "θ (°)") else 0
    return ", ".join(f"{round(number, digits) + 0.0:.{digits}f}" for number in numbers)


def worst_margin_texts(plan: PlanResult) -> tuple[str, str, str]:
    """Return `margin_texts` of the least margins and the least clearance of all hands in all tasks."""
    holds = [hold for task in plan.plan.tasks for hold in task.holds]
    names = ("margin_along", "margin_around", "clearance")
    worst = {name: min(getattr(hold, name) for hold in holds) for name in names}
    return margin_texts(holds[0].model_copy(update=worst))
