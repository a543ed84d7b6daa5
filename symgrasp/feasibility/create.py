"""Compute the feasibility maps of a scene, by the exact engine or Algorithm 1, and explain their cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np

from symgrasp.errors import InputError
from symgrasp.feasibility.cell import Cell, Window
from symgrasp.feasibility.creation.algorithm1 import create_map_reference
from symgrasp.feasibility.creation.pitch_maps import at_pitches
from symgrasp.feasibility.creation.splitting import refined
from symgrasp.feasibility.creation.torso_maps import at_torso, merged, torso_sample
from symgrasp.feasibility.exact.certified import LEVELS
from symgrasp.feasibility.exact.engine import ExactEngine
from symgrasp.feasibility.explain import Explanation, explain_cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import Solver, solver_for
from symgrasp.object.manifold import ROLLS, Manifold, wrap
from symgrasp.progress import Progress, part_of
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world

__all__ = ["MapMaker", "Method", "create_map", "explain"]

Method = Literal["exact", "reference"]
"""How a map is computed: both give the same feasible cells."""


class MapMaker:
    """Computes maps of one scene, and keeps what depends on its arms, obstacles and grid alone.

    A map for another pose of the object rebuilds nothing of that.

    Args:
        world: a world of the scene. Its arms, its settings and its default task are those of the maps.

    Attributes:
        world: that world.
        scene: the world's scene.
    """

    def __init__(self, world: BulletWorld) -> None:
        self.world, self.scene = world, world.scene
        self._engines: dict[tuple[str, int | None, int, int], ExactEngine | None] = {}
        self._solvers: dict[str, Solver] = {}

    def map(
        self,
        arm: str | None = None,
        task: Task | str | None = None,
        *,
        method: Method = "exact",
        manifold: Manifold | None = None,
        progress: Progress | None = None,
        certify: bool | None = None,
        only: np.ndarray | None = None,
        sampled: Callable[[FeasibilityMap], None] | None = None,
    ) -> FeasibilityMap:
        """Compute a map; see `create_map`. The task need not be one of the scene's.

        Of some cells alone if ``only`` (R, H, A) is given: the others are then neither feasible nor proven,
        unless Algorithm 1 computes the map, which does all. Where all of an arm's redundancy is searched, and
        it is on no torso, ``sampled`` is called with the map that samples show: what is feasible on it is so.
        """
        the_arm, the_task = self._chosen(arm, task)
        grid = manifold or self.scene.manifold
        if method == "reference":
            return create_map_reference(self.world, the_arm, the_task, grid, progress)
        if the_arm.robot.torso is not None:
            maps = self.maps_by_torso(
                the_arm.name, the_task, manifold=grid, progress=progress, certify=certify, only=only
            )
            return merged(maps)
        return self._map(the_arm, None, the_task, grid, progress, certify=certify, only=only, sampled=sampled)

    def maps_by_torso(
        self,
        arm: str,
        task: Task | str,
        *,
        manifold: Manifold | None = None,
        progress: Progress | None = None,
        certify: bool | None = None,
        only: np.ndarray | None = None,
    ) -> list[FeasibilityMap]:
        """Compute the map of an arm for every sample of its robot's torso; see `map` for the arguments."""
        the_arm, the_task = self._chosen(arm, task)
        grid = manifold or self.scene.manifold
        assert the_arm.robot.torso is not None
        maps = []
        for t in range(len(the_arm.robot.torso)):
            tell = part_of(progress, t, len(the_arm.robot.torso))
            own = self._map(the_arm.at(t), t, the_task, grid, tell, certify=certify, only=only)
            maps.append(at_torso(own, the_arm, t, self._samples(the_arm)))
        return maps

    def maps_at_pitches(
        self,
        arm: str,
        task: Task | str,
        pitches: Sequence[float],
        *,
        manifold: Manifold | None = None,
        progress: Progress | None = None,
    ) -> FeasibilityMap:
        """Compute the map of a pitched arm with its hand held at some pitches (rad); see `map`.

        It is for planners, so nothing is certified.
        """
        the_arm, the_task = self._chosen(arm, task)
        grid = manifold or self.scene.manifold
        maps = []
        for k, pitch in enumerate(pitches):
            tell = part_of(progress, k, len(pitches))
            maps.append(self._map(the_arm, None, the_task, grid, tell, pitch, certify=False))
        return at_pitches(maps, pitches)

    def _map(
        self,
        arm: Arm,
        torso: int | None,
        task: Task,
        grid: Manifold,
        progress: Progress | None,
        pitch: float | None = None,
        certify: bool | None = None,
        only: np.ndarray | None = None,
        sampled: Callable[[FeasibilityMap], None] | None = None,
    ) -> FeasibilityMap:
        """Compute the map of an arm without a torso, or with its torso at a sample."""
        if progress:
            progress(0.0)  # before and after the pieces of the world are packed: that takes its time
        engine = self._engine(arm, torso, grid, progress=progress)
        if progress:
            progress(0.0)
        if engine is None:
            own = arm if pitch is None else arm.at_pitch(pitch)
            return create_map_reference(self.world, own, task, grid, progress)
        settings = self.scene.settings
        if certify is None:
            certify = settings.resolution is not None
        # Else no feasible cell is proven, see `CellProver`, and no margin could be.
        splits = certify and not arm.pitched and not settings.approach
        finer = settings.finer(grid) if splits else []
        tell = part_of(progress, 0, 1 + len(finer))
        found = engine.map(task, grid, tell, pitch, certify, only, sampled)
        if not splits:
            return found

        def map_on(parts: Manifold, wanted: np.ndarray) -> FeasibilityMap:
            level = 1 + finer.index(parts)
            tell = part_of(progress, level, 1 + len(finer))
            own = self._engine(arm, torso, parts, max(1, LEVELS - level), tell)
            assert own is not None  # as there is one for the map
            return own.map(task, parts, tell, None, True, wanted)

        return replace(found, refined=refined(found, finer, map_on, only))

    def explain(
        self,
        arm: str | None,
        task: Task | str | None,
        cell: Cell | tuple[int, int, int],
        *,
        manifold: Manifold | None = None,
        progress: Progress | None = None,
    ) -> Explanation:
        """Check every candidate of a cell; see `symgrasp.feasibility.explain.explain_cell`.

        Args:
            arm: name of the arm; the task's first if None.
            task: the task or its name; the scene's first if None. It need not be one of the scene's.
            cell: (roll, row, column).
            manifold: another grid than the scene's.
            progress: called with the finished share; may raise `Cancelled`.
        """
        the_arm, the_task = self._chosen(arm, task)
        grid, where = manifold or self.scene.manifold, Cell(*cell)
        ik = self._solvers.get(the_arm.name)
        if ik is None or the_arm.pitched:
            own = the_arm.grasping(grid, where.row, where.roll)
            self._solvers[the_arm.name] = ik = solver_for(own, self.scene.settings.samples)
        tell, rests_on = progress, None
        if self.scene.settings.redundancy == "auto":
            first, tell = part_of(progress, 0, 2), part_of(progress, 1, 2)
            only = np.zeros((len(ROLLS), grid.heights, grid.angles), dtype=bool)
            only[where] = True
            found = self.map(the_arm.name, the_task, manifold=grid, progress=first, certify=False, only=only)
            witness = found.witness(where)
            if witness is not None and not the_arm.pitched:
                ik = solver_for(the_arm, self.scene.settings.samples, more=[witness.phi])
            rests_on = found.rests_on(where)
        explanation = explain_cell(self.world, ik, the_task, grid, where, tell)
        return explanation if rests_on is None else replace(explanation, rests_on=rests_on)

    def windows(
        self, m: FeasibilityMap, cells: np.ndarray, progress: Progress | None = None, *, settle: bool = True
    ) -> list[tuple[Window, ...]]:
        """Find the windows of cells of a map, see `FeasibilityMap.windows`; of arms on a torso, those at the
        value of the torso at which the cell's witness is, none of infeasible cells.

        Args:
            m: the map, of the maker's scene.
            cells: (c, 3) the cells.
            progress: called with the finished share; may raise `Cancelled`.
            settle: whether windows end where PyBullet says; else up to half a millimetre before a collision.

        Raises:
            InputError: the arm has no redundancy, or none that is known at any value.
        """
        arm, known = self.scene.arm(m.arm), self.scene.tasks.get(m.task)
        holders = (m.arm,) if known is None else known.arms
        task = Task(m.task, holders, m.T_world_object)
        cells = np.asarray(cells, dtype=np.int64).reshape(-1, 3)
        torso, at = arm.robot.torso, np.zeros(len(cells), dtype=int)
        if torso is not None:
            at = np.array([torso_sample(m, torso, cell) for cell in map(tuple, cells)], dtype=int)
        witnesses = [w and (w.branch, w.phi) for w in (m.witness(Cell(*cell)) for cell in cells.tolist())]
        found: list[tuple[Window, ...]] = [()] * len(cells)
        values = [t for t in np.unique(at).tolist() if t >= 0]
        for k, t in enumerate(values):
            own = arm if torso is None else arm.at(t)
            where = None if torso is None else t
            engine = None if arm.pitched else self._engine(own, where, m.manifold, progress=progress)
            if engine is None:
                raise InputError(
                    "windows", "arm", arm.name, "one of seven joints that the exact engine knows"
                )
            these = np.flatnonzero(at == t)
            step = part_of(progress, k, len(values))
            own_witnesses = [witnesses[c] for c in these]
            listed = engine.windows(task, cells[these], m.manifold, own_witnesses, step, settle=settle)
            for c, windows in zip(these, listed, strict=True):
                found[int(c)] = windows
        return found

    def with_windows(self, m: FeasibilityMap, progress: Progress | None = None) -> FeasibilityMap:
        """Return a map that knows how wide the widest window of each feasible cell is.

        Arguments and errors are those of `windows`; widths end up to half a millimetre before a collision.
        """
        cells = np.argwhere(m.feasible)
        found = self.windows(m, cells, progress, settle=False)
        widest = np.full(m.reason.shape, np.nan)
        widest[m.feasible] = [max((w.width for w in own), default=0.0) for own in found]
        return replace(m, widest=widest)

    def _samples(self, arm: Arm) -> int:
        """Return the number of redundancy samples of an arm alone."""
        alone = arm.at(0)
        return {5: 1 + self.scene.settings.samples, 6: 1}.get(
            len(alone.joint_names), self.scene.settings.samples
        )

    def _chosen(self, arm: str | None, task: Task | str | None) -> tuple[Arm, Task]:
        """Return an arm and a task: the scene's first task, and the task's first arm, where none is named."""
        chosen = task if isinstance(task, Task) else self.scene.task(task)
        return self.scene.arm(arm or chosen.arms[0]), chosen

    def _engine(
        self,
        arm: Arm,
        torso: int | None,
        grid: Manifold,
        levels: int = LEVELS,
        progress: Progress | None = None,
    ) -> ExactEngine | None:
        """Return an arm's engine for a grid's heights, or None where the engine does not know the arm.

        Its certificates cut cells so often in two, see `CellProver`.
        """
        key = arm.name, torso, grid.heights, levels
        known = self._engines.get(key)
        if known and not np.array_equal(known.manifold.h, grid.h):
            known = None
        if known is None:
            with suppress(NotImplementedError):
                known = ExactEngine(self.world, arm, grid, levels, progress)
        self._engines[key] = known
        return known


