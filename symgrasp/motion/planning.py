"""Plan the motion of a plan: from home to the grasps, from task to task with the object, and home again."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from symgrasp.ik import Solver, redundancy_of, solver_for
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.drafting.draft import MotionDraft
from symgrasp.motion.drafting.ways import Grip
from symgrasp.motion.paths.search import NoMotionError
from symgrasp.motion.segments import Motion
from symgrasp.plan.plan import Grasp, Hold, Plan
from symgrasp.plan.writing import with_configurations
from symgrasp.progress import Progress, at_start
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world

__all__ = ["MotionPlanner", "plan_motion"]

LEAST_SAMPLES = 64
"""Redundancy samples of straight paths at least: between neighbouring ones joints hardly turn. Of an odd
multiple of those of maps, these are a part."""


def plan_motion(
    scene: Scene, plan: Plan, seed: int = 0, progress: Progress | None = None
) -> tuple[Plan, Motion]:
    """Plan the motion of a plan.

    Args:
        scene: the scene of the plan.
        plan: the grasps.
        seed: of the random numbers; the same one gives the same motion.
        progress: called with the finished share; may raise `Cancelled`.

    Returns:
        The plan with the configurations that its tasks have in the motion, chosen among all that the grasps
        have; and the motion, without times.

    Raises:
        NoMotionError: none was found; says which part is missing, and what is in its way.
    """
    with open_world(scene, progress) as world:
        return MotionPlanner(scene, world, progress).plan(plan, seed, progress)


class MotionPlanner:
    """Plans the motions of plans of one scene.

    Args:
        scene: the scene.
        world: a world of it.
        progress: called with 0 while it is made; may raise `Cancelled`.

    Raises:
        NoMotionError: an arm of five joints has a task: its hand cannot be led along given poses.

    Attributes:
        scene: the scene.
        bodies: the pieces of the scene.
    """

    def __init__(self, scene: Scene, world: BulletWorld, progress: Progress | None = None) -> None:
        names = dict.fromkeys(name for task in scene.tasks.values() for name in task.arms)
        pitched = [name for name in names if scene.arm(name).pitched]
        if pitched:
            raise NoMotionError(f"no motion of {', '.join(pitched)}: expected arms of 6 or 7 joints")
        self.scene, self.bodies = scene, MotionScene(scene, world, at_start(progress))
        self._world = world
        self._solvers: dict[tuple[str, tuple[float, ...]], tuple[Solver, Solver]] = {}

    def plan(self, plan: Plan, seed: int = 0, progress: Progress | None = None) -> tuple[Plan, Motion]:
        """Plan the motion of a plan; see `plan_motion`."""
        holds: dict[tuple[str, Grasp], list[Hold]] = {}
        for task in plan.tasks:
            for hold in task.holds:
                holds.setdefault((hold.arm, hold.grasp), []).append(hold)
        tell = at_start(progress)
        grips = {grasp: self.grip(own, tell) for grasp, own in holds.items()}
        found = MotionDraft(self.bodies, grips, plan, seed, progress).run()
        return with_configurations(self._world, plan, found.configurations), found.motion

    def grip(self, holds: Sequence[Hold], progress: Progress | None = None) -> Grip:
        """Return the grasp by which an arm holds the object in one or several tasks of a plan.

        The progress is told between the solvers that are made for it, on a torso one for each of its samples.
        """
        hold, arm = holds[0], self.scene.arm(holds[0].arm)
        more: tuple[float, ...] = ()
        if self.scene.settings.redundancy == "auto":  # whose grasps need not be at a sample
            q = [np.array([own.joints[name] for name in arm.joint_names]) for own in holds]
            phi = dict.fromkeys(redundancy_of(arm, own) for own in q)
            more = tuple(value for value in phi if value is not None)
        if (arm.name, more) not in self._solvers:
            samples = self.scene.settings.samples
            fine = samples * (2 * int(np.ceil((LEAST_SAMPLES / samples - 1) / 2)) + 1)
            solvers: list[Solver] = []
            for count in (samples, max(samples, fine)):
                solvers.append(
                    solver_for(arm, count, more=more, trying=partial(progress or (lambda _: None), 0.0))
                )
            self._solvers[arm.name, more] = solvers[0], solvers[1]
        return Grip.of(hold, arm, *self._solvers[arm.name, more], self.scene.profile)
