"""Maps of an arm of five joints whose hand is held at given pitches: for planners, which need one pitch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik.arm_ik import centres
from symgrasp.object.manifold import ROLLS
from symgrasp.robot.pitch import SAME_PITCH, STEEPEST
from symgrasp.robot.robot import Arm

__all__ = ["at_pitches", "common_pitches"]


def at_pitches(maps: Sequence[FeasibilityMap], pitches: Sequence[float]) -> FeasibilityMap:
    """Return the maps of an arm and task at some pitches (rad) as one; see `FeasibilityMap.pitches`."""
    bodies = tuple(dict.fromkeys(name for m in maps for name in m.bodies))
    index = [np.array([*map(bodies.index, m.bodies), -1], dtype=np.int16) for m in maps]
    names = ("reason", "q", "sample", "branch", "clearance", "depth", "proven")
    arrays = {name: np.concatenate([getattr(m, name) for m in maps]) for name in names}
    pair = np.concatenate([own[m.pair] for own, m in zip(index, maps, strict=True)])
    # A sample is the pitch by its index; its sign, which depends on the roll, is in q.
    sample = np.where(arrays.pop("sample") < 0, -1, np.repeat(range(len(maps)), len(ROLLS))[:, None, None])
    certified = [m.certified for m in maps if m.certified is not None]
    return replace(
        maps[0],
        **arrays,
        certified=np.concatenate(certified) if len(certified) == len(maps) else None,
        refined=None,
        sample=sample,
        phi=np.array(pitches),
        pair=pair,
        bodies=bodies,
        pitches=tuple(map(float, pitches)),
    )


def common_pitches(arm: Arm, maps: Sequence[FeasibilityMap], everywhere: int, each: int) -> list[float]:
    """Return the pitches (rad) to try for one grasp in several tasks.

    Tasks differ in how narrow their pitches are: an upright object is held at almost any, one that lies
    across at hardly more than one. So besides values all over the range, each task contributes some of
    those at which its cells are held.

    Args:
        arm: the pitched arm.
        maps: its maps of the tasks, with the pitch free.
        everywhere: number of pitches all over the range.
        each: number of those that each task contributes.
    """
    found = centres(-STEEPEST, STEEPEST, everywhere).tolist()
    for m in maps:
        cells = map(tuple, np.argwhere(m.feasible))
        held = np.unique([round(arm.pitch_and_azimuth(m.q[c], c[0])[0] / SAME_PITCH) for c in cells])
        if len(held):
            found += (SAME_PITCH * np.quantile(held, np.linspace(0, 1, each), method="nearest")).tolist()
    return sorted(set(found))
