"""Configurations at and beside singular poses that curves of branches pass within a part of φ. Compiled.

Beside a pose where two axes align, such as those of a wrist, a branch swings by about half a turn of two
joints while φ hardly changes. Where they align, at a single φ, any turn will do. From both ends of a part
that looks like a smooth curve from the branch to the one with the other value of a root; but there may be
configurations inside the limits and free that only the swing has.

So the swing is followed by the joint that turns most, not by φ: it is given values all around, and the other
joints, φ among them, are found by Newton's method.
"""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.engine.redundancy.cover_types import GONE
from symgrasp.engine.redundancy.vectors import SAME_CURVE, largest_turn, wrapped
from symgrasp.engine.retreat_search import copy_row
from symgrasp.ik.joints import all_within, onto_limits, settle
from symgrasp.ik.newton import polish_in
from symgrasp.ik.self_motion import find_free_way
from symgrasp.ik.vectors import STRICT

__all__ = ["SWING_STEPS", "begin_swing", "crosses", "next_of_swing"]

SWING_STEPS = 32
"""Steps in which a swing is followed once all around."""

SINGULAR2 = 1e-3
"""Square of the least singular value of J (m/rad, or none) from which on no singular pose is near."""

BESIDE = 0.1
"""How far (rad) beyond a part φ may be on a swing."""


@njit(**STRICT)
def crosses(nodes, left, right, b, k):
    """Whether a branch goes on, over a part, as the one with the other value of root k of the closed form.

    Both are there at both ends, and the branch does not go on as itself. False for the second of the two.
    """
    other = b ^ (1 << k)
    if other < b:
        return False
    for at in (left, right):
        if nodes.state[at, b] == GONE or nodes.state[at, other] == GONE:
            return False
    here, there = nodes.q[left], nodes.q[right]
    if largest_turn(here[b], there[b], SAME_CURVE) < SAME_CURVE:
        return False
    return (
        largest_turn(here[b], there[other], SAME_CURVE) < SAME_CURVE
        or largest_turn(here[other], there[b], SAME_CURVE) < SAME_CURVE
    )


@njit(**STRICT)
def begin_swing(nodes, at, b):
    """Begin to follow the swing of a branch from a slot."""
    copy_row(nodes.q[at, b], nodes.half)
    for j in range(len(nodes.way)):
        nodes.way[j] = 1.0 + 0.1 * j


@njit(**STRICT)
def next_of_swing(nodes, memory, joint, T, step, low, high):
    """Go on to the next configuration of a swing.

    Args:
        nodes: `Nodes`, whose ``half`` (n,) is the configuration and ``way`` (n,) the way on.
        memory: `symgrasp.ik.branches.Memory`, whose row (n,) receives it inside the limits.
        joint: the locked joint.
        T: tool pose (4, 4).
        step: number of the step, from 0.
        low, high: the part (rad).

    Returns:
        Whether it could be followed, and whether the configuration is inside the limits.
    """
    chain, q, way = nodes.chain, nodes.half, nodes.way
    singular2 = SINGULAR2 if step else math.inf
    if not find_free_way(chain, q, T, way, singular2, memory.J, memory.A):
        return False, False
    most = 0
    for j in range(len(q)):
        if abs(way[j]) > abs(way[most]):
            most = j
        memory.pinned[j] = False
    memory.pinned[most] = True
    for j in range(len(q)):
        q[j] += 2.0 * math.pi / SWING_STEPS * way[j]
    if not polish_in(chain.forward, memory.pinned, q, T, memory.J, memory.A):
        return False, False
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if abs(wrapped(q[joint] - middle)) > half + BESIDE:
        return False, False
    row = memory.row
    copy_row(q, row)
    settle(chain.limits, row)
    fits = all_within(chain.limits, row)
    if fits:
        onto_limits(chain.limits, row)
    return True, fits
