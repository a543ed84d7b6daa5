"""The map of an arm on a torso, put together from its maps at the samples of the torso."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.robot.robot import Arm

__all__ = ["at_torso", "merged"]


def at_torso(m: FeasibilityMap, arm: Arm, sample: int) -> FeasibilityMap:
    """Return the map of the arm alone at a sample of the torso as one of the whole arm.

    Args:
        m: the map of ``arm.at(sample)``.
        arm: the arm.
        sample: of its robot's torso.
    """
    assert arm.robot.torso is not None
    samples = np.where(m.feasible, m.sample + sample * len(m.phi), -1)
    q = np.where(m.feasible[..., None], arm.with_torso(sample, m.q), np.nan)
    return replace(m, q=q, sample=samples, phi=np.tile(m.phi, len(arm.robot.torso)))


def merged(maps: Sequence[FeasibilityMap]) -> FeasibilityMap:
    """Return the map that says of every cell the best that any of some maps says.

    Feasible cells take the witness with the largest clearance, the others the furthest reason, and of
    collisions of one kind the shallowest.

    Args:
        maps: maps of one arm and task on one grid.
    """
    bodies = tuple(dict.fromkeys(name for m in maps for name in m.bodies))
    pairs = [_renamed(m, bodies) for m in maps]
    depth = np.array([np.nan_to_num(m.depth, nan=np.inf) for m in maps])
    clearance = np.array([np.nan_to_num(m.clearance, nan=-1.0) for m in maps])
    reason = np.array([m.reason for m in maps])
    # lexsort sorts by its last key first, ascending
    best = np.lexsort((depth, -clearance, -reason.astype(int)), axis=0)[0]

    def pick(arrays: Sequence[np.ndarray]) -> np.ndarray:
        stacked = np.array(arrays)
        index = best.reshape(1, *best.shape, *(1,) * (stacked.ndim - 1 - best.ndim))
        return np.take_along_axis(stacked, index, axis=0)[0]

    names = ("reason", "q", "sample", "branch", "clearance", "depth")
    arrays = {name: pick([getattr(m, name) for m in maps]) for name in names}
    return replace(maps[0], **arrays, pair=pick(pairs), bodies=bodies)


def _renamed(m: FeasibilityMap, bodies: Sequence[str]) -> np.ndarray:
    """Return a map's pairs as indices into other names of bodies."""
    index = np.array([*(bodies.index(name) for name in m.bodies), -1], dtype=np.int16)
    return index[m.pair]
