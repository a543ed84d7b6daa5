"""Compiled inverse kinematics: all configurations at a tool pose and a redundancy value.

Each is computed by itself, in plain IEEE arithmetic: the answer at a pose and a redundancy value does not
depend on what else is asked.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik.arcs import ARCS, HALVINGS
from symgrasp.ik.chain import COSINE_TOLERANCE, THREE_PARALLEL, Chain
from symgrasp.ik.joints import (
    BLURS_SLIGHTLY,
    FAMILY,
    all_within,
    is_known,
    misses,
    onto_limits,
    settle,
    within,
)
from symgrasp.ik.newton import polish_in
from symgrasp.ik.pair.geometry import MEETING_PAIR
from symgrasp.ik.pair.polynomial import POLYNOMIAL_NUMBERS
from symgrasp.ik.pair.solver import PAIR_BRANCHES, pair_branches
from symgrasp.ik.pair.starts import STARTS
from symgrasp.ik.pair.zeros import VIEWS
from symgrasp.ik.parallel import parallel_branches
from symgrasp.ik.self_motion import CLOSE, PULLS, VERY_CLOSE, barely_into_limits, into_limits
from symgrasp.ik.spherical import spherical_branches
from symgrasp.ik.vectors import STRICT
from symgrasp.poses import Array
from symgrasp.robot.limits import LIMIT_TOLERANCE

__all__ = ["Memory", "branch_count", "branches_at", "branches_near", "new_memory", "solve_range"]

CLOSED_FORM_BRANCHES = 8
"""Branches of every closed form here: three times two values."""

MEMBERS = 16
"""Members of a family of configurations from which one inside the limits is sought."""

LISTED_MEMBERS, MOST_LISTED = 64, 128
"""Members of a family that are listed of an arm without redundancy, and of all families together at most:
which of them collide is not known here."""

STRIDE = 39
"""By how many members the next one is apart from the one before: a golden section of them."""

SAME_MEMBER = 1e-6
"""Largest difference (rad) of the joints of members that count as one: those of branches that coincide."""


class Memory(NamedTuple):
    """Arrays that the inverse kinematics of one thread writes to.

    Attributes:
        J: (n, 6) for `polish_in`.
        A: (n, n + 1) for `polish_in`.
        numbers: (POLYNOMIAL_NUMBERS,) complex numbers, for the polynomial of `pair_branches`.
        values: (2, ARCS + 2) its values all around, and on a part of a turn; then the size of the largest,
            and of their error.
        coefficients: (HALVINGS + 2, ARCS) its coefficients on parts of an arc.
        spans: (HALVINGS + 2, 2) where these parts begin and end.
        views: (VIEWS, 2) where the parts of a turn from which it is computed begin and end (rad), after the
            centre of the whole turn.
        starts: (2, STARTS, n) joint values, inside the limits and outside, from which Newton's method starts.
        counts: (2,) how many.
        row: (n,) joint values.
        pinned: (n,) which joints keep their values.
        near: (6, n) limits around a configuration, see `Chain`.
        missing: (B,) why a branch does not exist, where the last closed form was solved outside the limits
            too: the radicand (at least -9) of its root that is negative, less 10 times the root's number;
            else 0.
        free: (2,) the angle (rad) that a joint takes which may take any, NaN for whichever rounding makes it;
            and `FAMILY` where there was such a joint, `BLURS` where branches all but coincide,
            `BLURS_SLIGHTLY` where that is less so, else 0.
        q: (B, n) branches with other angles of such a joint.
        exists: (B,) which of them there are.
        inside: (B,) which are inside the limits.
    """

    J: Array
    A: Array
    numbers: np.ndarray
    values: Array
    coefficients: Array
    spans: Array
    views: Array
    starts: Array
    counts: np.ndarray
    row: Array
    pinned: np.ndarray
    near: Array
    missing: Array
    free: Array
    q: Array
    exists: np.ndarray
    inside: np.ndarray


def new_memory(joints: int) -> Memory:
    """Return memory for an arm of that many joints."""
    return Memory(
        np.empty((joints, 6)),
        np.empty((joints, joints + 1)),
        np.empty(POLYNOMIAL_NUMBERS, dtype=np.complex128),
        np.empty((2, ARCS + 2)),
        np.empty((HALVINGS + 2, ARCS)),
        np.empty((HALVINGS + 2, 2)),
        np.empty((VIEWS, 2)),
        np.empty((2, STARTS, joints)),
        np.empty(2, dtype=np.int64),
        np.empty(joints),
        np.empty(joints, dtype=bool),
        np.empty((6, joints)),
        np.zeros(PAIR_BRANCHES),
        np.zeros(2),
        np.empty((PAIR_BRANCHES, joints)),
        np.empty(PAIR_BRANCHES, dtype=bool),
        np.empty(PAIR_BRANCHES, dtype=bool),
    )


@njit(**STRICT)
def branch_count(chain):
    """Return how many branches an arm's inverse kinematics may have."""
    if chain.joint[8] == MEETING_PAIR:
        return PAIR_BRANCHES
    return CLOSED_FORM_BRANCHES + (MOST_LISTED if chain.joint[6] < 0 else 0)


