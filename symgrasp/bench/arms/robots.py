"""A map of every robot of the catalogue, and an independent search that tries to refute it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from symgrasp.bench.arms.ik import bare_arm, random_configurations, recall, sampled_solver
from symgrasp.bench.arms.numerical import reach
from symgrasp.errors import InputError, SymgraspError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.exact.engine import ExactEngine
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.starter import starter_scene
from symgrasp.found_arms import find_arms
from symgrasp.ik import ArmIK, GridSolvers, PitchedIK, solver_for
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE, CatalogueRobot
from symgrasp.robot.model import RobotModel
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

__all__ = ["CHECKED", "GRID", "Check", "Refuted", "RobotRow", "check", "measure", "run"]

GRID = {"heights": 24, "angles": 48, "redundancy": 16}
"""The grid of the maps; with two rolls, 2304 cells."""

CHECKED = 40
"""Cells of each kind that are checked; all of them where there are fewer."""

MAPS = 12
"""Most maps from which they come. Where the first has too few, the can is put where the arm would hold it in
random configurations if it had no limits."""

KINDS = ((Reason.UNREACHABLE, Reason.NOT_FOUND), (Reason.JOINT_LIMITS,))
"""The reasons of the cells of which a search might find that they can be reached."""


@dataclass(frozen=True)
class Refuted:
    """A cell without a configuration, and one that the independent search found for it.

    Attributes:
        T_world_object: pose of the object, row by row.
        cell: (roll, row, column).
        reason: what the map says.
        q: joint values (n,), inside the limits, that reach it.
        missed: whether the solver has no configuration inside the limits at the very value of the redundancy;
            otherwise this value only lies between the samples of the map.
    """

    T_world_object: tuple[tuple[float, ...], ...]
    cell: tuple[int, int, int]
    reason: str
    q: tuple[float, ...]
    missed: bool


@dataclass(frozen=True)
class Check:
    """What the independent search made of some cells.

    Attributes:
        cells: number of cells that were checked.
        reached: number of those that it reached inside the limits, at any value of the redundancy.
        missed: number of those where the solver has nothing at that value: faults of the solver.
        refuted: the cells that were reached, where the map says that none can be.
    """

    cells: int = 0
    reached: int = 0
    missed: int = 0
    refuted: tuple[Refuted, ...] = ()

    def __str__(self) -> str:
        return f"{self.reached} of {self.cells} reached, {self.missed} missed"


@dataclass(frozen=True)
class RobotRow:
    """What was measured of a robot.

    Attributes:
        name: the robot and its arm.
        problem: why there is no map; empty where there is one. Without an arm or solver, nothing is known.
        hand: name of the hand.
        family: of the inverse kinematics.
        engine: exact, or Algorithm 1.
        milliseconds: CPU time (ms), of all cores together, of a map whose engine was built before.
        feasible: share of the cells that are feasible.
        poses: number of random configurations.
        found: how many of them the inverse kinematics finds.
        unreached: check of cells that are out of reach or not found.
        limits: check of cells whose reason is joint limits.
        control: what the independent search makes of feasible cells: it should reach them.
        content: the scene.
    """

    name: str
    problem: str = ""
    hand: str = ""
    family: str = ""
    engine: str = ""
    milliseconds: float = 0.0
    feasible: float = 0.0
    poses: int = 0
    found: int = 0
    unreached: Check = Check()
    limits: Check = Check()
    control: Check = Check()
    content: dict[str, Any] | None = None

    def line(self) -> str:
        """Return the row as one line of text."""
        solver = (
            f"{self.family:46} recall {100 * self.found / self.poses:7.3f} %" if self.family else "no solver"
        )
        if self.problem:
            return f"{self.name:18} {solver}, no map: {self.problem}"
        return (
            f"{self.name:18} {solver}, {self.engine:12} {self.milliseconds:8.1f} ms  "
            f"{100 * self.feasible:5.1f} % feasible, out of reach: {self.unreached}, "
            f"joint limits: {self.limits}, feasible: {self.control.reached} of {self.control.cells} reached"
        )


def run(poses: int) -> Iterator[RobotRow]:
    """Measure the first arm of every robot of the catalogue; recall with that many random configurations.

    As many robots as there are cores are measured at once, each in a process of its own, so that the CPU time
    that a process has used is that of one robot.
    """
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        yield from pool.map(measure, CATALOGUE, repeat(poses))


def measure(robot: CatalogueRobot, poses: int) -> RobotRow:
    """Measure a robot's first arm; what the library refuses is a row that says why."""
    name = robot.name if len(robot.arms) == 1 else f"{robot.name} {robot.arms[0].name}"
    try:
        path = resolve(robot.urdf, Path())
        if path is None:
            raise InputError(robot.name, "urdf", robot.urdf, f"pip install {robot.package}")
        arm = find_arms(RobotModel(path, follow_up_axis=robot.follow_up_axis))[0]
        content = starter_scene(robot.name, robot.urdf, [arm], robot.reading)
        content["map"] = dict(GRID)
        return _measured(name, content, poses)
    except SymgraspError as error:
        problem = str(error)
        if isinstance(error, InputError):  # without the source, a file of this machine
            problem = f"{error.field}: {error.value}, expected {error.expected}"
        return _without_map(robot, name, problem, poses)


