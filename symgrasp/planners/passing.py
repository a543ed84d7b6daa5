"""Whether two hands whose prints overlap collide, or pass each other one behind the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import Piece, pack, pose_rows
from symgrasp.compiling import njit
from symgrasp.poses import Array

__all__ = ["Hands"]

SHRUNK = 0.98
"""Bodies that still overlap when they are this large meet, whatever their shapes are rounded to."""

TOUCH = 1e-9
"""Bodies at this distance (m) touch."""


class Hands:
    """Two hands.

    Args:
        a: vertices (n, 3) of the convex bodies of a hand, in its tool frame.
        b: those of the other hand.
    """

    def __init__(self, a: Sequence[Array], b: Sequence[Array]) -> None:
        self._pieces = pack([Piece(_shrunk(points)) for points in (*a, *b)])
        self._counts = len(a), len(b)

    def meet(self, T_a: Array, T_b: Array, asked: np.ndarray) -> np.ndarray:
        """Tell for which turns of the second hand about z the two meet for certain.

        Args:
            T_a: pose (4, 4) of the first hand's tool on the object.
            T_b: pose (4, 4) of the other hand's tool at column 0.
            asked: (A,) the columns that are asked for.

        Returns:
            (A,) bool; false where it is not asked.
        """
        first, second = self._counts
        poses = np.repeat(pose_rows(np.stack([T_a, T_b])), [first, second], axis=0)
        return _meet(self._pieces, poses, first, asked)


def _shrunk(points: Array) -> Array:
    middle = points.mean(axis=0)
    return middle + SHRUNK * (points - middle)


@njit(cache=True, error_model="numpy")
def _meet(packed, pose, first, asked):
    angles, pieces = len(asked), len(pose)
    work, turned = np.empty((4, 3)), pose.copy()
    meets = np.zeros(angles, np.bool_)
    for j in range(angles):
        if not asked[j]:
            continue
        cosine, sine = np.cos(2.0 * np.pi * j / angles), np.sin(2.0 * np.pi * j / angles)
        for k in range(first, pieces):
            for x, y in ((0, 3), (1, 4), (2, 5), (9, 10)):
                turned[k, x] = cosine * pose[k, x] - sine * pose[k, y]
                turned[k, y] = sine * pose[k, x] + cosine * pose[k, y]
        for i in range(first):
            for k in range(first, pieces):
                if not meets[j]:
                    _, upper = distance_bounds(packed, turned, i, k, 0.0, 0.0, TOUCH, work)
                    meets[j] = upper < TOUCH
    return meets
