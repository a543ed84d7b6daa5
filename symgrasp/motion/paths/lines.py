"""Straight paths of the tool, complete on the grid: dynamic programming over redundancy values and branches.

At every sample of the path the inverse kinematics gives all configurations. They are the layers of a graph,
whose edges are lines in joint space that turn no joint far and are proven free. The best path through the
layers has the largest smallest clearance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symgrasp.ik import Solver
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.paths.search import NoMotionError, blockers, prove
from symgrasp.poses import Array, inverse, pose_error
from symgrasp.progress import Progress, at_start, part_of
from symgrasp.robot.limits import moved_onto_limits

__all__ = ["CLEAR", "Leg", "LineTree", "configurations", "follow"]

LARGEST_TURN = 0.25
"""Largest change of a joint (rad or m) between two samples of a path."""

DEVIATION = 1e-3
"""Largest deviation (m) from the path in the middle of two samples, of the points that `follow` looks at."""

NEAR_TOOL = 0.1
"""Distance (m) of these points from the tool, unless told otherwise."""

CLEAR = 0.02
"""Clearance (m) above which paths are equally good."""


class Leg(NamedTuple):
    """A part of a path in which the same things may be touched.

    Attributes:
        situation: what moves and stands; only the arm that follows the path moves.
        poses: ``T_world_tool`` (4, 4) at each sample; the first one is the last one of the leg before.
    """

    situation: Situation
    poses: Sequence[Array]


@dataclass(frozen=True, eq=False)
class LineTree:
    """The best path to every configuration of the last layer that can be reached.

    Attributes:
        layers: (m, n) configurations of each sample, of those that can be reached.
        before: for each layer but the first, the index of the configuration before.
        value: (m,) clearance (m) of the path to each of the last layer.
    """

    layers: list[Array]
    before: list[np.ndarray]
    value: Array

    @property
    def ends(self) -> Array:
        """The configurations (m, n) of the last layer."""
        return self.layers[-1]

    def path(self, end: int) -> Array:
        """Return the path (samples, n) to one of the last layer."""
        k, rows = end, [self.layers[-1][end]]
        for layer, before in zip(self.layers[-2::-1], self.before[::-1], strict=True):
            k = int(before[k])
            rows.append(layer[k])
        return np.array(rows[::-1])


def configurations(solver: Solver, T_world_tool: Array) -> Array:
    """Return all configurations (m, n) inside the limits that reach a tool pose (4, 4)."""
    found = solver.solve(inverse(solver.arm.robot.T_world_base) @ T_world_tool)
    return found.q[found.inside]


def follow(
    legs: Sequence[Leg],
    solver: Solver,
    start: Array | None = None,
    end: Array | None = None,
    deviation: float = DEVIATION,
    distance: float = NEAR_TOOL,
    progress: Progress | None = None,
) -> LineTree:
    """Follow a path with an arm.

    Args:
        legs: the parts of the path, one after the other.
        solver: the inverse kinematics of the arm.
        start: (m, n) configurations at the first sample to start from; all that are free if None.
        end: (m, n) configurations at the last sample to arrive at; all of them if None.
        deviation: how far (m) points may be off the path between two samples.
        distance: how far (m) they are from the tool.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        NoMotionError: the path cannot be followed to its end; says where and why it ends.
    """
    steps = [(leg.situation, a, b) for leg in legs for a, b in pairwise(leg.poses)]
    situation, first = legs[0].situation, legs[0].poses[0]
    layer = configurations(solver, first) if start is None else start
    proof = prove(situation, layer, layer, CLEAR, at_start(progress))
    if not proof.free.any():
        raise NoMotionError(f"its start is not free: {blockers(situation, proof.hits)}")
    layer, reached = layer[proof.free], proof.clearance[proof.free]
    layers, befores = [layer], []
    for k, (situation, before, pose) in enumerate(steps, start=1):
        tell = part_of(progress, k - 1, len(steps))
        if tell:
            tell(0.0)
        last = k == len(steps)
        following = end if last and end is not None else configurations(solver, pose)
        new = _following_turns(layer, following, situation.linkage.limits)
        a, b = _edges(layer, new)
        middle = _middle(before, pose)
        straight = _deviation(solver, 0.5 * (layer[a] + new[a, b]), middle, distance) <= deviation
        a, b = a[straight], b[straight]
        proof = prove(situation, layer[a], new[a, b], CLEAR, tell)
        edge, ok = np.minimum(proof.clearance, reached[a]), proof.free
        if not ok.any():
            why = blockers(situation, proof.hits) if len(a) else "no joint values go on from there"
            raise NoMotionError(f"it ends at {100 * k / len(steps):.0f} % of its length: {why}")
        a, b, edge = a[ok], b[ok], edge[ok]
        order = np.lexsort((np.abs(layer[a] - new[a, b]).max(axis=1), -edge))
        _, best = np.unique(b[order], return_index=True)
        chosen = order[best]
        befores.append(a[chosen])
        layer, reached = new[a[chosen], b[chosen]], edge[chosen]
        layers.append(layer)
    return LineTree(layers, befores, reached)


def _following_turns(layer: Array, following: Array, limits: Array) -> Array:
    """Return what follows (m, k, n) each configuration: with full turns added towards it, within limits."""
    turns = 2 * np.pi * np.round((layer[:, None] - following[None]) / (2 * np.pi))
    near = following[None] + turns
    return moved_onto_limits(near, limits[0], limits[1], following[None])


def _edges(layer: Array, new: Array) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges without a jump, as indices of both ends."""
    if not new.size:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    a, b = np.nonzero(np.abs(new - layer[:, None]).max(axis=2) <= LARGEST_TURN)
    return a, b


def _middle(a: Array, b: Array) -> Array:
    """Return the pose (4, 4) half way between two that are near each other."""
    middle = 0.5 * (a + b)
    u, _, v = np.linalg.svd(middle[:3, :3])
    middle[:3, :3] = u @ v
    return middle


def _deviation(solver: Solver, q: Array, T_world_tool: Array, distance: float) -> Array:
    """Return how far (m) points at a distance (m) from the tool are off, if it should be at a pose (4, 4)."""
    if not len(q):
        return np.zeros(0)
    position, angle = pose_error(solver.arm.world_tool_pose(q), T_world_tool)
    return position + distance * angle
