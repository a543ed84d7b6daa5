"""Certificates for two robots: free of each other, colliding, or left to PyBullet to decide."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.collision.boxes import boxes_apart, boxes_of
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import Piece, pack, pose_rows
from symgrasp.collision.simplex import FAST
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.checks import FREE_BAND, HIT_BAND
from symgrasp.poses import Array
from symgrasp.robot.robot import Robot
from symgrasp.world import BulletWorld

__all__ = ["COLLIDING", "FREE", "OPEN", "PlacedRobot", "RobotPairs"]

FREE, OPEN, COLLIDING = range(3)
"""What is certain of two robots: that they are free of each other, nothing, that they collide."""


class PlacedRobot(NamedTuple):
    """Links of a robot at n sets of joint values, as P pieces.

    Attributes:
        pieces: (P,) indices of the pieces.
        pose: (n, P, 12) their poses in the world.
        box: (n, P + 1, 6) axis-aligned boxes around them, and around all.
    """

    pieces: np.ndarray
    pose: Array
    box: Array


class RobotPairs:
    """The collision shapes of all robots of a scene, to decide which configurations of two meet.

    Args:
        world: a world of the scene.
    """

    def __init__(self, world: BulletWorld) -> None:
        self._links: dict[str, list[tuple[int, str]]] = {}
        pieces: list[Piece] = []
        for name in world.scene.robots:
            own = [(link, shape) for link, shapes in world.shapes(name).items() for shape in shapes]
            self._links[name] = [(len(pieces) + k, link) for k, (link, _) in enumerate(own)]
            pieces += [Piece(shape.vertices, shape.rounding, shape.slack) for _, shape in own]
        self._pieces = pack(pieces)

    def place(self, robot: Robot, values: Sequence[Array], without: Collection[str] = ()) -> PlacedRobot:
        """Return a robot at n sets of joint values.

        Args:
            robot: the robot.
            values: n times the values (N,) of all its joints.
            without: names of links that are left out.
        """
        links = [(k, link) for k, link in self._links[robot.name] if link not in without]
        pieces = np.array([k for k, _ in links], dtype=np.int64)
        index = [robot.model.link_index(link) for _, link in links]
        joints = np.array(values, dtype=float).reshape(-1, len(robot.home))
        pose = pose_rows(robot.T_world_base @ robot.model.forward(joints)[:, index])
        size = np.tile(self._pieces.size[pieces], (len(joints), 1))
        box = boxes_of(size, pose.reshape(-1, 12)).reshape(len(joints), len(links), 6)
        low = box[..., :3].min(axis=1, keepdims=True, initial=np.inf)
        high = box[..., 3:].max(axis=1, keepdims=True, initial=-np.inf)
        around = np.concatenate([low, high], axis=2)
        return PlacedRobot(pieces, pose, np.concatenate([box, around], axis=1))

    def certify(self, a: PlacedRobot, b: PlacedRobot, margin: float) -> np.ndarray:
        """Return what is certain (n, m) of a robot at n and of another at m sets of joint values.

        It holds for PyBullet too: see `FREE_BAND` and `HIT_BAND`.

        Args:
            a: the one.
            b: the other.
            margin: distance (m) that they must keep.
        """
        found = np.empty((len(a.pose), len(b.pose)), dtype=np.int64)
        pose = np.empty((len(self._pieces.size), 12))
        _certify(self._pieces, a, b, float(margin), pose, np.empty((4, 3)), found)
        return found


@njit(**ENTRY)
def _certify(pieces, a, b, margin, pose, simplex, found):
    """Do what `RobotPairs.certify` does; ``pose`` (P, 12) and ``simplex`` (4, 3) are scratch."""
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            found[i, j] = _certain(pieces, a, i, b, j, margin, pose, simplex)


@njit(**FAST)
def _certain(pieces, a, i, b, j, margin, pose, simplex):
    """Return what is certain of a robot at its i-th and another at its j-th joint values."""
    sure, state = margin + FREE_BAND, FREE
    box_a, box_b, all_a, all_b = a.box[i], b.box[j], len(a.pieces), len(b.pieces)
    if boxes_apart(box_a, all_a, all_b, box_b, sure):
        return state
    for s in range(all_a):
        if boxes_apart(box_a, s, all_b, box_b, sure):
            continue
        first = a.pieces[s]
        _copy(a.pose[i, s], pose[first])
        for t in range(all_b):
            if boxes_apart(box_a, s, t, box_b, sure):
                continue
            second = b.pieces[t]
            _copy(b.pose[j, t], pose[second])
            deep = margin - HIT_BAND - pieces.size[first, 1] - pieces.size[second, 1]
            lower, upper = distance_bounds(pieces, pose, first, second, sure, sure, deep, simplex)
            if upper < deep:
                return COLLIDING
            if lower < sure:
                state = OPEN
    return state


@njit(**FAST)
def _copy(row, out):
    """Copy the pose (12,) of a piece."""
    for k in range(12):
        out[k] = row[k]
