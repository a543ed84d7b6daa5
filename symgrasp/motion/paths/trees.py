"""Free motion: trees of proven lines grow until they meet (RRT-Connect); the path is shortened. Compiled.

J. J. Kuffner and S. M. LaValle, RRT-Connect: an efficient approach to single-query path planning, ICRA 2000.
Here each tree may have several roots. Where a tilt is limited, samples and new nodes are projected onto what
it allows: Newton's method turns the axis of the object along the shortest way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.collision.simplex import FAST
from symgrasp.compiling import ENTRY, njit
from symgrasp.motion.paths.proof import line_clearance, place, tilt_excess
from symgrasp.poses import Array

__all__ = ["Trees", "drop_points", "grow", "new_trees", "shorten"]

STEP = 0.9
"""Longest line (rad) that is added to a tree."""

LARGEST_TREE = 20_000
"""Most nodes of a tree."""

PROJECTIONS = 20
"""Most steps of Newton's method in a projection."""

IDLE = 30
"""Lines in a row that shorten a path no more, after which no others are tried."""

INSIDE = 0.05
"""How far (rad) inside of the largest tilt a projection aims."""


class Trees(NamedTuple):
    """Two trees.

    Attributes:
        node: (2, N, J) joint values.
        parent: (2, N) index of the node before, -1 for a root.
        filled: (2,) number of nodes.
        meet: (2,) the nodes of both at which they meet.
        random: (1,) state of the random numbers.
        met: (P + 2,) how often each piece was met by lines that were not free; the last two are `FALLEN` and
            `TILTED`.
    """

    node: Array
    parent: np.ndarray
    filled: np.ndarray
    meet: np.ndarray
    random: np.ndarray
    met: np.ndarray


def new_trees(starts: Array, goals: Array, pieces: int, seed: int) -> Trees:
    """Return trees of roots (., J) only."""
    node = np.empty((2, LARGEST_TREE, starts.shape[1]))
    node[0, : len(starts)], node[1, : len(goals)] = starts, goals
    return Trees(
        node=node,
        parent=np.full((2, LARGEST_TREE), -1, dtype=np.int64),
        filled=np.array([len(starts), len(goals)], dtype=np.int64),
        meet=np.full(2, -1, dtype=np.int64),
        random=np.array([(seed * 2654435761 + 88172645463325252) % 2**64 or 1], dtype=np.uint64),
        met=np.zeros(pieces + 2, dtype=np.int64),
    )


@njit(**FAST)
def _random(state):
    """Return the next random number in [0, 1): xorshift64*."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return float((x * np.uint64(2685821657736338717)) >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@njit(**ENTRY)
def grow(linkage, pieces, tree, work, trees, low, high, count):
    """Grow two trees, always the one with fewer nodes; return whether they meet.

    Where one of them is in a narrow place, it stays small, and samples are worth most there.

    Args:
        linkage: see `Linkage`.
        pieces: see `PackedPieces`.
        tree: boxes of the standing pieces.
        work: see `Workspace`.
        trees: see `Trees`.
        low: (J,) smallest joint values that are sampled.
        high: (J,) largest ones.
        count: how many samples to take.
    """
    sample = work.q[2]
    for _ in range(count):
        side = 0 if trees.filled[0] <= trees.filled[1] else 1
        if trees.filled[side] >= trees.node.shape[1] - 1 or trees.filled[1 - side] >= trees.node.shape[1] - 1:
            return False
        for j in range(len(sample)):
            sample[j] = low[j] + _random(trees.random) * (high[j] - low[j])
        if linkage.tilted >= 0 and not _project(linkage, pieces.size, work, sample, low, high):
            continue
        new, _ = _extend(linkage, pieces, tree, work, trees, side, sample, low, high)
        if new < 0:
            continue
        for j in range(len(sample)):
            sample[j] = trees.node[side, new, j]
        while True:
            other, arrives = _extend(linkage, pieces, tree, work, trees, 1 - side, sample, low, high)
            if arrives:
                trees.meet[side], trees.meet[1 - side] = new, other
                return True
            if other < 0:
                break
    return False


@njit(**FAST)
def _extend(linkage, pieces, tree, work, trees, side, target, low, high):
    """Add a proven line towards a target (J,) to a tree.

    Returns:
        The new node, -1 where there is none, and whether it is the target.
    """
    node = trees.node[side]
    nearest, least = 0, math.inf
    for i in range(trees.filled[side]):
        square = 0.0
        for j in range(len(target)):
            square += (target[j] - node[i, j]) ** 2
        if square < least:
            nearest, least = i, square
    length = math.sqrt(least)
    if length == 0.0:
        return nearest, True
    if trees.filled[side] >= node.shape[0]:
        return -1, False
    new = trees.filled[side]
    arrives = length <= STEP
    for j in range(len(target)):
        along = 1.0 if arrives else STEP / length
        node[new, j] = node[nearest, j] + along * (target[j] - node[nearest, j])
    if arrives:
        for j in range(len(target)):
            node[new, j] = target[j]
    elif linkage.tilted >= 0:
        if not _project(linkage, pieces.size, work, node[new], low, high):
            return -1, False
        left = 0.0
        for j in range(len(target)):
            left += (target[j] - node[new, j]) ** 2
        if left >= least:  # the projection led back
            return -1, False
    # Most lines that are not free end inside of something.
    if line_clearance(linkage, pieces, tree, work, node[nearest], node[new], 0.0, 1.0)[0] < 0.0:
        trees.met[work.hit[0]] += 1
        trees.met[work.hit[1]] += 1
        return -1, False
    trees.parent[side, new] = nearest
    trees.filled[side] += 1
    return new, arrives


@njit(**FAST)
def _project(linkage, size, work, q, low, high):
    """Turn the axis of the object inside of the largest tilt by changing q (J,), if that succeeds."""
    for _ in range(PROJECTIONS):
        place(linkage, size, work, q)
        excess = tilt_excess(linkage, work.frames)
        if excess < -1e-3:
            return True
        f, u = work.frames[linkage.tilted], linkage.upright
        x = f[0] * u[0] + f[1] * u[1] + f[2] * u[2]
        y = f[3] * u[0] + f[4] * u[1] + f[5] * u[2]
        across = math.sqrt(x * x + y * y)
        if across < 1e-9:
            return False
        # The axis (x, y, z) turns to the vertical about (y, -x, 0): each joint gets its share of that turn.
        angle = excess + min(INSIDE, 0.5 * linkage.tilt)
        square = 0.0
        j = linkage.tilted
        while j >= 0:
            if not linkage.slides[j]:
                square += _about(work.frames[j], linkage.axis[j], y / across, -x / across) ** 2
            j = linkage.parent[j]
        if square < 1e-6:
            return False
        j = linkage.tilted
        while j >= 0:
            if not linkage.slides[j]:
                share = _about(work.frames[j], linkage.axis[j], y / across, -x / across) / square
                q[j] = min(max(q[j] + angle * share, low[j]), high[j])
            j = linkage.parent[j]
    return False


@njit(**FAST)
def _about(frame, axis, x, y):
    """Return the component of a joint's axis along the horizontal direction (x, y)."""
    a = frame[0] * axis[0] + frame[1] * axis[1] + frame[2] * axis[2]
    b = frame[3] * axis[0] + frame[4] * axis[1] + frame[5] * axis[2]
    return a * x + b * y


