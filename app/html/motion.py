"""What a plan's motion does at the moment that is shown, in words."""

from __future__ import annotations

import numpy as np

from symgrasp.motion.segments import Segment

from ..render.clearance_colors import CLEAR, clearance_color
from ..render.playback import motion_state
from ..state.state import State
from .escaping import escape

__all__ = ["motion_html"]

NO_MOTION = (
    "Pictures of the tasks, one after the other: how the arms get from one to the next is not planned yet."
)


def motion_html(state: State) -> str:
    """Say which segment of the motion is shown, with the legend of the tool's way; nothing without a plan."""
    plan = state.plan
    if plan is None:
        return ""
    if plan.motion is None:
        changing = " sg-changing" if state.plan_results.changing else ""
        return f'<div class="sg sg-faint{changing}">{escape(NO_MOTION)}</div>'
    moment = motion_state(state)
    now = "" if moment is None else _now(state, plan.motion.segments[moment.segment], moment.segment)
    return f'<div class="sg">{now}{_legend()}{_failures(state)}</div>'


def _failures(state: State) -> str:
    """Say why plans before this one have no motion."""
    reasons = state.plan_results.motionless
    first = state.plan_results.index + 1 - len(reasons)
    lines = [f"solution {k} has no motion: {reason}" for k, reason in enumerate(reasons, start=first)]
    return "".join(f'<div class="sg-faint">{escape(line)}</div>' for line in lines)


def _now(state: State, segment: Segment, index: int) -> str:
    plan = state.plan
    assert plan and plan.motion
    way = segment.task_from
    if segment.task_to != segment.task_from:
        way += f" → {segment.task_to}"
    time = f"{state.plan_results.position:.1f} of {plan.motion.duration:.1f} s"
    text = f"{segment.kind}, {way}, {', '.join(segment.arms)}"
    count = f"part {index + 1} of {len(plan.motion.segments)}, {1e3 * segment.clearance:.1f} mm clear; {time}"
    return f"<div><b>{escape(text)}</b></div><div>{escape(count)}</div>"


def _legend() -> str:
    colors = [clearance_color(x) for x in np.linspace(0, CLEAR, 9)]
    stops = ", ".join(f"rgb({r},{g},{b})" for r, g, b in colors)
    style = f"display:inline-block;width:6em;height:.6em;background:linear-gradient(90deg,{stops})"
    bar = f'<span style="{style}"></span>'
    return f'<div class="sg-faint">way of the tool: 0 {bar} {1e3 * CLEAR:.0f} mm clear</div>'
