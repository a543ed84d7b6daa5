"""Whether hands get away from their grasps, and grasps closer than the margins of a plan are feasible."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.creation.torso_maps import merged
from symgrasp.ik import redundancy_of, solver_for
from symgrasp.object.manifold import ROLLS, Manifold, wrap
from symgrasp.plan.check_holds import tool_of
from symgrasp.plan.plan import Hold, PlanTask
from symgrasp.plan.report import Report
from symgrasp.poses import Array, inverse
from symgrasp.progress import Progress, at_start, part_of
from symgrasp.reason import Reason
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

__all__ = ["check_margins"]


def check_margins(
    hold: Hold, task: PlanTask, where: str, maker: MapMaker, report: Report, progress: Progress | None
) -> None:
    """Check that a hand gets away from its grasp, and that grasps closer than each margin are still feasible.

    One arm at a time. The torso may move for another grasp, unless the arm shares it with another one. Proven
    margins are proven anew, and whatever the proof says, grasps within them are tried as closely as the map
    was split.

    Args:
        hold: how the arm holds the object.
        task: the task in which it does.
        where: what the task is called in failures.
        maker: computes maps of the scene, in a world whose object ends somewhere, the arms at home.
        report: where what is found is noted.
        progress: called with the finished share; may raise `Cancelled`.
    """
    world = maker.world
    scene, who, T = world.scene, f"{where}: {hold.arm}", task.object_pose_turned.array()
    arm, grid, g = scene.arm(hold.arm), scene.manifold, hold.grasp
    torso = None
    if arm.robot.torso is not None and sum(other.robot == hold.robot for other in task.holds) > 1:
        torso = arm.robot.torso.samples_at([hold.joints[name] for name in arm.robot.torso.joint_names])
        if not report.expect(torso, f"{who}: the torso is at none of the values that maps try"):
            return
    holders = tuple(other.arm for other in task.holds)
    q = np.array([hold.joints[name] for name in arm.joint_names])

    def checker_at(h: float) -> CandidateChecker:
        own = arm
        if arm.pitched:
            own = arm.at_pitch(g.pitch).grasping_at(scene.profile, h, int(g.roll > 1.0), 0.5 * grid.dtheta)
        ik = solver_for(own, scene.settings.samples, torso, trying=partial(progress or (lambda _: None), 0.0))
        return CandidateChecker(world, own, ik, scene.settings.approach, holders=holders)

    proven = hold.margins == "proven"
    if proven and not _check_proof(hold, task, who, maker, torso, report, at_start(progress)):
        return
    checker = checker_at(g.h)
    for name in scene.robots:
        world.park(name)
    _check_retreat(hold, checker, T, who, report)
    theta = g.theta
    if arm.pitched:  # it holds somewhere within its cell, and margins are counted from the middle
        _, column = grid.cell(g.h, g.theta + task.delta)
        theta = float(grid.theta[column]) - task.delta
    fine = _tried_grid(scene, grid) if proven else grid
    grasps = _Grasps(maker, T, g.roll, fine)
    phi = redundancy_of(arm, q)
    if proven and scene.settings.redundancy == "auto" and phi is not None and torso is None:
        checker = _checker_at(checker, phi)
    if proven:
        along, around = _within(hold.margin_along, fine.dh), _within(hold.margin_around, fine.dtheta)
    else:
        along, around = (_counted(hold, which, grid, who, report) for which in ("along", "around"))
    sides = [
        (text, steps, sign * dh, sign * dtheta)
        for text, steps, dh, dtheta in (
            ("margin_along", along, fine.dh, 0.0),
            ("margin_around", around, 0.0, fine.dtheta),
        )
        for sign in (-1, 1)
    ]
    done, total = 0, 2 * (len(along) + len(around))
    for text, steps, dh, dtheta in sides:
        near: Array | None = q
        for k in steps:
            tell = part_of(progress, done, total)
            done += 1
            if near is None:
                continue
            own = checker_at(g.h + k * dh) if arm.pitched else checker
            near = _feasible(own, grasps, g.h + k * dh, theta + k * dtheta, near, tell)
            away = f"{1e3 * k * dh:+.1f} mm" if dh else f"{np.rad2deg(k * dtheta):+.1f}°"
            report.expect(near is not None, f"{who}: {text} is overstated: {away} away is infeasible")


class _Grasps(NamedTuple):
    """The grasps that are tried.

    Attributes:
        maker: computes maps of the scene.
        T_world_object: pose (4, 4) of the object.
        roll: that of the hand (rad).
        fine: a grid whose rows have all their heights.
    """

    maker: MapMaker
    T_world_object: Array
    roll: float
    fine: Manifold


def _counted(hold: Hold, which: str, grid: Manifold, who: str, report: Report) -> range:
    """Check that a margin is a number of cells, and return how many cells away grasps should be feasible."""
    text = f"margin_{which}"
    margin: float = getattr(hold, text)
    size, limit = (grid.dh, grid.heights) if which == "along" else (grid.dtheta, grid.angles // 2)
    count = round(margin / size)
    if not report.expect(count <= limit, f"{who}: {text} is larger than the object"):
        return range(0)
    whole = count > 0 and abs(margin / size - count) < 1e-6
    report.expect(whole, f"{who}: {text} is {margin / size:.4f} cells, not a whole number above zero")
    report.at_most(margin, count * size, 1e-6 * size, f"{who}: {text} is more than {count} cells")
    return range(1, count)


def _tried_grid(scene: Scene, grid: Manifold) -> Manifold:
    """Return a grid of half the parts of a map at most, with the middles of all cells among its own."""
    finest = [grid, *scene.settings.finer(grid)][-1]
    heights, angles = (
        cells * (2 * (parts // cells) + 1)
        for cells, parts in ((grid.heights, finest.heights), (grid.angles, finest.angles))
    )
    return Manifold(grid.profile, heights, angles)


def _within(margin: float, step: float) -> range:
    """Return how many steps stay within a margin."""
    return range(1, int(margin / step + 1e-9) + 1)


def _check_proof(
    hold: Hold,
    task: PlanTask,
    who: str,
    maker: MapMaker,
    torso: Sequence[int] | None,
    report: Report,
    progress: Progress | None,
) -> bool:
    """Check that margins are no larger than what is proven of the cells in line with that of the grasp.

    Args:
        hold: how the arm holds the object.
        task: the task in which it does.
        who: what the arm is called in failures.
        maker: computes maps of the scene.
        torso: the samples of the torso that the arm shares with others, None where it shares none.
        report: where what is found is noted.
        progress: called now and then; may raise `Cancelled`.
    """
    grid, g = maker.scene.manifold, hold.grasp
    row, column = grid.cell(g.h, g.theta + task.delta)
    away = abs(float(grid.h[row]) - g.h), abs(float(wrap(grid.theta[column] - g.theta - task.delta)))
    text = f"{who}: margins are proven from the middle of a cell, and the grasp is in none"
    if not report.expect(max(away) < 1e-9, text):
        return False
    cell = Cell(int(g.roll > 1.0), row, column)
    only = np.zeros((len(ROLLS), grid.heights, grid.angles), dtype=bool)
    only[cell.roll, :, cell.column] = only[cell.roll, cell.row] = True
    posed = Task(task.name, tuple(other.arm for other in task.holds), task.object_pose.array())
    if torso is None:
        m = maker.map(hold.arm, posed, certify=True, only=only, progress=progress)
    else:
        maps = maker.maps_by_torso(hold.arm, posed, certify=True, only=only, progress=progress)
        m = merged([maps[t] for t in torso])
    text = f"{who}: no margins are proven of arms with five joints, or with a retreat"
    if not report.expect(m.margins_proven, text):
        return False
    proven = m.margin(cell)
    along = (
        f"{who}: margin_along is {1e3 * hold.margin_along:.4f} mm, but {1e3 * proven.along:.4f} mm is proven"
    )
    around = (
        f"{who}: margin_around is {np.rad2deg(hold.margin_around):.4f}°, "
        f"but {np.rad2deg(proven.around):.4f}° is proven"
    )
    both = report.at_most(hold.margin_along, proven.along, 1e-9, along)
    return report.at_most(hold.margin_around, proven.around, 1e-9, around) and both


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
    checker: CandidateChecker,
    grasps: _Grasps,
    h: float,
    theta: float,
    near: Array,
    progress: Progress | None,
) -> Array | None:
    """Return a configuration (n,) that holds a grasp, None where there is none: nearest ones are tried first.

    Args:
        checker: checks configurations.
        grasps: the grasps that are tried.
        h: height (m) of this one.
        theta: its angle (rad).
        near: (n,) a configuration that holds the grasp beside it.
        progress: called now and then; may raise `Cancelled`.
    """
    arm, world, n = checker.arm, checker.world, len(near)
    profile, hand = world.scene.profile, arm.hand
    if not profile.h_min <= h <= profile.h_max:
        return None
    radius = float(profile.radius(h))
    if not (hand.spans(radius) and hand.palm_has_room(profile, h) and hand.pads_rest(profile, h)):
        return None
    T, roll = grasps.T_world_object, grasps.roll
    tool = inverse(arm.robot.T_world_base) @ tool_of(arm, T, h, theta, roll > 1.0, radius)
    world.set_object(T)
    found = checker.ik.solve(tool)
    for k in np.argsort(np.abs(found.q[:, :n] - near).max(axis=1, initial=0.0), kind="stable"):
        if found.inside[k]:
            if progress:
                progress(0.0)
            result = checker.check(tool, found.q[k], int(found.sample[k]), hand.opening(radius))
            if result.reason == Reason.FEASIBLE:
                return found.q[k, :n]
    if world.scene.settings.redundancy != "auto" or arm.pitched:
        return None
    return _feasible_between(checker, grasps, h, theta, tool, progress)


def _feasible_between(
    checker: CandidateChecker,
    grasps: _Grasps,
    h: float,
    theta: float,
    T_base_tool: Array,
    progress: Progress | None,
) -> Array | None:
    """Return a configuration (n,) that holds a grasp at a value of the redundancy that is no sample, if any.

    A map tells at which, and the checker whether: it checks that configuration as any other.
    """
    world, arm, T, fine = checker.world, checker.arm, grasps.T_world_object, grasps.fine
    row, _ = fine.cell(h, theta)
    if abs(float(fine.h[row]) - h) > 1e-9:
        return None  # no margin has such grasps
    column = Manifold(fine.profile, fine.heights, 1, theta - np.pi)
    task = Task("between", checker.holders or (arm.name,), T)
    cell = Cell(int(grasps.roll > 1.0), row, 0)
    only = np.zeros((len(ROLLS), fine.heights, 1), dtype=bool)
    only[cell] = True
    m = grasps.maker.map(arm.name, task, manifold=column, progress=progress, certify=False, only=only)
    witness = m.witness(cell)
    if witness is None:
        return None
    for name in world.scene.robots:
        world.park(name)
    world.set_object(T)
    exact = _checker_at(checker, witness.phi)
    sample = int(np.abs(exact.ik.phi - witness.phi).argmin())
    result = exact.check(T_base_tool, witness.q, sample, witness.opening)
    return witness.q if result.reason == Reason.FEASIBLE else None


def _checker_at(checker: CandidateChecker, phi: float) -> CandidateChecker:
    """Return a checker that also has a value φ (rad) of the redundancy."""
    settings = checker.world.scene.settings
    ik = solver_for(checker.arm, settings.samples, more=[phi])
    return CandidateChecker(checker.world, checker.arm, ik, settings.approach, holders=checker.holders)
