"""The exact engine: the maps of Algorithm 1, two orders of magnitude faster.

Certificates (see `symgrasp.engine.checks`) decide all but a few candidates; those go to PyBullet,
through the very functions of the reference. So a cell is feasible here exactly when it is there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from symgrasp.collision.boxes import boxes_of
from symgrasp.collision.pieces import pose_rows
from symgrasp.engine import search
from symgrasp.engine.balance import loaded
from symgrasp.engine.clearance_bound import clearance_bound
from symgrasp.engine.geometry import ArmGeometry, arm_geometry, supports
from symgrasp.engine.kinematics import Scratch, copied, new_scratch
from symgrasp.engine.redundancy.cover import FINEST
from symgrasp.engine.search_types import RowChecks
from symgrasp.engine.threads import core_count
from symgrasp.errors import InputError
from symgrasp.feasibility.cell import CLEARANCE_LIMIT, Window
from symgrasp.feasibility.creation.map_draft import MapDraft
from symgrasp.feasibility.creation.torso_maps import merged
from symgrasp.feasibility.exact.batches import Batch, batches, compiled_parts
from symgrasp.feasibility.exact.certified import LEVELS, CellProver
from symgrasp.feasibility.exact.open_candidates import OpenCandidates
from symgrasp.feasibility.exact.recording import record_cover, record_search
from symgrasp.feasibility.exact.redundancy_search import RedundancySearch
from symgrasp.feasibility.exact.scene_bodies import FixedBodies, PieceBodies, SceneBodies
from symgrasp.feasibility.fit import fit
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import GridSolvers, solver_for
from symgrasp.ik.at_phi import Locked, locked_joint
from symgrasp.ik.retreat import retreat_distances, retreat_turns
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array, axis_frame, inverse
from symgrasp.progress import TELL, Progress, at_start, between, part_of, portions
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import load_of_hand
from symgrasp.scene.parts import Task
from symgrasp.world import BulletWorld

__all__ = ["ExactEngine"]

PARTS = 4
"""Parts of a search for each thread, so that none waits long for the last."""

WORTH_A_PART = 256
"""Candidates, at one branch, that take longer than a thread takes to start."""

FIRST_COVERED = 16
"""Cells of which all of the redundancy is searched before progress is told for the first time."""


class SampledCells(NamedTuple):
    """Cells of which samples of the redundancy were searched.

    Attributes:
        where: rolls, rows and columns of all of them, (m,) each.
        left: (k,) indices of those of which nothing was found free or proven.
        batch, inputs, rows: the search of samples, and what it found out about its rows.
        locked: the joint that is the redundancy.
    """

    where: tuple[np.ndarray, ...]
    left: np.ndarray
    batch: Batch
    inputs: search.SearchInput
    rows: RowChecks
    locked: Locked


class ExactEngine:
    """Computes the maps of one arm in one scene, for any pose of the object.

    Pieces, their tree and the robot's geometry are built once.

    Args:
        world: a world of the scene's robots, obstacles and object.
        arm: the arm.
        manifold: the grid; maps may be asked for others with the same heights.
        levels: see `CellProver`.
        progress: called with 0 while it is built; may raise `Cancelled`.

    Raises:
        UrdfError: no inverse kinematics is known for the arm.
        NotImplementedError: the arm is not of the kinds the engine knows; see `knows`.
    """

    def __init__(
        self,
        world: BulletWorld,
        arm: Arm,
        manifold: Manifold,
        levels: int = LEVELS,
        progress: Progress | None = None,
    ) -> None:
        self.world, self.arm, self.manifold, self._levels = world, arm, manifold, levels
        self._settings = world.scene.settings
        tell = at_start(progress) or (lambda _: None)
        self._solvers = self._new_solvers(manifold)
        if compiled_parts(self._solvers.at(0, 0)) is None or not supports(arm):
            raise NotImplementedError(f"arm {arm.name}: not of a kind that the exact engine knows")
        radii = manifold.profile.radius(manifold.h)
        self._opening = np.array([arm.hand.opening(float(r)) for r in radii])
        tell(0.0)
        self._misfit: list[Reason | None] = []
        for h in manifold.h:
            self._misfit.append(fit(arm.hand, manifold.profile, float(h)))
            tell(0.0)  # margins are tried on grids of hundreds of rows
        self._T_world_base = np.ascontiguousarray(arm.robot.T_world_base)
        world.set_arms([(arm, arm.home, float(self._opening[0]))])
        tell(0.0)
        self._geometry: ArmGeometry = arm_geometry(world, arm, self._opening, tell)
        tell(0.0)
        self._scratch = new_scratch(self._geometry.pose, self._geometry.pieces.size, arm.dof)
        self._copies: list[Scratch] = []
        self._prover: CellProver | None = None
        self._bodies = SceneBodies(world, arm, self._geometry)
        tell(0.0)
        geometry, limits = self._geometry, np.array([arm.lower, arm.upper])
        self._most = CLEARANCE_LIMIT
        if not arm.pitched:  # whose hand has other poses in every row
            self._most = clearance_bound(
                geometry.moving, geometry.pieces, geometry.pose, limits, self._most, tell
            )
        self._balance = self._geometry.balance
        self._open = OpenCandidates(world, arm, geometry, self._scratch, self._opening)
        self._redundancy = RedundancySearch(arm, geometry, self._open)

    @staticmethod
    def knows(arm: Arm) -> bool:
        """Whether the engine can compute the maps of an arm; others are left to Algorithm 1.

        Raises:
            UrdfError: the arm has no closed-form inverse kinematics.
        """
        return compiled_parts(solver_for(arm, 1)) is not None and supports(arm)

    @property
    def _searches_all(self) -> bool:
        """Whether all of the redundancy is searched after its samples."""
        if self._settings.redundancy != "auto" or self.arm.pitched:
            return False
        return any(locked_joint(own) is not None for own, _ in compiled_parts(self._solvers.at(0, 0)) or ())

    def _new_solvers(self, grid: Manifold, pitch: float | None = None) -> GridSolvers:
        arm = self.arm if pitch is None else self.arm.at_pitch(pitch)
        return GridSolvers(arm, grid, lambda own: solver_for(own, self._settings.samples))

    def map(
        self,
        task: Task,
        manifold: Manifold | None = None,
        progress: Progress | None = None,
        pitch: float | None = None,
        certify: bool = False,
        only: np.ndarray | None = None,
        sampled: Callable[[FeasibilityMap], None] | None = None,
    ) -> FeasibilityMap:
        """Compute the map of a task.

        Args:
            task: the task; it need not be one of the scene's.
            manifold: another grid than the engine's, with the same heights.
            progress: called with the finished share; may raise `Cancelled`.
            pitch: pitch (rad) at which a pitched arm holds its hand; free if None.
            certify: whether to prove which cells hold as a whole.
            only: (R, H, A) which cells to search; of the others nothing is known then.
            sampled: called with the map that samples of the redundancy show, if all of it is to be searched.

        Raises:
            ValueError: the grid has other heights.
        """
        grid = manifold or self.manifold
        T_base_tool = self._begin(task, grid, pitch)
        drafts = []
        parts = 2 if self.arm.pitched else 1
        steps = parts + int(certify)
        for part in range(parts):
            draft = MapDraft(self.arm, grid, self._opening, self._solvers.at(0, 0))
            draft.resolution = FINEST if self._searches_all else 0.0
            for row, misfit in enumerate(self._misfit):
                if misfit is not None:
                    draft.reason[:, row], draft.proven[:, row] = misfit, True
            tell = part_of(progress, part, steps)
            halves = 2 if self._searches_all else 1
            left = self._search_samples(draft, part, T_base_tool, part_of(tell, 0, halves), only)
            if left and sampled:
                sampled(draft.finish(self.world.scene.name, task))
            self._search_all(draft, left, part_of(tell, 1, 2))
            drafts.append(draft.finish(self.world.scene.name, task))
        found = merged(drafts) if len(drafts) > 1 else drafts[0]
        if certify:
            proven = self._certified(found, task, only, part_of(progress, parts, steps))
            found = replace(found, certified=proven)
        self.world.set_arms(())
        return found

    def _begin(self, task: Task, grid: Manifold, pitch: float | None = None) -> Array:
        """Put the object where a task has it, and return the tool poses (R, H, A, 4, 4) in the robot's base.

        Raises:
            ValueError: the grid has other heights.
        """
        if not np.array_equal(grid.h, self.manifold.h):
            raise ValueError("the exact engine was built for a grid with other heights")
        self._place_object(task.T_world_object)
        self._open.holders = task.arms
        if len(self._balance.edges):  # else it stands, whatever it bears
            scene, T = self.world.scene, task.T_world_object
            loads = [load_of_hand(scene, self.arm, task.arms, T, float(h)) for h in grid.h]
            self._balance = loaded(self._geometry.balance, loads)
        known = self._solvers.manifold.angles == grid.angles and self._solvers.arm.pitch == pitch
        if not known:
            self._solvers = self._new_solvers(grid, pitch)
        return inverse(self.arm.robot.T_world_base) @ self.arm.hand.tool_poses(grid, task.T_world_object)

    def _certified(
        self, found: FeasibilityMap, task: Task, only: np.ndarray | None, progress: Progress | None
    ) -> np.ndarray:
        """Return which cells (R, H, A) of a map that was just computed hold as a whole, of some or all."""
        if self._bodies.fixed(self._most).collision is not None:
            return np.ones(found.reason.shape, dtype=bool)  # bodies collide whatever the arm does
        if self._prover is None:
            scene, ik = self.world.scene, self._solvers.at(0, 0)
            self._prover = CellProver(scene, self.arm, ik, self._geometry, self.manifold, self._levels)
        return self._prover.certified(found, task, self._scratches(), only, progress)

    def _place_object(self, T_world_object: Array) -> None:
        """Put the object at a pose (4, 4) in both worlds, PyBullet's and the engine's; the arm at home."""
        self.world.margin = self._settings.margin
        self.world.set_arms([(self.arm, self.arm.home, float(self._opening[0]))])
        self.world.set_object(T_world_object)
        geometry, scratch = self._geometry, self._scratch
        objects = geometry.moving.objects
        scratch.pose[objects] = pose_rows(axis_frame(T_world_object))
        scratch.box[objects] = boxes_of(geometry.pieces.size[objects], scratch.pose[objects])

    def _scratches(self) -> list[Scratch]:
        """Return scratch for each thread: copied once, because of the static pieces, of which many may be."""
        while len(self._copies) < core_count():
            self._copies.append(copied(self._scratch))
        objects = self._geometry.moving.objects
        for copy in self._copies:
            copy.pose[objects], copy.box[objects] = self._scratch.pose[objects], self._scratch.box[objects]
        return self._copies[: core_count()]

    def _search_samples(
        self,
        draft: MapDraft,
        part: int,
        T_base_tool: Array,
        progress: Progress | None,
        only: np.ndarray | None,
    ) -> list[SampledCells]:
        """Fill the rows at which the hand fits, some at a time so that progress is told often enough.

        Args:
            draft: the map.
            part: which of the solvers of a pitched arm is used, see `PitchedIK.parts`; 0 for other arms.
            T_base_tool: (R, H, A, 4, 4) tool poses of all cells.
            progress: called with the finished share; may raise `Cancelled`.
            only: (R, H, A) which cells to search, or all.

        Returns:
            The cells of which all of the redundancy is to be searched.
        """
        fixed, bodies = self._bodies.fixed(self._most), self._bodies.pieces_of(draft)
        wanted = np.array([misfit is None for misfit in self._misfit])
        rows = np.flatnonzero(wanted if only is None else wanted & only.any(axis=(0, 2)))
        searched: list[SampledCells] = []
        for these in portions(len(rows), progress):
            for batch in batches(self._solvers, self._geometry, rows[these], part):
                steps = self._search(draft, bodies, batch, T_base_tool, fixed, only, searched)
                _tell_again(steps, progress, these.start / len(rows))
        return [cells for cells in searched if len(cells.left)]

    def _search_all(
        self, draft: MapDraft, sampled: Sequence[SampledCells], progress: Progress | None
    ) -> None:
        """Search all of the redundancy for the cells that are left, some at a time."""
        for k, cells in enumerate(sampled):
            tell = part_of(progress, k, len(sampled))
            for these in portions(len(cells.left), tell, FIRST_COVERED):
                some = cells.left[these]
                inputs, batch, where = cells.inputs, cells.batch, tuple(part[some] for part in cells.where)
                covered = self._redundancy.cover(
                    cells.rows, some, cells.locked, inputs, batch, self._scratches()
                )
                record_cover(draft, covered, where)
                steps = self._redundancy.decide(draft, covered, inputs.T_base_tool[some], batch, where)
                _tell_again(steps, tell, these.start / len(cells.left))

    def _search(
        self,
        draft: MapDraft,
        bodies: PieceBodies,
        batch: Batch,
        T_base_tool: Array,
        fixed: FixedBodies,
        only: np.ndarray | None,
        searched: list[SampledCells],
    ) -> Iterator[None]:
        """Search some cells of the map at samples; pause after every one that PyBullet decided.

        In the end, those of which all of the redundancy is to be searched are added to a list.
        """
        rows, rolls = batch.rows, batch.rolls
        roll, row, column = np.indices((len(rolls), len(rows), draft.manifold.angles)).reshape(3, -1)
        cells, runs = (rolls[roll], rows[row], column), np.tile(rows, len(rolls))
        if only is not None:
            cells = tuple(part[only[cells]] for part in cells)
            runs = cells[1]  # each cell for itself
            if not len(runs):
                return
        inputs = self._inputs(np.ascontiguousarray(T_base_tool[cells]), runs, batch, fixed)
        locked = locked_joint(batch.compiled) if self._searches_all else None
        if locked is not None:
            beyond = self._redundancy.out_of_reach(batch, locked, inputs.T_base_tool)
            inputs = inputs._replace(beyond=beyond)
        found = search.search(
            batch.compiled.chain,
            batch.moving,
            self._geometry.pieces,
            self._geometry.tree,
            self._scratches(),
            inputs,
            self._balance,
            self.arm.dof,
        )
        found.solution[:, 0] = batch.samples[found.solution[:, 0]]  # of cells without one it is not used
        record_search(draft, bodies, found, cells, fixed)
        left = found.status != search.FEASIBLE
        for i in np.flatnonzero(left & (found.undecided_count > 0)):
            cell = tuple(int(part[i]) for part in cells)
            T = inputs.T_base_tool[i]
            listed = self._undecided(found, int(i), T, batch)
            by_tool = self._open.decide(draft, cell, T, batch.ik, listed)
            left[i] = not by_tool and draft.reason[cell] != Reason.FEASIBLE
            yield
        if inputs.always_collides:
            draft.proven[cells] = True
            return
        if locked is None:
            return
        draft.proven[tuple(part[found.proven] for part in cells)] = True
        which = np.flatnonzero(left & ~found.proven)
        searched.append(SampledCells(cells, which, batch, inputs, found.rows, locked))

    def _inputs(
        self, T_base_tool: Array, runs: np.ndarray, batch: Batch, fixed: FixedBodies
    ) -> search.SearchInput:
        """Return what the compiled search is told of cells: tool poses (m, 4, 4), in runs of rows (r,)."""
        tries = len(T_base_tool) * len(batch.order)
        return search.SearchInput(
            sample_order=batch.order,
            T_world_base=self._T_world_base,
            T_base_tool=T_base_tool,
            row=runs,
            retreat=-retreat_distances(self._settings.approach),
            turns=retreat_turns(self.arm.velocity, self._settings.approach),
            margin=float(self._settings.margin),
            clearance=fixed.gap,
            always_collides=fixed.collision is not None,
            beyond=np.zeros(len(T_base_tool), dtype=bool),
            parts=min(PARTS * core_count(), 1 + tries // WORTH_A_PART),
        )

    def windows(
        self,
        task: Task,
        cells: np.ndarray,
        manifold: Manifold,
        witnesses: Sequence[tuple[int, float] | None],
        progress: Progress | None = None,
        *,
        settle: bool = True,
    ) -> list[tuple[Window, ...]]:
        """Find the windows of cells, see `symgrasp.engine.redundancy.windows`.

        Args:
            task: the task; it need not be one of the scene's.
            cells: (c, 3) the cells.
            manifold: the grid, with the engine's heights.
            witnesses: branch and φ (rad) of the witness of each cell, None of cells without.
            progress: called with the finished share; may raise `Cancelled`.
            settle: whether PyBullet decides what pieces that all but touch leave open, at the ends of
                windows; else only where nothing else is free.

        Returns:
            The windows of each cell, by branch, then by φ.

        Raises:
            InputError: the arm has no redundancy, or none that is known at any value.
        """
        T_base_tool = self._begin(task, manifold)
        batch = next(batches(self._solvers, self._geometry, np.arange(manifold.heights), 0))
        locked = locked_joint(batch.compiled)
        if locked is None:
            expected = "one of seven joints, whose redundancy is known at any value"
            raise InputError("windows", "arm", self.arm.name, expected)
        fixed = self._bodies.fixed(self._most)
        found: list[tuple[Window, ...]] = [()] * len(cells)
        fits = np.array([self._misfit[row] is None for row in cells[:, 1]], dtype=bool)
        which = np.flatnonzero(fits & (fixed.collision is None))
        for these in portions(len(which), progress):
            some = cells[which[these]]
            tools = np.ascontiguousarray(T_base_tool[tuple(some.T)])
            inputs = self._inputs(tools, some[:, 1].copy(), batch, fixed)
            inputs = inputs._replace(parts=min(len(some), PARTS * core_count()))
            tell = between(progress, these.start / len(which), these.stop / len(which))
            own = self._redundancy.windows(
                inputs, batch, locked, self._scratches(), [witnesses[c] for c in which[these]],
                settle=settle, progress=tell,
            )  # fmt: skip
            for cell, listed in zip(which[these].tolist(), own, strict=True):
                found[cell] = listed
        self.world.set_arms(())
        return found

    def _undecided(
        self, found: search.SearchResult, i: int, T_base_tool: Array, batch: Batch
    ) -> list[tuple[Array, int, int]]:
        """Return the undecided candidates of an open cell, or all inside the limits where they are many."""
        count = int(found.undecided_count[i])
        if count <= search.UNDECIDED_KEPT:
            sample, branch = found.undecided_solution[i].T
            sample = batch.samples[sample[:count]]
            return [(found.undecided_q[i, j], int(sample[j]), int(branch[j])) for j in range(count)]
        s = batch.ik.solve(T_base_tool)
        return [(s.q[k], int(s.sample[k]), int(s.branch[k])) for k in np.flatnonzero(s.inside)]


def _tell_again(steps: Iterator[None], progress: Progress | None, share: float) -> None:
    """Take steps of which no share is known, and tell the finished one again: there one may cancel, too."""
    told = perf_counter()
    for _ in steps:
        if progress and perf_counter() - told > TELL:
            progress(share)
            told = perf_counter()
