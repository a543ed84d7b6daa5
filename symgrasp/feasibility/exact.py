"""The exact engine: the maps of Algorithm 1, two orders of magnitude faster.

Certificates (see `symgrasp.engine.checks`) decide all but a few candidates; those go to PyBullet,
through the very functions of the reference. So a cell is feasible here exactly when it is there.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from time import perf_counter
from typing import NamedTuple

import numba
import numpy as np

from symgrasp.engine import search
from symgrasp.engine.boxes import box_of
from symgrasp.engine.broad_phase import mark_near
from symgrasp.engine.checks import FREE_BAND, HIT_BAND
from symgrasp.engine.geometry import ArmGeometry, arm_geometry, supports
from symgrasp.engine.kinematics import new_scratch, place_arm, place_hand
from symgrasp.engine.pieces import pose_rows
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import CLEARANCE_LIMIT
from symgrasp.feasibility.fit import fit
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import SphericalIK, solver_for
from symgrasp.ik.retreat import retreat_distances
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.poses import Array, axis_frame, inverse
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, BulletWorld, Collision, NearBodies

__all__ = ["ExactEngine"]

PARTS = 4
"""Parts of a search for each thread, so that none waits long for the last."""

TELL = 0.05
"""Time (s) after which progress is told, and may cancel: rows are searched in bites of about that long."""

_ALL_CORES = threading.Lock()
"""Of numba's thread pools, one does not bear two parallel searches at once, and none is faster for it."""


class _StaticBodies(NamedTuple):
    """What is so whatever the arm does.

    Attributes:
        gap: distance (m) of the bodies that it does not move at least, at most `CLEARANCE_LIMIT`.
        blocked: a collision of them, which spoils every candidate.
    """

    gap: float
    blocked: Collision | None


