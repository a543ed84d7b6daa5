"""Whether hands get away from their grasps, and grasps closer than the margins of a plan are feasible."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.create import MapMaker
from symgrasp.ik import redundancy_of, solver_for
from symgrasp.object.manifold import Manifold
from symgrasp.plan.check_holds import tool_of
from symgrasp.plan.plan import Hold, PlanTask
from symgrasp.plan.report import Report
from symgrasp.poses import Array, inverse
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.scene.parts import Task
from symgrasp.world import BulletWorld

__all__ = ["check_margins"]


def check_margins(
    hold: Hold, task: PlanTask, where: str, world: BulletWorld, report: Report, progress: Progress | None
) -> None:
    """Check that a hand gets away from its grasp, and that grasps closer than each margin are still feasible.

    One arm at a time. The torso may move for another grasp, unless the arm shares it with another one.

    Args:
        hold: how the arm holds the object.
        task: the task in which it does.
        where: what the task is called in failures.
        world: a world of the scene; the object ends somewhere, the arms at home.
        report: where what is found is noted.
        progress: called with the finished share; may raise `Cancelled`.
    """
    scene, who, T = world.scene, f"{where}: {hold.arm}", task.object_pose_turned.array()
    arm, grid, g = scene.arm(hold.arm), scene.manifold, hold.grasp
    torso = None
    if arm.robot.torso is not None and sum(other.robot == hold.robot for other in task.holds) > 1:
        torso = arm.robot.torso.samples_at([hold.joints[name] for name in arm.robot.torso.joint_names])
        if not report.expect(torso, f"{who}: the torso is at none of the values that maps try"):
            return
    holders = [other.arm for other in task.holds]

    def checker_at(h: float) -> CandidateChecker:
        own = arm
        if arm.pitched:
            own = arm.at_pitch(g.pitch).grasping_at(scene.profile, h, int(g.roll > 1.0), 0.5 * grid.dtheta)
        ik = solver_for(own, scene.settings.samples, torso)
        return CandidateChecker(world, own, ik, scene.settings.approach, holders=holders)

    checker = checker_at(g.h)
    for name in scene.robots:
        world.park(name)
    _check_retreat(hold, checker, T, who, report)
    theta = g.theta
    if arm.pitched:  # it holds somewhere within its cell, and margins are counted from the middle
        _, column = grid.cell(g.h, g.theta + task.delta)
        theta = float(grid.theta[column]) - task.delta
    margins = (
        ("margin_along", hold.margin_along, grid.dh, grid.heights, (grid.dh, 0.0)),
        ("margin_around", hold.margin_around, grid.dtheta, grid.angles // 2, (0.0, grid.dtheta)),
    )
    cells: list[tuple[str, int, float, float]] = []
    for text, margin, size, limit, step in margins:
        count = round(margin / size)
        if not report.expect(count <= limit, f"{who}: {text} is larger than the object"):
            continue
        whole = count > 0 and abs(margin / size - count) < 1e-6
        report.expect(whole, f"{who}: {text} is {margin / size:.4f} cells, not a whole number above zero")
        report.at_most(margin, count * size, 1e-6 * size, f"{who}: {text} is more than {count} cells")
        signed = [sign * k for k in range(1, count) for sign in (-1, 1)]
        cells += [(text, k, g.h + k * step[0], theta + k * step[1]) for k in signed]
    for done, (text, away, h, theta) in enumerate(cells):
        if progress:
            progress(done / len(cells))
        free = _feasible(checker_at(h) if arm.pitched else checker, world, T, h, theta, g.roll)
        report.expect(free, f"{who}: {text} is overstated: {away:+d} cells away is infeasible")


def _check_retreat(hold: Hold, checker: CandidateChecker, T: Array, who: str, report: Report) -> None:
    """Check that the straight retreat from a grasp is free, and that the robot stands along it."""
    world, arm = checker.world, checker.arm
    if not world.scene.settings.approach:
        return
    world.set_object(T)
    q = np.array([hold.joints[name] for name in arm.joint_names])
    T_base_tool = arm.tool_pose(q)
    phi = redundancy_of(arm, q)
    if world.scene.settings.redundancy == "auto" and phi is not None:
        checker = _checker_at(checker, phi)
    found = checker.ik.solve(T_base_tool)
    if not report.expect(len(found.q), f"{who}: no configuration of the grasp is found"):
        return
    away = np.abs((found.q - q + np.pi) % (2 * np.pi) - np.pi).max(axis=1)  # a full turn is none
    sample = int(found.sample[away.argmin()])
    result = checker.check(T_base_tool, q, sample, hold.opening)
    text = f"{who}: {result.reason.label}, {1e3 * result.retreat:.0f} mm from the grasp"
    report.expect(result.reason == Reason.FEASIBLE, text)


def _feasible(
    checker: CandidateChecker, world: BulletWorld, T: Array, h: float, theta: float, roll: float
) -> bool:
    arm, profile = checker.arm, world.scene.profile
    if not profile.h_min <= h <= profile.h_max:
        return False
    radius = float(profile.radius(h))
    hand = arm.hand
    if not (hand.spans(radius) and hand.palm_has_room(profile, h) and hand.pads_rest(profile, h)):
        return False
    tool = inverse(arm.robot.T_world_base) @ tool_of(arm, T, h, theta, roll > 1.0, radius)
    world.set_object(T)
    candidates = checker.candidates(tool, arm.hand.opening(radius))
    if any(c.reason == Reason.FEASIBLE for c in candidates):
        return True
    if world.scene.settings.redundancy != "auto" or arm.pitched:
        return False
    return _feasible_between(checker, T, h, theta, roll, tool)


def _feasible_between(
    checker: CandidateChecker, T: Array, h: float, theta: float, roll: float, T_base_tool: Array
) -> bool:
    """Whether a grasp is feasible at a value of the redundancy that is no sample.

    A map tells at which, and the checker whether: it checks that configuration as any other.
    """
    world, arm = checker.world, checker.arm
    scene = world.scene
    row, _ = scene.manifold.cell(h, theta)
    if abs(float(scene.manifold.h[row]) - h) > 1e-9:
        return False  # no margin counts such grasps
    column = Manifold(scene.profile, scene.manifold.heights, 1, theta - np.pi)
    task = Task("between", checker.holders or (arm.name,), T)
    witness = (
        MapMaker(world).map(arm.name, task, manifold=column, certify=False).witness((int(roll > 1.0), row, 0))
    )
    if witness is None:
        return False
    for name in scene.robots:
        world.park(name)
    world.set_object(T)
    exact = _checker_at(checker, witness.phi)
    sample = int(np.abs(exact.ik.phi - witness.phi).argmin())
    result = exact.check(T_base_tool, witness.q, sample, witness.opening)
    return result.reason == Reason.FEASIBLE


def _checker_at(checker: CandidateChecker, phi: float) -> CandidateChecker:
    """Return a checker that also has a value φ (rad) of the redundancy."""
    settings = checker.world.scene.settings
    ik = solver_for(checker.arm, settings.samples, more=[phi])
    return CandidateChecker(checker.world, checker.arm, ik, settings.approach, holders=checker.holders)
