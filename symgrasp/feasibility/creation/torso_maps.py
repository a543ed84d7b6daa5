"""The map of an arm on a torso, put together from its maps at the samples of the torso."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.refined import merged_parts
from symgrasp.robot.robot import Arm
from symgrasp.robot.torso import Torso

__all__ = ["at_torso", "merged", "torso_sample"]


def at_torso(m: FeasibilityMap, arm: Arm, sample: int, count: int) -> FeasibilityMap:
    """Return the map of the arm alone at a sample of the torso as one of the whole arm.

    Args:
        m: the map of ``arm.at(sample)``.
        arm: the arm.
        sample: of its robot's torso.
        count: number K of redundancy samples of the arm alone. Values that its map has besides come after
            those of all torso samples.
    """
    assert arm.robot.torso is not None
    torso = len(arm.robot.torso)
    own = m.sample + np.where(m.sample < count, sample, torso - 1) * count
    samples = np.where(m.feasible, own, -1)
    q = np.where(m.feasible[..., None], arm.with_torso(sample, m.q), np.nan)
    return replace(m, q=q, sample=samples, phi=np.append(np.tile(m.phi[:count], torso), m.phi[count:]))


def torso_sample(m: FeasibilityMap, torso: Torso, cell: tuple[int, int, int]) -> int:
    """Return the sample of the torso at which the witness of a cell is; -1 where the cell is infeasible."""
    return torso.samples_at(m.q[cell][: len(torso.joint_names)].tolist())[0] if m.feasible[cell] else -1


def merged(maps: Sequence[FeasibilityMap]) -> FeasibilityMap:
    """Return the map that says of every cell the best that any of some maps says.

    Feasible cells take the witness with the largest clearance, the others the furthest reason, and of
    collisions of one kind the shallowest.

    Args:
        maps: maps of one arm and task on one grid.
    """
    maps = _with_one_phi(maps)
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
    arrays: dict[str, Any] = {name: pick([getattr(m, name) for m in maps]) for name in names}
    proven = np.logical_and.reduce([m.proven for m in maps])
    arrays["certified"] = None  # unless all maps say what is
    certified = [m.certified for m in maps if m.certified is not None]
    if len(certified) == len(maps):
        whole = [c & m.feasible for c, m in zip(certified, maps, strict=True)]
        none = [c & ~m.feasible for c, m in zip(certified, maps, strict=True)]
        arrays["certified"] = np.logical_or.reduce(whole) | np.logical_and.reduce(none)
    parts = [m.refined for m in maps if m.refined is not None]
    refined = merged_parts(parts) if len(parts) == len(maps) else None
    resolutions = [m.resolution for m in maps]
    arrays["resolution"] = max(resolutions) if all(resolutions) else 0.0
    return replace(maps[0], refined=refined, **arrays, pair=pick(pairs), bodies=bodies, proven=proven)


def _with_one_phi(maps: Sequence[FeasibilityMap]) -> list[FeasibilityMap]:
    """Return the maps with the redundancy values of all: first those that they share, then each one's own."""
    shared = min(len(m.phi) for m in maps)
    differ = np.flatnonzero([len({float(m.phi[k]) for m in maps}) > 1 for k in range(shared)])
    shared = int(differ[0]) if len(differ) else shared
    phi = np.concatenate([maps[0].phi[:shared], *(m.phi[shared:] for m in maps)])
    found, before = [], 0
    for m in maps:
        found.append(replace(m, sample=np.where(m.sample >= shared, m.sample + before, m.sample), phi=phi))
        before += len(m.phi) - shared
    return found


def _renamed(m: FeasibilityMap, bodies: Sequence[str]) -> np.ndarray:
    """Return a map's pairs as indices into other names of bodies."""
    index = np.array([*(bodies.index(name) for name in m.bodies), -1], dtype=np.int16)
    return index[m.pair]