@njit(**ENTRY)
def solve_range(chain, T, first, last, q, exists, inside, memory):
    """Solve a pose T (4, 4) at the redundancy values from first to before last; see `branches_at`."""
    for k in range(first, last):
        i = k - first
        branches_at(chain, k, T, False, q[i], exists[i], inside[i], memory)


@njit(**STRICT)
def branches_at(chain, k, T, inside_only, q, exists, inside, memory):
    """Solve one pose (4, 4) at redundancy sample k.

    Args:
        chain: the arm.
        k: index of the redundancy sample.
        T: tool pose (4, 4) in the base.
        inside_only: leave out branches outside the limits as early as possible; those that remain are
            bit for bit the same.
        q: (B, n) receives the joint values of the B = `branch_count` branches. Those after the ones of a
            closed form are members of families inside the limits, at singular poses of arms without
            redundancy.
        exists: (B,) receives which branches reach the pose.
        inside: (B,) receives which branches reach it inside the limits.
        memory: see `Memory`.

    Returns:
        False where it is known that no branch reaches the pose, limits or not.
    """
    g, joint, limits = chain.geometry[k], chain.joint, chain.leeway
    for b in range(exists.shape[0]):
        exists[b] = False
        inside[b] = False
    for b in range(memory.missing.shape[0]):
        memory.missing[b] = 0.0
    if joint[8] == MEETING_PAIR:
        solvable = pair_branches(chain, k, T, inside_only, q, exists, inside, memory)
        some = inside_only
        for b in range(exists.shape[0]):
            exists[b] = exists[b] and _in_cell(chain, q[b])
            some |= exists[b]
            if inside[b]:
                onto_limits(chain.limits, q[b])
        return solvable and some
    memory.free[0], memory.free[1] = math.nan, 0.0
    solvable = _closed_form(g, joint, limits, T, inside_only, q, exists, inside, memory)
    for b in range(CLOSED_FORM_BRANCHES):
        if exists[b]:
            exists[b], inside[b] = _end_branch(chain, T, q[b], inside[b], memory)
    if memory.free[1] != 0.0:
        _move_inside(chain, g, T, q, exists, inside, memory)
    if memory.free[1] == FAMILY and joint[6] < 0:
        _list_members(chain, g, T, q, exists, inside, memory)
    return solvable


@njit(**STRICT)
def _end_branch(chain, T, row, fits, memory):
    """Polish or check what the closed form found.

    Args:
        chain, T, memory: see `branches_at`.
        row: (n,) joint values, changed in place.
        fits: whether they are inside the leeway.

    Returns:
        Whether they reach the pose, and whether inside the limits.
    """
    if chain.joint[9]:
        reaches = polish_in(chain.forward, chain.fixed, row, T, memory.J, memory.A)
        settle(chain.limits, row)
    else:
        reaches = not misses(chain.forward, row, T)
    # Inside the leeway before, too: so an answer does not depend on what was left out early.
    fits = reaches and fits
    if fits and not all_within(chain.limits, row):
        fits = barely_into_limits(chain, row, T, memory)
    reaches = reaches and _in_cell(chain, row)
    if fits:
        onto_limits(chain.limits, row)
    return reaches, fits


@njit(**STRICT)
def _closed_form(g, joint, limits, T, inside_only, q, exists, inside, memory):
    """Solve one pose by the closed form of the arm's family; see `branches_at`."""
    if joint[8] == THREE_PARALLEL:
        return parallel_branches(
            g, joint, limits, T, inside_only, q, exists, inside, memory.numbers, memory.free
        )
    return spherical_branches(
        g, joint, limits, T, inside_only, q, exists, inside, memory.missing, memory.free
    )


