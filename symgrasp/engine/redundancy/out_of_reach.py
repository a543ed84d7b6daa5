"""Tool poses that an arm does not reach at any value of the redundancy φ. Compiled."""

from __future__ import annotations

import math

import numpy as np

from symgrasp.collision.pieces import pose_rows
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.reach import Reach, beyond_reach
from symgrasp.ik.at_phi import Locked, geometry_at
from symgrasp.ik.chain import Chain
from symgrasp.ik.joints import ROOT_TOLERANCE
from symgrasp.ik.spherical import reach as wrist_reach
from symgrasp.ik.vectors import STRICT
from symgrasp.poses import Array

__all__ = ["out_of_reach"]

CERTAIN = 1e-6
"""By how much (m) a pose is certain to be out of reach: more than numbers are rounded by."""


def out_of_reach(chain: Chain, locked: Locked, reach: Reach, tools: Array) -> np.ndarray:
    """Return of which tool poses (m, 4, 4) it is certain that an arm does not reach them.

    Args:
        chain: the arm.
        locked: its locked joint.
        reach: how far it reaches, with its shoulder in the base.
        tools: the poses, in the base.
    """
    beyond = np.zeros(len(tools), dtype=bool)
    turned = np.empty((5, chain.geometry.shape[1]))
    _mark(chain.joint, locked, reach, tools, pose_rows(tools), turned, beyond)
    return beyond


@njit(**ENTRY)
def _mark(joint, locked, reach, tools, rows, turned, beyond):
    """Write down which poses, given as matrices and as rows (m, 12), are out of reach.

    Turned (5, .) is memory for the arm's geometry at parts of a turn.
    """
    aside = locked.spherical
    for k in range(1, 6):
        aside &= locked.after[k] == locked.after[0]
    if aside:
        for k in range(len(turned)):
            geometry_at(locked, 0.4 * math.pi * k, turned[k])
    for i in range(len(tools)):
        beyond[i] = beyond_reach(reach, rows[i])[0] > CERTAIN or (
            aside and _elbow_is_beyond(turned, joint, tools[i])
        )


@njit(**STRICT)
def _elbow_is_beyond(turned, joint, T):
    """Whether the cosine that joint 4 needs for a pose (4, 4) is beyond ±1 at every φ.

    Where all free joints are on one side of the locked one, it is a trigonometric polynomial of φ of degree
    2, so five values determine it.
    """
    mean = c1 = s1 = c2 = s2 = 0.0
    for k in range(5):
        angle = 0.4 * math.pi * k
        value = 0.2 * wrist_reach(turned[k], joint, T)[2]
        mean += value
        c1 += 2.0 * value * math.cos(angle)
        s1 += 2.0 * value * math.sin(angle)
        c2 += 2.0 * value * math.cos(2.0 * angle)
        s2 += 2.0 * value * math.sin(2.0 * angle)
    return abs(mean) - math.sqrt(c1 * c1 + s1 * s1) - math.sqrt(c2 * c2 + s2 * s2) > 1.0 + ROOT_TOLERANCE
