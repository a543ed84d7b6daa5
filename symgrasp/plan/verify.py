"""Checks a plan without trusting the planner that made it.

Everything is built anew from what the plan itself holds: the scene from its content, poses from
its numbers, configurations put through the URDF and into PyBullet. No code of a planner takes part, and
of maps nothing but the proof of margins that are stated as proven, beside grasps that are tried within
them, and the value of the redundancy at which a grasp is tried. Each module ``check_…`` beside this one
has one theme.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from symgrasp.feasibility.create import MapMaker
from symgrasp.plan.check_holds import check_holds
from symgrasp.plan.check_margins import check_margins
from symgrasp.plan.check_motion import check_motion
from symgrasp.plan.check_order import check_grasps_stay, check_order, check_support
from symgrasp.plan.check_poses import check_poses
from symgrasp.plan.check_record import check_planner, check_scene
from symgrasp.plan.plan import Plan
from symgrasp.plan.report import Report
from symgrasp.progress import Progress, part_of
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

__all__ = ["verify"]


def verify(
    plan: Plan | str | Path,
    progress: Progress | None = None,
    *,
    scene: Scene | None = None,
    strict: bool = False,
) -> Report:
    """Check every statement of a plan: scene, order, poses, joints, collisions, clearances, margins.

    Args:
        plan: the plan, or the path of its file.
        progress: called with the finished share; may raise `Cancelled`.
        scene: the scene that the plan must be for; any if None.
        strict: let no number be overstated at all, not even by what rounding could explain.

    Returns:
        What was checked and what does not hold; true where all of it holds.

    Raises:
        PlanError: the file is missing or is not a plan.
    """
    plan = plan if isinstance(plan, Plan) else Plan.load(plan)
    report = Report(strict)
    check_planner(plan, report)
    own = check_scene(plan, scene, report)
    if progress:
        progress(0.0)
    if own is None:
        return report
    check_order(plan, own, report)
    places = [f"tasks[{k}] ({task.name})" for k, task in enumerate(plan.tasks)]
    posed = [check_poses(task, where, own, report) for task, where in zip(plan.tasks, places, strict=True)]
    with open_world(own, progress) as world:
        if all(posed):
            check_grasps_stay(plan, world, report)
            check_support(plan, world, report)
        holds = [(k, task, hold) for k, task in enumerate(plan.tasks) for hold in task.holds]
        parts = len(plan.tasks) + len(holds) + (plan.motion is not None)
        for k, task in enumerate(plan.tasks):
            trying = partial(progress or (lambda _: None), k / parts)
            trying()
            if posed[k]:
                check_holds(task, places[k], world, report, trying)
        if not report.failures:  # margins are those of grasps that hold
            maker = MapMaker(world)
            for done, (k, task, hold) in enumerate(holds, start=len(plan.tasks)):
                check_margins(hold, task, places[k], maker, report, part_of(progress, done, parts))
        if plan.motion is not None and not report.failures:
            tell = part_of(progress, parts - 1, parts)
            check_motion(plan, plan.motion, world, report.expect, tell, strict=strict)
    if progress:
        progress(1.0)
    return report
