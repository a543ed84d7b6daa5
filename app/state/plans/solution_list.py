"""The plans that were found as rows of a table: their numbers, and the order in which they are listed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .plan_results import PlanResult
from .solution_order import SolutionOrder

__all__ = ["listed", "solution_numbers"]


def solution_numbers(plan: PlanResult) -> dict[str, tuple[float, ...]]:
    """Return for each of `COLUMNS` the numbers of a plan: of its grasps, or the least of all hands and tasks.

    Arms come in the order of the plan. Columns that say nothing of it are empty.
    """
    holds = [hold for task in plan.plan.tasks for hold in task.holds]
    grasps = [grasp for _, grasp in dict.fromkeys((hold.arm, hold.grasp) for hold in holds)]
    gaps = [gap for gap in plan.gaps if gap is not None]
    return {
        "h (cm)": tuple(100 * grasp.h for grasp in grasps),
        "θ (°)": tuple(float(np.rad2deg(grasp.theta)) for grasp in grasps),
        "roll (°)": tuple(float(np.rad2deg(grasp.roll)) for grasp in grasps),
        "pitch (°)": tuple(float(np.rad2deg(grasp.pitch)) for grasp in grasps if grasp.pitch),
        "gap (mm)": (1e3 * min(gaps),) if gaps else (),
        "along (mm)": (1e3 * min(hold.margin_along for hold in holds),),
        "around (°)": (float(np.rad2deg(min(hold.margin_around for hold in holds))),),
        "clear (mm)": (1e3 * min(hold.clearance for hold in holds),),
    }


def listed(plans: Sequence[PlanResult], order: SolutionOrder) -> list[int]:
    """Return the indices of plans in an order; equal ones stay in the order of the planner."""
    indices = list(range(len(plans)))
    if not order.column:
        return indices[::-1] if order.descending else indices
    keys = [solution_numbers(plan)[order.column] for plan in plans]
    return sorted(indices, key=lambda k: keys[k], reverse=order.descending)
