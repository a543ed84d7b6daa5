"""The animation of a plan: joint values interpolated linearly from one task to the next.

It is for display only: the way between two tasks is not checked for collisions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgrasp.plan.plan import Hold, PlanTask
from symgrasp.poses import Array, inverse
from symgrasp.scene.scene import Scene

from ..state.cached import cached
from ..state.state import State
from .weak_cache import cached_with_first

__all__ = ["PlaybackFrame", "plan_joint_values", "playback_frame"]


def plan_joint_values(scene: Scene, task: PlanTask) -> dict[str, Array]:
    """Return robot name → values (n,) of all its joints in a task; arms without a hold are at home."""
    values = {robot.name: robot.home.copy() for robot in scene.robots.values()}
    for hold in task.holds:
        names = scene.robots[hold.robot].model.joint_names
        for joint, value in (hold.joints | hold.hand_joints).items():
            values[hold.robot][names.index(joint)] = value
    return values


@dataclass(frozen=True, eq=False)
class PlaybackFrame:
    """One frame of the animation, between two tasks of a plan.

    Attributes:
        scene: the plan's scene.
        before, after: the tasks.
        share: how much of the way is done, 0 to 1.
    """

    scene: Scene
    before: PlanTask
    after: PlanTask
    share: float

    @cached
    def joint_values(self) -> dict[str, Array]:
        """Robot name → values (n,) of all its joints."""
        start, end = (plan_joint_values(self.scene, task) for task in (self.before, self.after))
        return {name: (1 - self.share) * start[name] + self.share * end[name] for name in start}

    @cached
    def T_world_object(self) -> Array:
        """Pose (4, 4) of the object: in the hand that carries it, else at the nearer task."""
        hold = self._carrier
        if hold is None:
            return (self.before if self.share < 0.5 else self.after).object_pose_turned.array()
        tool = self.scene.arm(hold.arm).world_tool_pose(self._arm_values(hold))
        in_hand = inverse(hold.tool_pose.array()) @ self.before.object_pose_turned.array()
        return tool @ in_hand

    @property
    def _carrier(self) -> Hold | None:
        """The hold of the first arm that keeps its grasp in both tasks."""
        after = {(hold.arm, hold.grasp) for hold in self.after.holds}
        return next((hold for hold in self.before.holds if (hold.arm, hold.grasp) in after), None)

    def _arm_values(self, hold: Hold) -> Array:
        arm = self.scene.arm(hold.arm)
        names = arm.robot.model.joint_names
        values = self.joint_values[hold.robot]
        return np.array([values[names.index(name)] for name in arm.joint_names])


@cached_with_first
def playback_frame(state: State) -> PlaybackFrame | None:
    """Return the frame that a state shows, None unless its playback is between two tasks."""
    if state.plan is None or state.step is None or not state.plan_results.is_between:
        return None
    start, share = state.plan_results.transition
    before, after = state.plan.plan.tasks[start : start + 2]
    return PlaybackFrame(state.scene, before, after, share)
