"""Algorithm 1 of the paper, written plainly: the map that every faster way must reproduce."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from symgrasp.feasibility.candidates import Candidate, CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.fit import fit
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import ClosedFormIK, solver_for
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.poses import inverse
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld

__all__ = ["create_map_reference", "furthest"]


def create_map_reference(
    world: BulletWorld,
    scene: Scene,
    arm: Arm,
    task: Task,
    manifold: Manifold,
    progress: Progress | None = None,
) -> FeasibilityMap:
    """Compute the feasibility map of an arm and a task, cell by cell and candidate by candidate.

    Args:
        world: a world of the scene's robots, obstacles and object; the arm ends at home.
        scene: the scene, for its settings.
        arm: the arm.
        task: the task; it need not be one of the scene's.
        manifold: the grid.
        progress: told the finished share after every row; may raise `Cancelled`.

    Raises:
        UrdfError: the arm has no closed-form inverse kinematics.
    """
    ik = solver_for(arm, scene.settings.redundancy)
    draft = _MapDraft(manifold, arm, ik)
    T_base_tool = inverse(arm.robot.T_world_base) @ manifold.tool_poses(
        task.T_world_object, arm.hand.finger_depth
    )
    world.margin = scene.settings.margin
    world.set_arms(())  # a map that was cancelled in this world may have left an arm elsewhere
    world.set_object(task.T_world_object)
    checker = CandidateChecker(world, arm, ik, scene.settings.approach)
    for row, h in enumerate(manifold.h):
        stage = fit(arm.hand, manifold.profile, h)
        for roll, column in np.ndindex(len(ROLLS), manifold.angles):
            cell = Cell(roll, row, column)
            if stage is not None:
                draft.reason[cell] = stage
                continue
            candidates = checker.candidates(T_base_tool[cell], draft.opening[row])
            draft.record(cell, *furthest(candidates))
        if progress:
            progress((row + 1) / manifold.heights)
    world.set_arms(())
    return draft.finish(scene.name, task)


def furthest(candidates: Iterable[Candidate]) -> tuple[Reason, Candidate | None]:
    """Return the furthest stage of the candidates of a cell, and the one that reached it.

    The first feasible one ends the search; of those that collide at the same stage, the one that
    came closest to being free counts.
    """
    reached, best = Reason.UNREACHABLE, None
    for candidate in candidates:
        if candidate.fate == Reason.FEASIBLE:
            return candidate.fate, candidate
        if candidate.fate > reached or (candidate.fate == reached and _shallower(candidate, best)):
            reached, best = candidate.fate, candidate
    return reached, best


def _shallower(candidate: Candidate, other: Candidate | None) -> bool:
    if candidate.collision is None:
        return False
    return other is None or other.collision is None or candidate.collision.depth < other.collision.depth


class _MapDraft:
    """The arrays of a map while it is being computed."""

    def __init__(self, grid: Manifold, arm: Arm, ik: ClosedFormIK) -> None:
        shape = (len(ROLLS), grid.heights, grid.angles)
        self.grid, self.arm, self.ik = grid, arm, ik
        self.opening = np.array([arm.hand.opening(r) for r in grid.profile.radius(grid.h)])
        self.reason = np.zeros(shape, dtype=np.uint8)
        self.q = np.full((*shape, arm.dof), np.nan)
        self.sample = np.full(shape, -1, dtype=np.int16)
        self.branch = np.full(shape, -1, dtype=np.int16)
        self.pair = np.full((*shape, 2), -1, dtype=np.int16)
        self.depth = np.full(shape, np.nan)
        self.bodies: dict[str, int] = {}

    def record(self, cell: Cell, reason: Reason, candidate: Candidate | None) -> None:
        self.reason[cell] = reason
        if candidate is None:
            return
        if reason == Reason.FEASIBLE:
            self.q[cell] = candidate.q
            self.sample[cell], self.branch[cell] = candidate.sample, candidate.branch
        elif candidate.collision:
            pair = (candidate.collision.a, candidate.collision.b)
            self.pair[cell] = [self._body(str(body)) for body in pair]
            self.depth[cell] = candidate.collision.depth

    def _body(self, name: str) -> int:
        return self.bodies.setdefault(name, len(self.bodies))

    def finish(self, scene: str, task: Task) -> FeasibilityMap:
        return FeasibilityMap(
            scene=scene,
            arm=self.arm.name,
            task=task.name,
            T_world_object=task.T_world_object,
            manifold=self.grid,
            bodies=tuple(self.bodies),
            phi=self.ik.phi,
            clearance=np.where(self.reason == Reason.FEASIBLE, 0.0, np.nan),
            **{
                name: getattr(self, name)
                for name in ("reason", "q", "sample", "branch", "opening", "pair", "depth")
            },
        )