class ExactEngine:
    """Computes the maps of one arm in one scene, for any pose of the object.

    What belongs to the scene (pieces, their tree, the robot's geometry) is built once.

    Args:
        world: a world of the scene's robots, obstacles and object.
        scene: the scene, for its settings.
        arm: the arm.
        manifold: the grid; maps may be asked for others with the same heights.

    Raises:
        UrdfError: the arm has no closed-form inverse kinematics.
        NotImplementedError: the arm is not of the kinds the engine knows; see `knows`.
    """

    def __init__(self, world: BulletWorld, scene: Scene, arm: Arm, manifold: Manifold) -> None:
        self.world, self.scene, self.arm, self.manifold = world, scene, arm, manifold
        ik = solver_for(arm, scene.settings.redundancy)
        if not isinstance(ik, SphericalIK) or not supports(arm):
            raise NotImplementedError(f"arm {arm.name}: not of a kind that the exact engine knows")
        self.ik = ik
        radii = manifold.profile.radius(manifold.h)
        self._opening = np.array([arm.hand.opening(float(r)) for r in radii])
        self._fit = [fit(arm.hand, manifold.profile, float(h)) for h in manifold.h]
        self._order = _spread(len(ik.phi))
        self._T_world_base = np.ascontiguousarray(arm.robot.T_world_base)
        world.set_arms([(arm, arm.home, float(self._opening[0]))])
        self._geometry: ArmGeometry = arm_geometry(world, arm, self._opening)
        self._scratch = new_scratch(self._geometry.pose, self._geometry.pieces, arm.dof)
        # How far off pairs are of which the arm moves neither; those with the object are asked for every map.
        self._reach = max(CLEARANCE_LIMIT, scene.settings.margin)
        pairs = world.pairs_within(arm, self._reach)
        self._resting = [c for c in pairs if c.reason != Reason.OBJECT_COLLISION and self._rests(c)]

    @staticmethod
    def knows(arm: Arm) -> bool:
        """Whether the engine can compute the maps of an arm; others are left to Algorithm 1.

        Raises:
            UrdfError: the arm has no closed-form inverse kinematics.
        """
        return isinstance(solver_for(arm, 1), SphericalIK) and supports(arm)

    def map(
        self, task: Task, manifold: Manifold | None = None, progress: Progress | None = None
    ) -> FeasibilityMap:
        """Compute the map of a task.

        Args:
            task: the task; it need not be one of the scene's.
            manifold: another grid than the engine's, with the same heights.
            progress: told the finished share; may raise `Cancelled`.

        Raises:
            ValueError: the grid has other heights.
        """
        grid = manifold or self.manifold
        if not np.array_equal(grid.h, self.manifold.h):
            raise ValueError("the exact engine was built for a grid with other heights")
        T_base_tool = inverse(self.arm.robot.T_world_base) @ grid.tool_poses(
            task.T_world_object, self.arm.hand.finger_depth
        )
        world = self.world
        world.margin = self.scene.settings.margin
        world.set_arms([(self.arm, self.arm.home, float(self._opening[0]))])
        world.set_object(task.T_world_object)
        arm_geometry, scratch = self._geometry, self._scratch
        scratch.pose[arm_geometry.moving.objects] = pose_rows(axis_frame(task.T_world_object))
        for k in arm_geometry.moving.objects:
            box_of(arm_geometry.pieces.size, scratch.pose, k, scratch.box[k])
        draft = MapDraft(self, grid)
        still = self._still()
        rows = np.array([row for row, stage in enumerate(self._fit) if stage is None], dtype=np.int64)
        first, bite = 0, 1
        while first < len(rows):
            start = perf_counter()
            part = rows[first : first + bite]
            for _ in self._search(draft, part, T_base_tool, still):
                if progress and perf_counter() - start > TELL:
                    progress(first / len(rows))  # PyBullet takes its time: here one may cancel, too
            first += len(part)
            if progress:
                progress(first / len(rows))
            # Rows differ, so bites grow with care; what is found does not depend on them.
            bite = max(1, min(2 * bite, int(len(part) * TELL / (perf_counter() - start))))
        world.set_arms(())
        if progress and not len(rows):
            progress(1.0)
        return draft.finish(task)

    def _still(self) -> _StaticBodies:
        """Say how far apart the bodies are that the arm does not move: it is the same for all candidates."""
        found = self.world.pairs_within(self.arm, self._reach, (self.scene.file.object.name,))
        gap, blocked = CLEARANCE_LIMIT, None
        for c in [*self._resting, *filter(self._rests, found)]:
            distance = self._reach - c.depth
            gap = min(gap, distance - HIT_BAND)
            depth = self.world.margin_for(c.reason) - distance
            if depth > 0 and (blocked is None or depth > blocked.depth):
                blocked = c._replace(depth=depth)
        return _StaticBodies(max(gap, 0.0), blocked)

    def _rests(self, c: Collision) -> bool:
        """Whether a pair is one of the robot's own bodies of which the arm moves none."""
        name = self.arm.robot.name
        own = [body.link for body in (c.a, c.b) if body.body == name]
        return bool(own) and not self._geometry.moving_links.intersection(own)

    def _search(
        self,
        draft: MapDraft,
        rows: np.ndarray,
        T_base_tool: Array,
        still: _StaticBodies,
    ) -> Iterator[None]:
        """Search some rows of the map; pause after every cell that PyBullet decided."""
        goals = search.SearchInput(
            sample_order=self._order,
            T_world_base=self._T_world_base,
            T_base_tool=np.ascontiguousarray(T_base_tool[:, rows].reshape(-1, 4, 4)),
            row=np.tile(rows, len(ROLLS)),
            retreat=-retreat_distances(self.scene.settings.approach),
            margin=float(self.scene.settings.margin),
            clearance=still.gap,
            always_collides=still.blocked is not None,
            chunks=PARTS * numba.get_num_threads(),
        )
        with _ALL_CORES:
            found = search.search(
                self.ik.chain,
                self._geometry.moving,
                self._geometry.pieces,
                self._geometry.tree,
                self._scratch.pose,
                goals,
                self.arm.dof,
            )
        roll, row, column = np.indices((len(ROLLS), len(rows), draft.grid.angles)).reshape(3, -1)
        cells = (roll, rows[row], column)
        draft.take(found, cells, still.blocked)
        for i in np.flatnonzero((found.status != search.FEASIBLE) & (found.undecided_count > 0)):
            cell = tuple(int(part[i]) for part in cells)
            self._decide(draft, cell, goals.T_base_tool[i], self._listed(found, int(i), goals.T_base_tool[i]))
            yield

    def _listed(self, found: search.SearchResult, i: int, T_base_tool: Array) -> list[tuple[Array, int, int]]:
        """Return the undecided candidates of an open cell, or all inside the limits where they are many."""
        count = int(found.undecided_count[i])
        if count <= search.UNDECIDED_KEPT:
            picks = found.undecided_solution[i]
            return [(found.undecided_q[i, j], int(picks[j, 0]), int(picks[j, 1])) for j in range(count)]
        s = self.ik.solve(T_base_tool)
        return [(s.q[k], int(s.sample[k]), int(s.branch[k])) for k in np.flatnonzero(s.inside)]

    def _decide(
        self, draft: MapDraft, cell: tuple[int, ...], T_base_tool: Array, listed: list[tuple[Array, int, int]]
    ) -> None:
        """Let PyBullet decide the candidates of an open cell, against what their boxes do not rule out."""
        near = lambda q, T: self._near(q, T, cell[1])  # noqa: E731
        checker = CandidateChecker(self.world, self.arm, self.ik, self.scene.settings.approach, near)
        before: Collision | None = None
        for q, sample, branch in listed:
            draft.asked += 1
            fate, collision, *_ = checker.fate(T_base_tool, q, sample, float(self._opening[cell[1]]))
            if fate == Reason.FEASIBLE:
                draft.feasible(cell, q, sample, branch)
                return
            if fate > draft.reason[cell]:
                draft.collides(cell, fate, collision)
            if collision and self._fixed(collision):
                if before and _same(before, collision):
                    return  # and it would be for all others, because the tool pose alone decides it
                before = collision

    def _near(self, q: Array, T_base_tool: Array, row: int) -> NearBodies:
        """Return what is near the arm: all else is certified free."""
        arm_geometry, scratch = self._geometry, self._scratch
        place_hand(arm_geometry.moving, arm_geometry.pieces, scratch, self._T_world_base, T_base_tool, row)
        place_arm(arm_geometry.moving, arm_geometry.pieces, scratch, q)
        near, pairs = (
            np.zeros(len(arm_geometry.names), dtype=bool),
            np.zeros(len(arm_geometry.pairs), dtype=bool),
        )
        mark_near(
            arm_geometry.moving,
            arm_geometry.pieces.size,
            arm_geometry.tree,
            scratch,
            self.world.margin + FREE_BAND,
            near,
            pairs,
        )
        bodies = {arm_geometry.names[k].body for k in np.flatnonzero(near)}
        return bodies | {arm_geometry.pairs[k] for k in np.flatnonzero(pairs)}

    def _fixed(self, collision: Collision) -> bool:
        """Whether a collision is one of bodies that the tool pose alone places."""
        name = self.arm.robot.name
        own = [body.link for body in (collision.a, collision.b) if body.body == name]
        return self._geometry.tool_links.issuperset(
            link for link in own if link in self._geometry.moving_links
        )


