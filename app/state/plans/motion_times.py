"""When the motion of a plan is at which task of it."""

from __future__ import annotations

from symgrasp.motion.segments import Motion
from symgrasp.plan.plan import Plan

__all__ = ["task_times"]


def task_times(plan: Plan, motion: Motion) -> list[tuple[float, float]]:
    """Return for each task of a plan from when on (s) it is the nearest, and when (s) the object arrives.

    The way between two tasks belongs half to each. Where the object is grasped anew, the second visit begins
    when it is let go.
    """
    times = [(0.0, 0.0)]
    held: tuple[str, ...] = ()
    names = [task.name for task in plan.tasks]
    for start, end, segment in zip(motion.starts, motion.starts[1:], motion.segments, strict=False):
        index = len(times) - 1
        if segment.task_to != segment.task_from:
            arrived = next((k for k in range(index + 1, len(names)) if names[k] == segment.task_to), index)
            times += [(0.5 * (start + end), end)] * (arrived - index)
        elif segment.kind == "lower":
            times[index] = (times[index][0], end)
        elif segment.kind == "open" and held and names[index : index + 2] == 2 * [segment.task_from]:
            times.append((end, end))
        held = segment.held_by
    last = times[-1]
    return [*times, *[last] * (len(names) - len(times))]
