"""Input and result of the compiled search of a map, and the arrays that it works on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.ik.branches import Memory, branch_count, new_memory
from symgrasp.ik.chain import Chain
from symgrasp.poses import Array

__all__ = [
    "BLOCKED",
    "FEASIBLE",
    "HIT",
    "LIMITS",
    "RETREAT_UNDECIDED",
    "UNBALANCED",
    "UNDECIDED_KEPT",
    "UNREACHABLE",
    "Balance",
    "BranchScratch",
    "Path",
    "RowChecks",
    "SearchInput",
    "SearchResult",
    "new_branches",
]

UNDECIDED_KEPT = 32
"""Largest number of undecided candidates of a cell that are listed; where there are more, all candidates
have to be decided."""

UNREACHABLE, LIMITS, UNBALANCED, HIT, BLOCKED, RETREAT_UNDECIDED, FEASIBLE = 0, 1, 2, 3, 4, 5, 6
"""Status of a cell: no branch reaches it, none inside the limits, with all of them the robot falls, all
collide, all are blocked on the retreat, or one is feasible. RETREAT_UNDECIDED is that of a single candidate
which PyBullet must decide."""


class Balance(NamedTuple):
    """What decides whether a robot stands. Weights are rows: mass (kg), then mass times point (3).

    Attributes:
        edges: (k, 3) of its support, see `symgrasp.scene.balance.support_edges`; none if it cannot fall.
        fixed: (4,) weight of the links that the arm does not move, in the world.
        joints: (n, 4) weights of those between base and tool that each joint moves last, in its frame.
        hand: (rows, 4) weight of those that are fixed to the tool, in its frame, at the opening of each row.
        load: (rows, 4) weight of what it holds in each row, in the world.
    """

    edges: Array
    fixed: Array
    joints: Array
    hand: Array
    load: Array


class SearchInput(NamedTuple):
    """What to search: m cells in r runs of equal length, each run being all cells of one row and roll.

    Attributes:
        sample_order: (K,) indices of the redundancy samples, in the order to try them.
        T_world_base: (4, 4) pose of the robot's base.
        T_base_tool: (m, 4, 4) tool poses of the cells, run by run.
        row: (r,) row of each run.
        retreat: (s,) signed distances (m) along the approach that must be free as well, in order.
        turns: (n,) largest changes of the joints from one of them to the next.
        margin: distance (m) to keep from static pieces.
        clearance: the clearance (m) of pieces that the arm does not move; that of a candidate is not
            larger.
        always_collides: whether pieces that the arm does not move collide, so that no candidate is free.
        beyond: (m,) which cells are out of reach whatever the redundancy is, so that no sample is tried.
        parts: number of parts that the cells are split into for the threads.
    """

    sample_order: np.ndarray
    T_world_base: Array
    T_base_tool: Array
    row: np.ndarray
    retreat: Array
    turns: Array
    margin: float
    clearance: float
    always_collides: bool
    beyond: np.ndarray
    parts: int


class SearchResult(NamedTuple):
    """What was found for each of m cells.

    Attributes:
        status: (m,) one of the constants above, never RETREAT_UNDECIDED. Where it is not FEASIBLE and
            candidates are undecided, it is that of the others.
        pair: (m, 2) indices of the pieces of which the first hits the second, -1 where none is known.
        depth: (m,) by how much (m) the pair is closer than allowed at least.
        q: (m, n) joint values of the best candidate.
        solution: (m, 2) redundancy sample and branch of the best candidate.
        clearance: (m,) lower bound of its clearance (m).
        undecided_count: (m,) number of undecided candidates.
        undecided_q: (m, UNDECIDED_KEPT, n) joint values of the first of them.
        undecided_solution: (m, UNDECIDED_KEPT, 2) their redundancy samples and branches.
        proven: (m,) whether nothing is free whatever the redundancy is: the cell is out of reach, or what the
            tool pose alone places collides, at the grasp or on its retreat.
        rows: the row checks.
    """

    status: np.ndarray
    pair: np.ndarray
    depth: Array
    q: Array
    solution: np.ndarray
    clearance: Array
    undecided_count: np.ndarray
    undecided_q: Array
    undecided_solution: np.ndarray
    proven: np.ndarray
    rows: RowChecks


class RowChecks(NamedTuple):
    """Results of `check_row` for each of r runs, at the grasp and at each of the s steps of the retreat.

    Attributes:
        gap: (r, 1 + s) clearance (m), UNDECIDED, or -inf for a collision.
        hit: (r, 1 + s, 2) the pair of pieces that collides.
        depth: (r, 1 + s) by how much (m) the pair is closer than allowed at least.
    """

    gap: Array
    hit: np.ndarray
    depth: Array


class Path(NamedTuple):
    """Where an arm is at each of the s steps of a retreat, and how far its M pieces move on the way.

    Attributes:
        frames: (s, n, 12) joint frames in the world, but the last.
        tool: (s, 12) tool poses in the world.
        motion: (M,) how far (m) any point of a piece is from where it is at the middle step, at most.
        q: (s, n) joint values.
        blocked: (2,) where and why the last candidate was blocked: the step from 1, or 0 at the grasp; then
            HIT, UNBALANCED, or LIMITS where no branch leads on.
    """

    frames: Array
    tool: Array
    motion: Array
    q: Array
    blocked: np.ndarray


class BranchScratch(NamedTuple):
    """Arrays that one thread writes inverse kinematics to: index 0 at the grasp, index 1 on the retreat.

    Attributes:
        q: (2, B, n) joint values of the B branches that the arm may have.
        exists: (2, B) which branches reach the pose.
        inside: (2, B) which branches reach it inside the limits.
        at: (n,) present joint values on the retreat.
        T: (4, 4) present tool pose on the retreat.
        path: the retreat of the arm.
        memory: what the inverse kinematics needs.
    """

    q: Array
    exists: np.ndarray
    inside: np.ndarray
    at: Array
    T: Array
    path: Path
    memory: Memory


def new_branches(chain: Chain, joints: int, steps: int, moving: int) -> BranchScratch:
    """Return arrays for the inverse kinematics of an arm.

    Args:
        chain: the arm.
        joints: number n of its joints.
        steps: number s of the steps of the retreat.
        moving: number M of the pieces that it moves.
    """
    count = branch_count(chain)
    return BranchScratch(
        q=np.empty((2, count, joints)),
        exists=np.empty((2, count), dtype=bool),
        inside=np.empty((2, count), dtype=bool),
        at=np.empty(joints),
        T=np.empty((4, 4)),
        path=Path(
            frames=np.empty((steps, joints, 12)),
            tool=np.empty((steps, 12)),
            motion=np.empty(moving),
            q=np.empty((steps, joints)),
            blocked=np.zeros(2, dtype=np.int64),
        ),
        memory=new_memory(joints),
    )