@njit(**ENTRY)
def shorten(linkage, pieces, tree, work, path, count, random, tries, idle):
    """Shorten a path by proven lines between random points of it.

    Args:
        linkage: see `Linkage`.
        pieces: see `PackedPieces`.
        tree: boxes of the standing pieces.
        work: see `Workspace`.
        path: (N, J) joint values, with room for ``tries`` more points than ``count``.
        count: number of points that the path has.
        random: (1,) state of the random numbers.
        tries: how many lines to try.
        idle: how many were tried in vain last, in calls before; after `IDLE` of them no more are.

    Returns:
        How many points the path has then, and how many lines were tried in vain last.
    """
    a, b = work.q[2], work.q[3]
    for _ in range(tries):
        if count < 3 or idle == IDLE:
            break
        idle += 1
        total = 0.0
        for i in range(count - 1):
            total += _length(path[i], path[i + 1])
        s, t = _random(random) * total, _random(random) * total
        if s > t:
            s, t = t, s
        i = _at(path, count, s, a)
        k = _at(path, count, t, b)
        if k <= i or _length(a, b) > 0.999 * (t - s):
            continue
        if line_clearance(linkage, pieces, tree, work, a, b, 0.0, 0.5)[0] < 0.0:
            continue
        idle = 0
        count = _replace(path, count, i, k, a, b)
    return count, idle


@njit(**ENTRY)
def drop_points(linkage, pieces, tree, work, path, count, kept, tries):
    """Drop points of a path between whose neighbours the line is proven free, from its start on.

    Args:
        linkage, pieces, tree, work, path, count: see `shorten`.
        kept: number of points, after the first, of which is known that they stay.
        tries: how many points to look at.

    Returns:
        How many points the path has then, and how many of them stay.
    """
    for _ in range(tries):
        i = kept + 1
        if i >= count - 1:
            break
        if line_clearance(linkage, pieces, tree, work, path[i - 1], path[i + 1], 0.0, 0.5)[0] < 0.0:
            kept += 1
        else:
            for m in range(i, count - 1):
                for j in range(path.shape[1]):
                    path[m, j] = path[m + 1, j]
            count -= 1
    return count, kept


@njit(**FAST)
def _replace(path, count, i, k, a, b):
    """Put points a and b in place of those from i + 1 to k; return the new number of points."""
    shift = 2 - (k - i)
    if shift > 0:
        for m in range(count - 1, k, -1):
            for j in range(path.shape[1]):
                path[m + shift, j] = path[m, j]
    elif shift < 0:
        for m in range(k + 1, count):
            for j in range(path.shape[1]):
                path[m + shift, j] = path[m, j]
    for j in range(path.shape[1]):
        path[i + 1, j], path[i + 2, j] = a[j], b[j]
    return count + shift


@njit(**FAST)
def _at(path, count, length, out):
    """Write the point (J,) at a length along a path; return the point of the path before it."""
    for i in range(count - 1):
        own = _length(path[i], path[i + 1])
        if length <= own or i == count - 2:
            share = min(length / own, 1.0) if own > 0.0 else 0.0
            for j in range(path.shape[1]):
                out[j] = path[i, j] + share * (path[i + 1, j] - path[i, j])
            return i
        length -= own
    return count - 2


@njit(**FAST)
def _length(a, b):
    """Return the length (rad) of a line (J,) to (J,)."""
    square = 0.0
    for j in range(len(a)):
        square += (a[j] - b[j]) ** 2
    return math.sqrt(square)
