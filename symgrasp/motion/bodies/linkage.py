"""Joints that move together, the pieces that they carry, and what these must not meet. For compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.collision.boxes import boxes_of
from symgrasp.collision.pieces import PackedPieces
from symgrasp.poses import Array

__all__ = ["Balance", "Linkage", "Workspace", "new_workspace"]

WAITING = 256
"""Stretches of a line that may wait for proofs: more than there ever are, see `line_clearance`."""


class Balance(NamedTuple):
    """What keeps robots that can fall on their feet: R robots with E edges of the areas that these span.

    Attributes:
        weight: (J, 4) mass (kg), and mass times position (kg m) in the frame of the joint, of what each joint
            carries and no later one does.
        robot: (J,) which of the robots a joint belongs to, -1 for one that cannot fall.
        sway: (J,) how far (m, or m/m) the centre of mass moves at most for each unit of a joint.
        mass: (R,) mass (kg) of a robot with all that it carries.
        edge: (E, 3) unit normal outwards (2,) of each edge and its offset (m), less the share of what stands:
            inside, what moves has ``normal · Σ m p / mass <= offset``.
        edge_robot: (E,) the robot that stands on it.
    """

    weight: Array
    robot: np.ndarray
    sway: Array
    mass: Array
    edge: Array
    edge_robot: np.ndarray


class Linkage(NamedTuple):
    """J joints that move at once, in an order in which parents come first, and the M pieces that they carry.

    A pair is a moving piece and another piece, moving or not, that it must not meet; it is about those of the
    joints that move one of the two and not the other.

    Attributes:
        origin: (J, 12) frame of each joint at zero, in that of its parent; of those without one in the world.
        axis: (J, 3) unit axes in the joint frames.
        slides: (J,) whether the joint is prismatic.
        parent: (J,) index of the joint before, -1 for none.
        limits: (2, J) lower and upper limits (rad or m), infinite where there are none.
        piece: (M,) index of each moving piece among all pieces.
        frame: (M,) the joint that carries it.
        local: (M, 12) its pose in the frame of that joint.
        radius: (M,) largest distance (m) of its points from the middle of its box.
        lever: (M, J) how far (m, or m/m) a point of it moves at most for each unit of a joint, whatever the
            joint values; 0 for joints that do not carry it.
        margin: (M,) distance (m) that it keeps from the pieces of the tree; inf where it need not be checked.
        pair: (Q, 2) indices of a moving piece, and of another piece among all pieces.
        other: (Q,) index of the other piece among the moving ones, -1 if it stands.
        common: (Q,) the last joint that carries both, -1 if none does.
        distance: (Q,) distance (m) to keep.
        rests: (Q,) whether one of them rests on the other when it is lifted: their distance is no clearance.
        tilted: the joint that carries the axis whose tilt is limited, -1 for none.
        upright: (3,) that axis in the frame of the joint.
        tilt: its largest angle (rad) from the vertical.
        balance: see `Balance`.
    """

    origin: Array
    axis: Array
    slides: np.ndarray
    parent: np.ndarray
    limits: Array
    piece: np.ndarray
    frame: np.ndarray
    local: Array
    radius: Array
    lever: Array
    margin: Array
    pair: np.ndarray
    other: np.ndarray
    common: np.ndarray
    distance: Array
    rests: np.ndarray
    tilted: int
    upright: Array
    tilt: float
    balance: Balance


class Workspace(NamedTuple):
    """Arrays that compiled code writes to.

    Attributes:
        pose: (P, 12) present poses of all pieces in the world.
        box: (P, 6) axis-aligned boxes around them.
        frames: (J, 12) present joint frames in the world.
        simplex: (4, 3) for `distance_bounds`.
        q: (4, J) joint values.
        twist: (J, 6) how each joint frame turns (3,), and how its point at the origin of the world moves
            (3,), for each unit of the path's parameter.
        waiting: (W, 3) stretches of a line that wait for proofs: both ends, and half the length of the one
            beside it.
        speed: (M, 2) speed and acceleration (m per unit of the path's parameter) of the points of each piece.
        load: (J, 5) mass (kg) and mass times position (kg m) in the world of all that a joint carries, and
            how far (rad) all joints before it turn together.
        hit: (2,) the pair of pieces, among all, at which the last path was not found free; `TILTED` or
            `FALLEN` twice where it was none.
    """

    pose: Array
    box: Array
    frames: Array
    simplex: Array
    q: Array
    twist: Array
    waiting: Array
    speed: Array
    load: Array
    hit: np.ndarray


def new_workspace(linkage: Linkage, pieces: PackedPieces, pose: Array) -> Workspace:
    """Return a workspace with the pieces at poses (P, 12); those of moving ones do not matter."""
    joints = len(linkage.parent)
    return Workspace(
        pose=pose.copy(),
        box=boxes_of(pieces.size, pose),
        frames=np.empty((joints, 12)),
        simplex=np.empty((4, 3)),
        q=np.empty((4, joints)),
        twist=np.empty((joints, 6)),
        waiting=np.empty((WAITING, 3)),
        speed=np.empty((len(linkage.piece), 2)),
        load=np.empty((joints, 5)),
        hit=np.full(2, -1, dtype=np.int64),
    )