def _same(a: Collision, b: Collision) -> bool:
    return (a.a, a.b) == (b.a, b.b) and min(a.depth, b.depth) > 1e-6 and abs(a.depth - b.depth) < 1e-7


class MapDraft:
    """The arrays of a map while it is being computed."""

    def __init__(self, engine: ExactEngine, grid: Manifold) -> None:
        dof, shape = engine.arm.dof, (len(ROLLS), grid.heights, grid.angles)
        self.engine, self.grid = engine, grid
        self.asked = 0
        self.reason = np.zeros(shape, dtype=np.uint8)
        for row, stage in enumerate(engine._fit):
            self.reason[:, row] = Reason.UNREACHABLE if stage is None else stage
        self.q = np.full((*shape, dof), np.nan)
        self.sample = np.full(shape, -1, dtype=np.int16)
        self.branch = np.full(shape, -1, dtype=np.int16)
        self.pair = np.full((*shape, 2), -1, dtype=np.int16)
        self.depth = np.full(shape, np.nan)
        self.clearance = np.full(shape, np.nan)
        names = engine._geometry.names
        self.bodies = list(dict.fromkeys(str(name) for name in names))
        index = {name: k for k, name in enumerate(self.bodies)}
        self._body = np.array([index[str(name)] for name in names])
        self._reason = np.array([self._collision(name) for name in names])

    def _collision(self, hit: BodyName) -> Reason:
        """Return what a collision with a body is called."""
        scene = self.engine.scene
        if hit.body == self.engine.arm.robot.name:
            return Reason.SELF_COLLISION
        if hit.body in scene.robots:
            return Reason.ROBOT_COLLISION
        return Reason.OBJECT_COLLISION if hit.body == scene.file.object.name else Reason.SCENE_COLLISION

    def take(
        self, found: search.SearchResult, cells: tuple[np.ndarray, ...], blocked: Collision | None
    ) -> None:
        status, pair, depth, q, pick, clearance = found[:6]
        self.reason[cells] = np.where(status == search.LIMITS, Reason.JOINT_LIMITS, Reason.UNREACHABLE)
        at = tuple(part[status == search.FEASIBLE] for part in cells)
        self.reason[at] = Reason.FEASIBLE
        self.q[at] = q[status == search.FEASIBLE]
        self.sample[at], self.branch[at] = pick[status == search.FEASIBLE].T
        self.clearance[at] = clearance[status == search.FEASIBLE]
        hit = (status == search.HIT) | (status == search.BLOCKED)
        named = hit & (pair[:, 0] >= 0)
        at = tuple(part[named] for part in cells)
        self.reason[at] = self._reason[pair[named, 1]]
        self.pair[at] = self._body[pair[named]]
        self.depth[at] = depth[named]
        self.reason[tuple(part[status == search.BLOCKED] for part in cells)] = Reason.APPROACH_BLOCKED
        if blocked is not None:
            for cell in zip(*(part[hit] for part in cells), strict=True):
                self.collides(cell, blocked.reason, blocked)

    def feasible(self, cell: tuple[int, ...], q: Array, sample: int, branch: int) -> None:
        self.reason[cell], self.clearance[cell] = Reason.FEASIBLE, 0.0
        self.q[cell], self.sample[cell], self.branch[cell] = q, sample, branch
        self.pair[cell], self.depth[cell] = -1, np.nan

    def collides(self, cell: tuple[int, ...], reason: Reason, collision: Collision | None) -> None:
        self.reason[cell] = reason
        self.pair[cell], self.depth[cell] = -1, np.nan
        if collision:
            for body in map(str, collision[1:3]):
                if body not in self.bodies:
                    self.bodies.append(body)
            self.pair[cell] = [self.bodies.index(str(body)) for body in collision[1:3]]
            self.depth[cell] = collision.depth

    def finish(self, task: Task) -> FeasibilityMap:
        engine = self.engine
        return FeasibilityMap(
            scene=engine.scene.name,
            arm=engine.arm.name,
            task=task.name,
            T_world_object=task.T_world_object,
            manifold=self.grid,
            reason=self.reason,
            q=self.q,
            sample=self.sample,
            branch=self.branch,
            clearance=self.clearance,
            phi=engine.ik.phi,
            opening=engine._opening,
            bodies=tuple(self.bodies),
            pair=self.pair,
            depth=self.depth,
        )


def _spread(count: int) -> np.ndarray:
    """Return the indices below ``count``, each far from those before it (van der Corput's sequence).

    Neighbouring redundancy values mostly share their fate, so the next try should be elsewhere.
    """
    order: dict[int, None] = {}
    k = 0
    while len(order) < count:
        k += 1
        value, base, rest = 0.0, 0.5, k
        while rest:
            value += base * (rest % 2)
            base, rest = 0.5 * base, rest // 2
        order.setdefault(int(value * count))
    return np.array(list(order), dtype=np.int64)
