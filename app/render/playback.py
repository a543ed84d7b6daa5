"""Where robots and object are in the tasks of a plan, and at a moment of its motion."""

from __future__ import annotations

from symgrasp.motion.segments import MotionState
from symgrasp.plan.plan import PlanTask
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

from ..state.state import State
from .weak_cache import cached_with_first

__all__ = ["motion_state", "plan_joint_values"]


def plan_joint_values(scene: Scene, task: PlanTask) -> dict[str, Array]:
    """Return robot name → values (n,) of all its joints in a task; arms without a hold are at home."""
    values = {robot.name: robot.home.copy() for robot in scene.robots.values()}
    for hold in task.holds:
        names = scene.robots[hold.robot].model.joint_names
        for joint, value in (hold.joints | hold.hand_joints).items():
            values[hold.robot][names.index(joint)] = value
    return values


@cached_with_first
def motion_state(state: State) -> MotionState | None:
    """Return the moment of the plan's motion that a state shows; None where it shows none."""
    if state.plan is None or state.plan.motion is None or state.step is None or state.plan_results.by_hand:
        return None
    return state.plan.motion.at(state.plan_results.position)