def create_map(
    scene: Scene,
    *,
    task: str | None = None,
    arm: str | None = None,
    method: Method = "exact",
    manifold: Manifold | None = None,
    progress: Progress | None = None,
    certify: bool | None = None,
) -> FeasibilityMap:
    """Compute the feasibility map of a task and an arm.

    For several maps of one scene, `MapMaker` keeps the world and the engines between them.

    Args:
        scene: the scene.
        task: name of the task; the scene's first if None.
        arm: name of the arm; the task's first if None.
        method: ``exact`` is the fast engine, for arms whose closed form it knows; ``reference`` is
            Algorithm 1 of the paper, and what ``exact`` does for other arms. The feasible cells are
            the same, and so are the reasons up to JOINT_LIMITS; the engine's witnesses have the
            largest clearance that it found, the reference's are the first. Where the scene's
            redundancy is ``auto``, ``exact`` searches all of it, and ``reference`` tries
            `AUTO_SAMPLES` samples.
        manifold: another grid than the scene's.
        progress: called with the finished share; may raise `Cancelled`.
        certify: whether to prove which cells hold as a whole, see `FeasibilityMap.certified`; if None, where
            the scene asks for a resolution, to which cells are then split too, and margins are proven.
            Algorithm 1 proves none; nor are feasible cells of arms with five joints or with a retreat.

    Raises:
        SceneError: there is no such arm or task.
        UrdfError: the arm has no closed-form inverse kinematics.
    """
    with open_world(scene, progress) as world:
        maker = MapMaker(world)
        found = maker.map(arm, task, method=method, manifold=manifold, progress=progress, certify=certify)
    return replace(found, shown_in=scene, find_windows=_windows_of)


