"""Boxes of heights and angles for which cells are proven, and the arrays that proving works on.

A box of level k is a cell of the map cut in 2^k parts along and around. All that depends on the heights of a
box alone is the same for all boxes of a *row* of its level.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.engine.kinematics import Scratch
from symgrasp.engine.reach import Reach
from symgrasp.poses import Array

__all__ = ["CellInput", "CellWork", "Rows", "new_work"]


class Rows(NamedTuple):
    """Rows of heights of boxes, of all levels one after the other; what is said of changes is at most.

    Attributes:
        h: (rows,) height (m) in the middle.
        dh: (rows,) change of the height (m) from there.
        standoff: (rows,) standoff (m) in the middle.
        dstandoff: (rows,) its change (m).
        shift: (rows,) y (m) of the axis in the tool frame in the middle.
        dshift: (rows,) its change (m).
        hand: (rows, G, 12) poses of the pieces fixed to the tool in its frame, opened as in the middle.
        play: (rows, G) how far (m) a point of these moves in that frame as the opening changes.
        sway: (rows,) the same for the centre of mass of the hand.
        fits: (rows,) whether the hand fits at all heights.
        misfits: (rows,) whether it fits at none.
    """

    h: Array
    dh: Array
    standoff: Array
    dstandoff: Array
    shift: Array
    dshift: Array
    hand: Array
    play: Array
    sway: Array
    fits: np.ndarray
    misfits: np.ndarray


class CellInput(NamedTuple):
    """What is proven, and what applies to all boxes.

    Attributes:
        object: (12,) axis frame of the object in the world.
        start: angle (rad) in that frame where the grid begins.
        width: width (rad) of a cell.
        rows: the rows of boxes.
        first: (levels + 1,) where the rows of each level begin.
        tool: (12,) pose of the tool in the frame of the last joint.
        free: (6,) the joints that follow a path of the tool; another one is held.
        limits: (2, n) limits (rad) of the joints, infinite where there are none.
        margin: distance (m) to keep from static pieces.
        inner: bodies inside the pieces, see `inner_pieces`.
        reach: how far the arm reaches, with its shoulder in the world.
    """

    object: Array
    start: float
    width: float
    rows: Rows
    first: np.ndarray
    tool: Array
    free: np.ndarray
    limits: Array
    margin: float
    inner: tuple[PackedPieces, ...]
    reach: Reach


class CellWork(NamedTuple):
    """Arrays that one thread writes to; n joints.

    Attributes:
        scratch: see `Scratch`.
        q: (n,) joint values in the middle of a box.
        frames: (n, 12) joint frames in the world.
        T: (12,) tool pose in the world that is wanted.
        tool: (12,) the same as the joints have it.
        twist: (n, 6) by each joint, angular and linear velocity of the tool, in its frame.
        inverse: (n, 6) by how much each joint moves for these; 0 for one that is held.
        matrix: (6, 12) for inverting.
        bend: (n, n, n) by how much (1/rad), if joint k moves, the twist of joint j moves joint i.
        size: (n, 2) lengths of both halves of the rows of ``inverse``.
        along: (4, n) how fast the joints follow height, angle, standoff and shift.
        change: (4,) the largest changes of these in a box.
        base: (n,) most that the joints move (rad), if their twists did not change.
        most: (n,) most that they move (rad).
        rest: (n,) most that they are away (rad) from where ``along`` takes them.
        lever: (n, 3) of the tool about each joint (m), and sums over the joints after it of their motion
            (rad), and of their motion times their lever.
        motion: (M,) how far (m) points of the moving pieces move.
        stack: (., 3) level, row and column of the boxes that wait.
        from_q: (., n) joint values near the middles of these.
    """

    scratch: Scratch
    q: Array
    frames: Array
    T: Array
    tool: Array
    twist: Array
    inverse: Array
    matrix: Array
    bend: Array
    size: Array
    along: Array
    change: Array
    base: Array
    most: Array
    rest: Array
    lever: Array
    motion: Array
    stack: np.ndarray
    from_q: Array


def new_work(scratch: Scratch, joints: int, moving: int, levels: int) -> CellWork:
    """Return arrays for an arm with n joints and M moving pieces, and boxes of so many levels."""
    waiting = 4 * (levels + 1)
    return CellWork(
        scratch=scratch,
        q=np.empty(joints),
        frames=np.empty((joints, 12)),
        T=np.empty(12),
        tool=np.empty(12),
        twist=np.empty((joints, 6)),
        inverse=np.zeros((joints, 6)),
        matrix=np.empty((6, 12)),
        bend=np.zeros((joints, joints, joints)),
        size=np.zeros((joints, 2)),
        along=np.zeros((4, joints)),
        change=np.empty(4),
        base=np.zeros(joints),
        most=np.zeros(joints),
        rest=np.zeros(joints),
        lever=np.zeros((joints, 3)),
        motion=np.empty(moving),
        stack=np.empty((waiting, 3), dtype=np.int64),
        from_q=np.empty((waiting, joints)),
    )
