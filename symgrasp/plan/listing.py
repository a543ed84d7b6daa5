"""Plans in words: one line a plan, to choose from a list."""

from __future__ import annotations

import math

from symgrasp.plan.plan import Grasp, Plan

__all__ = ["place_in_words", "plan_in_words"]


def plan_in_words(plan: Plan) -> str:
    """Say where each arm holds, and the least of the margins, clearances and distances from limits."""
    holds = [hold for task in plan.tasks for hold in task.holds]
    grasps = dict.fromkeys((hold.arm, place_in_words(hold.grasp)) for hold in holds)
    along = 1e3 * min(hold.margin_along for hold in holds)
    around = math.degrees(min(hold.margin_around for hold in holds))
    clear = 1e3 * min(hold.clearance for hold in holds)
    where = "; ".join(f"{arm} at {place}" for arm, place in grasps)
    proven = ", proven" if all(hold.margins == "proven" for hold in holds) else ""
    text = f"{where}: margins {along:.1f} mm, {around:.1f}°{proven}; {clear:.1f} mm clear"
    slacks = [hold.limit_slack for hold in holds if hold.limit_slack is not None]
    return f"{text}; {math.degrees(min(slacks)):.1f}° from limits" if slacks else text


def place_in_words(grasp: Grasp) -> str:
    """Say where on the object a grasp is."""
    turn = f"θ = {math.degrees(grasp.theta):.1f}°, roll {math.degrees(grasp.roll):.0f}°"
    pitch = f", pitch {math.degrees(grasp.pitch):.1f}°" if grasp.pitch else ""
    return f"h = {100 * grasp.h:.1f} cm, {turn}{pitch}"