def _windows_of(m: FeasibilityMap, cell: Cell) -> tuple[Window, ...]:
    """Return the windows of a cell of a map that knows its scene."""
    assert m.shown_in is not None
    with open_world(m.shown_in) as world:
        return MapMaker(world).windows(m, np.array([cell]))[0]


def explain(
    scene: Scene,
    h: float,
    theta: float,
    roll: float = 0.0,
    task: str | None = None,
    arm: str | None = None,
    progress: Progress | None = None,
) -> Explanation:
    """Explain whether a grasp is feasible, and if not, why: every candidate configuration is checked.

    The grasp is that of the cell of the map in which it lies, at the cell's centre.

    Args:
        scene: the scene.
        h: height (m) along the object's axis.
        theta: angle (rad) around it, in the object's frame.
        roll: turn (rad) of the hand about its approach: 0 or π.
        task: name of the task; the scene's first if None.
        arm: name of the arm; the task's first if None.
        progress: called with the finished share; may raise `Cancelled`.

    Returns:
        The candidates, best first, and the reason that the map has for the cell. Printed, it is a
        line for each candidate.

    Raises:
        SceneError: there is no such arm or task.
        InputError: the height is not on the object, or the roll is neither 0 nor π.
        UrdfError: the arm has no closed-form inverse kinematics.
    """
    if not math.isfinite(theta):
        raise InputError("explain", "theta (rad)", theta, "a number")
    row, column = scene.manifold.cell(h, theta)
    cell = Cell(_roll_index(roll), row, column)
    with open_world(scene, progress) as world:
        return MapMaker(world).explain(arm, task, cell, progress=progress)


def _roll_index(roll: float) -> int:
    """Return the index of a roll (rad) on maps.

    Raises:
        InputError: it is neither 0 nor π, whole turns aside.
    """
    apart = [abs(float(wrap(roll - known))) for known in ROLLS]
    if not min(apart) < 1e-6:  # NaN is not, either
        raise InputError("explain", "roll (rad)", roll, "0 or π")
    return apart.index(min(apart))