@njit(**STRICT)
def _move_inside(chain, g, T, q, exists, inside, memory):
    """Replace branches outside the limits by configurations inside that share the work of joints otherwise.

    At a singular pose, where axes align, a branch stands for a family of configurations. Each is sought from
    several of its members: the families may be curved, and inside the limits in more than one part. Beside
    one, rounding may have put a branch beyond a limit.
    """
    close = VERY_CLOSE if memory.free[1] == BLURS_SLIGHTLY else CLOSE
    for i in range(MEMBERS if memory.free[1] == FAMILY else 1):
        for b in range(CLOSED_FORM_BRANCHES):
            memory.exists[b] = False
        memory.free[0] = 2.0 * math.pi * i / MEMBERS
        _closed_form(g, chain.joint, chain.leeway, T, False, memory.q, memory.exists, memory.inside, memory)
        left = False
        for b in range(CLOSED_FORM_BRANCHES):
            if inside[b] or not memory.exists[b]:
                continue
            left = True
            row = memory.q[b]
            if into_limits(chain, row, T, PULLS, close, memory.J, memory.A) and _in_cell(chain, row):
                for j in range(row.shape[0]):
                    q[b, j] = row[j]
                exists[b] = inside[b] = True
        if not left:
            break


@njit(**STRICT)
def _list_members(chain, g, T, q, exists, inside, memory):
    """Write members of families inside the limits after the branches of the closed form."""
    found = CLOSED_FORM_BRANCHES
    for i in range(LISTED_MEMBERS):
        for b in range(CLOSED_FORM_BRANCHES):
            memory.exists[b] = False
        # In an order that spreads evenly, should there be more of them than are listed.
        memory.free[0] = 2.0 * math.pi * ((STRIDE * i) % LISTED_MEMBERS + 0.5) / LISTED_MEMBERS
        _closed_form(g, chain.joint, chain.leeway, T, True, memory.q, memory.exists, memory.inside, memory)
        for b in range(CLOSED_FORM_BRANCHES):
            if not (memory.exists[b] and memory.inside[b]) or found == exists.shape[0]:
                continue
            row = memory.q[b]
            reaches, fits = _end_branch(chain, T, row, True, memory)
            if not (reaches and fits):
                continue
            for j in range(row.shape[0]):
                q[found, j] = row[j]
            if not is_known(q, CLOSED_FORM_BRANCHES, found, SAME_MEMBER):
                exists[found] = inside[found] = True
                found += 1


@njit(**STRICT)
def branches_near(chain, k, T, at, most, q, exists, inside, memory):
    """Solve one pose (4, 4) like `branches_at`, but for the branches inside the limits near a configuration.

    Those that turn a joint by more than ``most`` are left out early where that is known before they are
    polished; those that remain may be a full turn off, see `branches_at`.

    Args:
        chain, k, T, q, exists, inside, memory: see `branches_at`.
        at: (n,) joint values (rad) inside the limits.
        most: the largest turn (rad), below π.
    """
    limits, leeway = chain.limits, chain.leeway
    if chain.joint[8] != MEETING_PAIR and not chain.joint[9]:
        limits = leeway = memory.near
        for j in range(at.shape[0]):
            # Further than the tolerance of limits, so that no value is moved onto what is none.
            limits[0, j] = max(chain.limits[0, j], at[j] - most - 2 * LIMIT_TOLERANCE)
            limits[1, j] = min(chain.limits[1, j], at[j] + most + 2 * LIMIT_TOLERANCE)
            limits[2, j], limits[3, j], limits[4, j] = at[j], math.cos(at[j]), math.sin(at[j])
            limits[5, j] = math.cos(most) - COSINE_TOLERANCE
    near = Chain(chain.geometry, chain.joint, limits, leeway, chain.forward, chain.fixed)
    branches_at(near, k, T, True, q, exists, inside, memory)


@njit(**STRICT)
def _in_cell(chain, q):
    """Whether the azimuth of a pitched arm, if it is one, is within the cell that is to be reached."""
    j = chain.joint[10]
    return j < 0 or within(chain.limits, j, q[j])
