"""Where the pieces that an arm moves are at a tool pose and at joint values. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.collision.boxes import box_of, boxes_of
from symgrasp.collision.simplex import FAST
from symgrasp.collision.walk import WAITING
from symgrasp.compiling import njit
from symgrasp.ik.vectors import sine_and_cosine
from symgrasp.poses import Array

__all__ = [
    "MovingPieces",
    "Scratch",
    "compose",
    "copied",
    "new_scratch",
    "place_arm",
    "place_frames",
    "place_hand",
    "place_pieces",
]


class MovingPieces(NamedTuple):
    """The pieces that an arm moves, and the pairs of pieces that must not collide.

    M pieces move; the first G of them are fixed to the tool (the hand, the last link of the arm): those that
    the grasp places. Of a pitched arm it places none, and the hand's move with the last joint. n joints, P
    pieces in all.

    Attributes:
        joint_origin: (n, 12) frame of each joint at zero in that of the joint before; the first in the
            world. Pieces are placed by those before the last: after five, a pitched arm has another one
            for this.
        joint_axis: (n, 3) unit axes in the joint frames.
        frame: (M,) index of the joint that moves each piece; unused for the first G.
        local: (M, 12) pose of each piece in its joint's frame; unused for the first G.
        hand: (rows, G, 12) pose of each of the first G pieces in the tool frame, at the opening of
            each row.
        touch: (M,) whether the piece may touch the object.
        hand_pairs: (., 2) pairs of two of the first G pieces.
        base_pairs: (., 2) pairs of one of the first G pieces and a piece of the robot that does not move.
        arm_pairs: (., 2) all other pairs of the robot's pieces, sorted by their first piece, which moves.
        arm_pair_start: (M + 1,) where the pairs of each moving piece begin in ``arm_pairs``.
        objects: (.,) indices of the pieces of the object.
    """

    joint_origin: Array
    joint_axis: Array
    frame: np.ndarray
    local: Array
    hand: Array
    touch: np.ndarray
    hand_pairs: np.ndarray
    base_pairs: np.ndarray
    arm_pairs: np.ndarray
    arm_pair_start: np.ndarray
    objects: np.ndarray


class Scratch(NamedTuple):
    """Arrays that the checks of one thread write to.

    Attributes:
        pose: (P, 12) present poses of the pieces in the world.
        box: (P, 6) axis-aligned boxes around them.
        frames: (n, 12) present joint frames in the world.
        tool: (4, 4) present pose of the tool in the world.
        simplex: (4, 3) for `distance_bounds`.
        stack: (WAITING,) nodes of the tree, for `next_near`.
        hit: (4,) the pair that was found colliding last, then the pair that ruled out the last rejected
            candidate (-1 where there is none).
        depth: (2,) by how much (m) the first pair is closer than allowed at least, then the margin (m)
            of the second pair.
        last_pose: (2, 12) poses of the second pair's pieces when it was found.
    """

    pose: Array
    box: Array
    frames: Array
    tool: Array
    simplex: Array
    stack: np.ndarray
    hit: np.ndarray
    depth: Array
    last_pose: Array


def new_scratch(pose: Array, size: Array, joints: int) -> Scratch:
    """Return scratch with all pieces at given poses.

    Args:
        pose: (P, 12) poses of the pieces, which are copied.
        size: (P, 9) see `PackedPieces`.
        joints: number n of joints of the arm.
    """
    return Scratch(
        pose=pose.copy(),
        box=boxes_of(size, pose),
        frames=np.empty((joints, 12)),
        tool=np.empty((4, 4)),
        simplex=np.empty((4, 3)),
        stack=np.empty(WAITING, dtype=np.int64),
        hit=np.full(4, -1, dtype=np.int64),
        depth=np.zeros(2),
        last_pose=np.empty((2, 12)),
    )


def copied(scratch: Scratch) -> Scratch:
    """Return scratch for another thread, with all pieces where they are in this one."""
    copy = Scratch(*(part.copy() for part in scratch))
    copy.hit[:] = -1
    return copy


@njit(**FAST)
def place_hand(moving, pieces, scratch, T_world_base, T, row):
    """Write poses and boxes of the pieces that are fixed to the tool.

    Args:
        moving: see `MovingPieces`.
        pieces: see `PackedPieces`.
        scratch: receives the poses.
        T_world_base: pose (4, 4) of the robot's base.
        T: tool pose (4, 4) in the base.
        row: row of the grasp, which determines the opening of the hand.
    """
    pose, tool, hand = scratch.pose, scratch.tool, moving.hand
    for i in range(3):
        b0, b1, b2 = T_world_base[i, 0], T_world_base[i, 1], T_world_base[i, 2]
        for j in range(4):
            tool[i, j] = b0 * T[0, j] + b1 * T[1, j] + b2 * T[2, j]
        tool[i, 3] += T_world_base[i, 3]
    for g in range(hand.shape[1]):
        for i in range(3):
            t0, t1, t2 = tool[i, 0], tool[i, 1], tool[i, 2]
            for j in range(3):
                pose[g, 3 * i + j] = (
                    t0 * hand[row, g, j] + t1 * hand[row, g, 3 + j] + t2 * hand[row, g, 6 + j]
                )
            at = t0 * hand[row, g, 9] + t1 * hand[row, g, 10] + t2 * hand[row, g, 11]
            pose[g, 9 + i] = at + tool[i, 3]
        box_of(pieces.size, pose, g, scratch.box[g])


@njit(**FAST)
def place_arm(moving, pieces, scratch, q):
    """Write poses and boxes of the pieces between base and tool, at joint values q (n,)."""
    place_frames(moving, q, scratch.frames)
    place_pieces(moving, pieces, scratch, scratch.frames)


@njit(**FAST)
def place_frames(moving, q, frames):
    """Write the joint frames (n, 12) in the world, but the last, at joint values q (n,)."""
    for j in range(len(moving.joint_origin) - 1):
        if j == 0:
            for i in range(12):
                frames[0, i] = moving.joint_origin[0, i]
        else:
            compose(frames[j - 1], moving.joint_origin[j], frames[j])
        rotate(frames[j], moving.joint_axis[j], q[j])


@njit(**FAST)
def place_pieces(moving, pieces, scratch, frames):
    """Write poses and boxes of the pieces between base and tool, given the joint frames (n, 12)."""
    for k in range(moving.hand.shape[1], len(moving.frame)):
        compose(frames[moving.frame[k]], moving.local[k], scratch.pose[k])
        box_of(pieces.size, scratch.pose, k, scratch.box[k])


@njit(**FAST)
def compose(a, b, out):
    """Write the product of two poses given as rows (12,)."""
    for i in range(3):
        a0, a1, a2 = a[3 * i], a[3 * i + 1], a[3 * i + 2]
        for j in range(3):
            out[3 * i + j] = a0 * b[j] + a1 * b[3 + j] + a2 * b[6 + j]
        out[9 + i] = a0 * b[9] + a1 * b[10] + a2 * b[11] + a[9 + i]


@njit(**FAST)
def rotate(frame, axis, angle):
    """Rotate a frame (12,) by an angle (rad) about a unit axis given in the frame itself."""
    s, c = sine_and_cosine(angle)
    x, y, z = axis[0], axis[1], axis[2]
    if x == 0.0 and y == 0.0:
        _mix_columns(frame, 0, 1, z * s, c)
    elif y == 0.0 and z == 0.0:
        _mix_columns(frame, 1, 2, x * s, c)
    elif z == 0.0 and x == 0.0:
        _mix_columns(frame, 2, 0, y * s, c)
    else:
        d = 1.0 - c
        r00, r01, r02 = c + d * x * x, d * x * y - s * z, d * x * z + s * y
        r10, r11, r12 = d * x * y + s * z, c + d * y * y, d * y * z - s * x
        r20, r21, r22 = d * x * z - s * y, d * y * z + s * x, c + d * z * z
        for i in range(3):
            a, b, e = frame[3 * i], frame[3 * i + 1], frame[3 * i + 2]
            frame[3 * i] = a * r00 + b * r10 + e * r20
            frame[3 * i + 1] = a * r01 + b * r11 + e * r21
            frame[3 * i + 2] = a * r02 + b * r12 + e * r22


@njit(**FAST)
def _mix_columns(frame, u, v, s, c):
    """Turn columns u and v of a rotation: what a rotation about the third axis does, which is most axes."""
    for i in range(3):
        a, b = frame[3 * i + u], frame[3 * i + v]
        frame[3 * i + u] = a * c + b * s
        frame[3 * i + v] = b * c - a * s