def _without_map(robot: CatalogueRobot, name: str, problem: str, poses: int) -> RobotRow:
    """Return what can be measured of an arm without a scene."""
    try:
        arm = bare_arm(robot, robot.arms[0])
        ik = solver_for(arm, GRID["redundancy"])
    except SymgraspError:
        return RobotRow(name, problem)
    assert isinstance(ik, ArmIK | PitchedIK)
    found = recall(sampled_solver(ik), random_configurations(arm, poses, 0))
    return RobotRow(name, problem, family=ik.family, poses=poses, found=found)


def _measured(name: str, content: dict[str, Any], poses: int) -> RobotRow:
    """Return what is measured of a scene with one arm."""
    scene = Scene.from_content(content)
    arm = scene.arm()
    ik = solver_for(arm, scene.settings.samples)
    assert isinstance(ik, ArmIK | PitchedIK)  # a scene to start from has no torso that moves
    with open_world(scene) as world:
        maker = MapMaker(world)
        maker.map()  # builds the engine
        start = process_time()
        the_map = maker.map()
        seconds = process_time() - start
        maps = _enough(maker, the_map)
    return RobotRow(
        name=name,
        hand=arm.hand.name,
        family=ik.family,
        engine="exact" if ExactEngine.knows(arm) else "Algorithm 1",
        milliseconds=1e3 * seconds,
        feasible=float(the_map.feasible.mean()),
        poses=poses,
        found=recall(sampled_solver(ik), random_configurations(arm, poses, 0)),
        unreached=check(scene, maps, KINDS[0]),
        limits=check(scene, maps, KINDS[1]),
        control=check(scene, maps, (Reason.FEASIBLE,)),
        content=content,
    )


def _enough(maker: MapMaker, first: FeasibilityMap) -> list[FeasibilityMap]:
    """Return maps with enough cells to check, if `MAPS` have them: the first, then at other poses."""
    arm, grid = maker.scene.arm(first.arm), maker.scene.manifold
    T_tool_object = inverse(arm.hand.tool_poses(grid, np.eye(4))[0, grid.heights // 2, 0])
    maps, rng = [first], np.random.default_rng(0)
    while len(maps) < MAPS and any(len(_cells(maps, kind)) < CHECKED for kind in KINDS):
        T = arm.world_tool_pose(rng.uniform(-np.pi, np.pi, arm.dof)) @ T_tool_object
        maps.append(maker.map(task=Task("other", (arm.name,), T)))
    return maps


def _cells(maps: Sequence[FeasibilityMap], reasons: Sequence[Reason]) -> np.ndarray:
    """Return the cells (k, 4) that have one of some reasons: map, roll, row and column."""
    return np.argwhere(np.isin([each.reason for each in maps], reasons))


def check(scene: Scene, maps: Sequence[FeasibilityMap], reasons: Sequence[Reason]) -> Check:
    """Try to reach random cells that have one of some reasons, with a search that knows no closed form.

    Args:
        scene: the scene.
        maps: maps of its first arm.
        reasons: of the cells.
    """
    arm, rng = scene.arm(), np.random.default_rng(0)
    samples = scene.settings.samples
    solvers = GridSolvers(arm, scene.manifold, lambda own: solver_for(own, samples))
    cells = rng.permutation(_cells(maps, reasons))[:CHECKED]
    found = []
    for which, *cell in cells.tolist():
        the_map = maps[which]
        tools = arm.hand.tool_poses(scene.manifold, the_map.T_world_object)
        T = inverse(arm.robot.T_world_base) @ tools[tuple(cell)]
        solver = solvers.at(cell[1], cell[0])
        q = reach(solver.arm, T, rng)
        if q is not None:
            ik = sampled_solver(solver)
            at = ik if ik.locked is None else ik.at(q[[ik.locked]])
            # A value that would be left out as a sample is one between samples.
            missed = at.everywhere and not at.solve(T).inside.any()
            pose = tuple(map(tuple, the_map.T_world_object.tolist()))
            label = Reason(the_map.reason[tuple(cell)]).label
            found.append(Refuted(pose, tuple(cell), label, tuple(q.tolist()), missed))
    wrong = tuple(found) if Reason.FEASIBLE not in reasons else ()
    return Check(len(cells), len(found), sum(each.missed for each in found), wrong)
