"""Rounding the corners of a path in joint space, by no more than is known to be free."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from symgrasp.poses import Array

__all__ = ["RoundedPath", "pieces"]

SHORTEST = 1e-9
"""Rows that differ by less (rad or m) are one."""

LEAST_ROUNDING = 1e-3
"""A corner that may be rounded over less than this share of an edge beside it is a stop."""


class RoundedPath:
    """A polyline in joint space whose corners are parabolas: its direction has no jumps.

    With c the length that is cut off an edge u₋ before a corner Q and off the edge u₊ after it (unit
    directions), the parabola is the Bézier curve with the control points Q − c·u₋, Q, Q + c·u₊. It is off the
    polyline by at most c/4·(u₊ − u₋), in each joint, at its middle. Lengths are Euclidean in joint space.

    Args:
        rows: (m, n) the corners; no two rows in a row are equal.
        weight: (n,) how far (m) a point moves at most for each unit of a joint.
        tolerance: how far (m) any point may be off the polyline.

    Attributes:
        length: of the path.
        knots: (k,) positions along it where lines and parabolas meet, both ends included.
        deviation: how far (m) any point is off the polyline, at most.
    """

    def __init__(self, rows: Array, weight: Array, tolerance: float) -> None:
        edges = np.diff(rows, axis=0)
        lengths = np.linalg.norm(edges, axis=1)
        directions = edges / lengths[:, None]
        turns = np.diff(directions, axis=0)
        bends = np.abs(turns) @ weight  # (m - 2,)
        cuts = np.minimum(0.5 * lengths[:-1], 0.5 * lengths[1:])
        cuts = np.minimum(cuts, np.divide(4 * tolerance, bends, out=cuts.copy(), where=bends > 0))
        self.deviation = float((cuts * bends).max(initial=0.0) / 4)
        cut = np.concatenate([[0.0], cuts, [0.0]])
        self._weight = weight
        # Pieces: a line along each edge, and between two of them a parabola of length 2c.
        starts, speeds, bendings, pieces_ = [], [], [], []
        for k, length in enumerate(lengths):
            starts.append(rows[k] + cut[k] * directions[k])
            speeds.append(directions[k])
            bendings.append(np.zeros(rows.shape[1]))
            pieces_.append(length - cut[k] - cut[k + 1])
            if k < len(turns):
                starts.append(rows[k + 1] - cut[k + 1] * directions[k])
                speeds.append(directions[k])
                bendings.append(turns[k] / (2 * cut[k + 1]))
                pieces_.append(2 * cut[k + 1])
        kept = np.array(pieces_) > SHORTEST
        self._start, self._speed, self._bending = (
            np.array(values)[kept] for values in (starts, speeds, bendings)
        )
        self.knots = np.concatenate([[0.0], np.cumsum(np.array(pieces_)[kept])])
        self.length = float(self.knots[-1])

    def __call__(self, s: Array, order: int = 0) -> Array:
        """Return positions (..., n), or derivatives of an order up to 2, at lengths (...) along the path."""
        s = np.asarray(s, dtype=float)
        k = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self._start) - 1)
        x = (s - self.knots[k])[..., None]
        if order == 0:
            return self._start[k] + x * self._speed[k] + 0.5 * x * x * self._bending[k]
        return self._speed[k] + x * self._bending[k] if order == 1 else self._bending[k]

    def chord_deviation(self, s: Array) -> float:
        """Return how far (m) any point is off the path, at most, on straight lines between positions (m,)."""
        bends = np.abs(self._bending) @ self._weight
        first = np.clip(np.searchsorted(self.knots, s[:-1], side="right") - 1, 0, len(bends) - 1)
        last = np.clip(np.searchsorted(self.knots, s[1:], side="left") - 1, 0, len(bends) - 1)
        worst = [bends[a : max(a, b) + 1].max() for a, b in zip(first, last, strict=True)]
        return float((np.diff(s) ** 2 * worst).max(initial=0.0) / 8)


def pieces(rows: Array, weight: Array, tolerance: float) -> list[Array]:
    """Split rows (m, n) into runs between stops: corners that can hardly be rounded. See `RoundedPath`.

    Rows that repeat the one before are left out; nothing is left of rows that are all equal.
    """
    moved = np.linalg.norm(np.diff(rows, axis=0), axis=1) > SHORTEST
    rows = rows[np.concatenate([[True], moved])]
    if len(rows) < 2:
        return []
    edges = np.diff(rows, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    bends = np.abs(np.diff(edges / lengths[:, None], axis=0)) @ weight
    shorter = np.minimum(lengths[:-1], lengths[1:])
    stops = np.flatnonzero(4 * tolerance < LEAST_ROUNDING * shorter * bends) + 1
    ends = [0, *stops.tolist(), len(rows) - 1]
    return [rows[a : b + 1] for a, b in pairwise(ends)]
