"""Whether the tasks of a plan are those of its scene, in order, and the object is always held or stands."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise

from symgrasp.errors import as_written
from symgrasp.plan.check_poses import same_pose
from symgrasp.plan.plan import Plan, PlanTask
from symgrasp.plan.report import Report
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld

__all__ = ["check_grasps_stay", "check_order", "check_support"]


def check_order(plan: Plan, scene: Scene, report: Report) -> None:
    """Check that the tasks are those of the scene, held by the right arms, with a grasp that stays."""
    arms = {hold.arm for task in plan.tasks for hold in task.holds}
    for k, task in enumerate(plan.tasks):
        given = scene.tasks.get(task.name)
        if (
            report.expect(given is not None, f"tasks[{k}]: the scene has no task {as_written(task.name)}")
            and given
        ):
            held = tuple(hold.arm for hold in task.holds)
            report.expect(
                held == given.arms,
                f"tasks[{k}] ({task.name}): held by {as_written(held)}, not {as_written(given.arms)}",
            )
    names = [task.name for task in plan.tasks]
    if plan.kind == "sequential":
        expected = [t.name for t in scene.tasks.values() if len(t.arms) == 1 and t.arms[0] in arms]
        visits = [(name, list(same)) for name, same in groupby(plan.tasks, key=lambda task: task.name)]
        steps = [name for name, _ in visits]
        report.expect(
            _is_subsequence(expected, steps),
            f"tasks: {as_written(names)}, but the scene asks for {as_written(expected)}",
        )
        extra = [name for name in names if name not in expected]
        report.expect(not extra, f"tasks: {as_written(extra)} are not in the sequence {as_written(expected)}")
        report.expect(len(arms) == 1, f"tasks: one arm does the sequence, not {as_written(sorted(arms))}")
        _check_regrasps(plan, expected, visits, report)
    elif plan.kind == "bimanual":
        report.expect(len(plan.tasks) == 1 and len(arms) > 1, "tasks: one task with several arms")
    else:
        expected = list(scene.tasks)
        report.expect(
            names == expected, f"tasks: {as_written(names)}, but the scene asks for {as_written(expected)}"
        )
        report.expect(len(names) > 1 and len(arms) > 1, "tasks: several tasks with several arms hand over")


def _check_regrasps(
    plan: Plan, expected: list[str], visits: Sequence[tuple[str, Sequence[PlanTask]]], report: Report
) -> None:
    """Check that what a sequence does beyond its tasks is to grasp the object anew.

    Args:
        plan: the plan.
        expected: the names of the tasks in order.
        visits: name → what the plan does there in a row.
        report: where what is found is noted.
    """
    regrasps = 0
    left = list(expected)
    for name, same in visits:
        changes = sum(_grasps(a) != _grasps(b) for a, b in pairwise(same))
        regrasps += changes
        once = len(same) == 1 and left[:1] == [name]
        report.expect(once or changes == 1, f"tasks: {name} is done again without a new grasp")
        if left[:1] == [name]:
            del left[0]
    text = f"planner: {plan.planner.algorithm} grasps the object anew {regrasps} times"
    report.expect(not regrasps or plan.planner.algorithm == "regrasp", text)


def check_grasps_stay(plan: Plan, world: BulletWorld, report: Report) -> None:
    """Check that every arm keeps its grasp, unless the object stands while it is grasped anew."""
    for k, (before, after) in enumerate(pairwise(plan.tasks), start=1):
        where = f"tasks[{k}] ({after.name})"
        old_grasps, new_grasps = _grasps(before), _grasps(after)
        kept = [old_grasps[arm] == grasp for arm, grasp in new_grasps.items() if arm in old_grasps]
        if all(kept) and kept:
            continue
        old, new = before.object_pose_turned.array(), after.object_pose_turned.array()
        if before.name == after.name or not kept:
            same_pose(old, new, f"{where}: the object moved while nobody held it", report)
            report.expect(world.object_rests(old), f"{where}: the object is let go where nothing holds it up")
        else:
            report.expect(False, f"{where}: an arm changed its grasp on the way")


def check_support(plan: Plan, world: BulletWorld, report: Report) -> None:
    """Check that something holds the object up before it is first held, and after it is last held."""
    ends = {0: "before it is held", len(plan.tasks) - 1: "after it was held"}
    for k, when in ends.items() if plan.tasks else ():
        task = plan.tasks[k]
        given = world.scene.tasks.get(task.name)
        if given is not None and given.supported is not False:
            where = f"tasks[{k}] ({task.name})"
            rests = world.object_rests(task.object_pose_turned.array())
            report.expect(rests, f"{where}: nothing holds the object up {when}, nor is it supported: false")


def _grasps(task: PlanTask) -> dict[str, object]:
    """Return how each arm holds the object in a task."""
    return {hold.arm: (hold.grasp, hold.opening) for hold in task.holds}


def _is_subsequence(wanted: list[str], names: list[str]) -> bool:
    rest = iter(names)
    return all(name in rest for name in wanted)
