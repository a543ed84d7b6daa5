"""Algorithm 1 of the paper, written plainly: the map that every faster way must reproduce."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from symgrasp.feasibility.candidates import Candidate, CandidateChecker
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.creation.map_draft import MapDraft
from symgrasp.feasibility.fit import fit
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import GridSolvers, Solver, solver_for
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.poses import inverse
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.world import BulletWorld

__all__ = ["create_map_reference", "furthest"]


def create_map_reference(
    world: BulletWorld,
    arm: Arm,
    task: Task,
    manifold: Manifold,
    progress: Progress | None = None,
    solver: Callable[[Arm], Solver] | None = None,
) -> FeasibilityMap:
    """Compute the feasibility map of an arm and a task, cell by cell and candidate by candidate.

    Args:
        world: a world of the scene's robots, obstacles and object; the arm ends at home.
        arm: the arm.
        task: the task; it need not be one of the scene's.
        manifold: the grid.
        progress: called with the finished share after every row; may raise `Cancelled`.
        solver: returns the inverse kinematics of an arm, see `GridSolvers`; that of all samples if None.

    Raises:
        UrdfError: the arm has no closed-form inverse kinematics.
    """
    settings = world.scene.settings
    solvers = GridSolvers(arm, manifold, solver or (lambda own: solver_for(own, settings.samples)))
    radii = manifold.profile.radius(manifold.h)
    draft = MapDraft(arm, manifold, np.array([arm.hand.opening(float(r)) for r in radii]), solvers.at(0, 0))
    T_base_tool = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(manifold, task.T_world_object)
    world.margin = settings.margin
    world.set_arms(())  # a map that was cancelled in this world may have left an arm elsewhere
    world.set_object(task.T_world_object)
    for row, h in enumerate(manifold.h):
        misfit = fit(arm.hand, manifold.profile, float(h))
        if misfit is not None:
            draft.reason[:, row], draft.proven[:, row] = misfit, True
        else:
            for roll in range(len(ROLLS)):
                ik = solvers.at(row, roll)
                checker = CandidateChecker(world, ik.arm, ik, settings.approach, holders=task.arms)
                for column in range(manifold.angles):
                    cell = Cell(roll, row, column)
                    _decide(draft, cell, checker.candidates(T_base_tool[cell], draft.opening[row]))
        if progress:
            progress((row + 1) / manifold.heights)
    world.set_arms(())
    return draft.finish(world.scene.name, task)


def _decide(draft: MapDraft, cell: Cell, candidates: Iterable[Candidate]) -> None:
    """Record a cell as feasible, or why the furthest of its candidates fails."""
    reason, best = furthest(candidates, draft.no_candidate)
    if best is not None and reason == Reason.FEASIBLE:
        draft.record_feasible(cell, best.q, best.sample, best.branch)
    else:
        draft.record_failure(cell, reason, best.collision if best else None)


def furthest(
    candidates: Iterable[Candidate], no_candidate: Reason = Reason.UNREACHABLE
) -> tuple[Reason, Candidate | None]:
    """Return the furthest stage of the candidates of a cell, and the one that reached it.

    The first feasible one ends the search; of those that collide at the same stage, the one that
    came closest to being free counts.

    Args:
        candidates: the candidates, in the order in which they are tried.
        no_candidate: the stage where there is none.

    Returns:
        The stage, and its candidate: None where there is no candidate at all.
    """
    reached, best = no_candidate, None
    for candidate in candidates:
        if candidate.reason == Reason.FEASIBLE:
            return candidate.reason, candidate
        if candidate.reason > reached or (candidate.reason == reached and _shallower(candidate, best)):
            reached, best = candidate.reason, candidate
    return reached, best


def _shallower(candidate: Candidate, other: Candidate | None) -> bool:
    """Whether a candidate collides less deeply than another one of the same stage."""
    if candidate.collision is None:
        return False
    return other is None or other.collision is None or candidate.collision.depth < other.collision.depth
